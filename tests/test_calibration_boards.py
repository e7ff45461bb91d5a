"""Boards as they are written, printed at true scale, and found again in what a reader of PDF makes of the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_tools import done, refused

from frametwin.calibration.board_pdf import board_pdf, write_board
from frametwin.calibration.boards import corner_points, faces, looks_the_same_turned, parse_board
from frametwin.calibration.detection import Look, find_corners
from frametwin.calibration.patterns import black_rectangles
from frametwin.calibration.sheets import FOOT, MARGIN, sheet
from frametwin.errors import InputError

pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2, which reads PDF files, is not installed")

BOARDS = ("checkerboard:7x5:20", "charuco:7x5:25:18:4X4_250", "charuco:5x8:20", "aprilgrid:5x4:30", "cuboid")
DPI = 300
PIXELS_PER_MM = DPI / 25.4


def rasterised(data: bytes) -> np.ndarray:
    """The first page (H, W) uint8."""
    page = pdfium.PdfDocument(data)[0]
    return np.ascontiguousarray(page.render(scale=DPI / 72.0, grayscale=True).to_numpy())


def test_boards_are_read_as_they_are_written() -> None:
    for text in BOARDS:
        board = parse_board(text)
        assert parse_board(board.text) == board
    assert parse_board("CHARUCO:4x5:54:40.5:DICT_4X4_1000").text == "charuco:4x5:54:40.5:4X4_1000"
    assert parse_board("aprilgrid:6x6:30:21:36h11").dictionary == "APRILTAG_36h11"
    assert parse_board("cuboid").edges == (50.0, 60.0, 70.0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "chess:9x6:25",
        "checkerboard:9x6",
        "checkerboard:9by6:25",
        "checkerboard:2x6:25",
        "checkerboard:9x6:0",
        "checkerboard:9x6:nan",
        "checkerboard:9x6:25:18",
        "charuco:7x5:30:30",
        "charuco:7x5:30:22:FOUR",
        "charuco:30x30:10:7:4X4_50",
        "cuboid:50x60",
        "cuboid:50x60x70:40",
    ],
)
def test_what_is_no_board_is_refused_in_words(text: str) -> None:
    with pytest.raises(InputError, match="--board"):
        parse_board(text)


@pytest.mark.parametrize("text", BOARDS)
def test_corners_lie_where_black_and_white_meet(text: str) -> None:
    for face in faces(parse_board(text)):
        rectangles = black_rectangles(face)
        corners = np.concatenate([rectangles[:, [0, 1]], rectangles[:, [2, 1]], rectangles[:, [2, 3]]])
        corners = np.concatenate([corners, rectangles[:, [0, 3]]])
        away = np.linalg.norm(face.flat_corners[:, None] - corners, axis=2).min(axis=1)
        assert away.max() < 1e-9
        # The pattern is centred, and nothing is black twice.
        np.testing.assert_allclose(face.flat_corners.mean(axis=0), 0.0, atol=1e-9)
        width, height = (rectangles[:, 2:] - rectangles[:, :2]).T
        assert (width > 0).all() and (height > 0).all()


def test_the_faces_of_the_block_look_outwards_from_where_they_are() -> None:
    board = parse_board("cuboid")
    points = corner_points(board)
    for face in faces(board):
        middle, normal = face.pose[:3, 3], face.pose[:3, 2]
        assert np.linalg.det(face.pose[:3, :3]) == pytest.approx(1.0)
        assert normal @ (middle - (0.0, 0.0, 35.0)) > 20.0
        own = points[face.first_corner : face.first_corner + face.corner_count]
        np.testing.assert_allclose((own - middle) @ normal, 0.0, atol=1e-9)
    assert points[:, 2].min() > 0.0 and points[:, 2].max() == 70.0
    markers = [number for face in faces(board) for number in face.marker_ids]
    assert len(set(markers)) == len(markers)


@pytest.mark.parametrize("text", BOARDS)
def test_a_printed_board_has_its_true_size_and_is_found_again(text: str) -> None:
    board = parse_board(text)
    drawn = sheet(board)
    picture = rasterised(board_pdf(drawn, board.text))
    assert picture.shape == pytest.approx((drawn.height * PIXELS_PER_MM, drawn.width * PIXELS_PER_MM), abs=1.5)
    corners, pixels = find_corners(picture, board, Look())
    assert len(corners) == len(corner_points(board))
    page = np.stack([pixels[:, 0], picture.shape[0] - pixels[:, 1]], axis=1) / PIXELS_PER_MM
    for face, origin in zip(faces(board), drawn.origins, strict=True):
        own = (corners >= face.first_corner) & (corners < face.first_corner + face.corner_count)
        wanted = face.flat_corners @ origin[:2, :2].T + origin[:2, 3]
        # Places to a tenth of a mm (the page is cut to whole pixels), distances to 0.02 mm: half a thousandth.
        assert np.abs(page[own] - wanted).max() < 0.1
        spread = np.linalg.norm(page[own] - page[own].mean(axis=0), axis=1)
        np.testing.assert_allclose(spread, np.linalg.norm(face.flat_corners, axis=1), atol=0.02)


def test_the_ruler_is_a_hundred_millimetres_long() -> None:
    board = parse_board("checkerboard:7x5:20")
    picture = rasterised(board_pdf(sheet(board), board.text))
    foot = picture[-round((MARGIN + FOOT) * PIXELS_PER_MM) :] < 128
    columns = np.flatnonzero(foot[np.argmax(foot.sum(axis=1))])  # the row of the long line
    assert (columns[-1] - columns[0] + 1) / PIXELS_PER_MM == pytest.approx(100.0, abs=0.25)


def test_the_same_board_gives_the_same_file(tmp_path: Path) -> None:
    board = parse_board("cuboid")
    for name in ("a.pdf", "b.pdf"):
        write_board(tmp_path / name, board)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_boards_that_a_half_turn_does_not_change_are_known() -> None:
    assert looks_the_same_turned(parse_board("checkerboard:8x6:20"))
    assert not looks_the_same_turned(parse_board("checkerboard:9x6:20"))
    assert not looks_the_same_turned(parse_board("charuco:8x6:20"))


def test_the_command_writes_a_board(tmp_path: Path) -> None:
    out = tmp_path / "board.pdf"
    result = done("calibrate", "board", "--kind", "charuco", "--size", "5x4", "--square", "30", "--out", out)
    assert "charuco:5x4:30" in result.stdout and out.read_bytes().startswith(b"%PDF")
    done("calibrate", "board", "--kind", "cuboid", "--out", out, "--overwrite")
    done("calibrate", "board", "--board", "aprilgrid:4x3:30", "--out", tmp_path / "april.pdf")


def test_what_cannot_be_printed_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "board.pdf"
    assert "fit" in refused("calibrate", "board", "--board", "checkerboard:9x6:40", "--page", "a4", "--out", out)
    assert "--page" in refused("calibrate", "board", "--board", "cuboid", "--page", "b5", "--out", out)
    assert "--kind" in refused("calibrate", "board", "--out", out)
    assert not out.exists()
    out.write_bytes(b"mine")
    assert "--overwrite" in refused("calibrate", "board", "--kind", "cuboid", "--out", out)
    assert out.read_bytes() == b"mine"
