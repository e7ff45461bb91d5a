"""Markers on the plate: the board, what they tell of a camera, and a fit through cameras that they put right."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from board_pictures import Noise, RayField, draw_board
from cli_tools import done, refused
from small_frames import tower

from frametwin.calibration.boards import corner_points, faces, parse_board
from frametwin.calibration.patterns import black_rectangles
from frametwin.cameras import Camera
from frametwin.cameras.plate import FILE_NAME, FORMAT, VERSION, Plate
from frametwin.cameras.rig_file import Rig, RigCamera, read_rig, write_rig
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.capture.image_files import write_png
from frametwin.errors import InputError
from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting import api
from frametwin.fitting.api import fit_capture
from frametwin.fitting.camera_corrections import as_found, corrections_between
from frametwin.fitting.camera_freedoms import LENS, RigErrors, corrected
from frametwin.fitting.plate_cameras import CORNER, NONE_SEEN, resected, through_plate
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.twin import Twin

BOARD = "plate:8x8:14:11:APRILTAG_36h11"
USUAL = RigErrors()
FILAMENT = np.array([230.0, 120.0, 30.0])
TOUCHED = 2


def nudged(camera: Camera, size: float, draw: np.random.Generator) -> Camera:
    """A camera that is off by chance, in each freedom but the lens by so many of the usual deviations."""
    freedoms = size * USUAL.deviations() * draw.normal(size=10)
    freedoms[LENS] = 0.0
    return corrected([camera], freedoms[None])[0]


@pytest.fixture(scope="module")
def plate() -> Plate:
    pose = np.eye(4)
    pose[:3, 3] = 12.0, 8.0, -1.0
    return Plate(BOARD, pose)


@pytest.fixture(scope="module")
def frame() -> Wireframe:
    return tower(2)


@pytest.fixture(scope="module")
def real(frame: Wireframe, plate: Plate) -> tuple[Camera, ...]:
    """Cameras that see print and plate."""
    reach = np.array([[-60.0, -60.0, 0.0], [60.0, 60.0, 40.0]])
    return ring_rig(reach + frame.bounds.mean(axis=0) * (1.0, 1.0, 0.0), 6, size=(720, 960), elevation_deg=40.0)


@pytest.fixture(scope="module")
def capture(
    frame: Wireframe, real: tuple[Camera, ...], plate: Plate, tmp_path_factory: pytest.TempPathFactory
) -> Capture:
    """Photographs of the print on the plate, whose cameras are said to be elsewhere, one by far."""
    folder = tmp_path_factory.mktemp("plate") / "capture"
    images, backgrounds = [], []
    shares = silhouettes(frame, real, supersampling=3)
    for i, (camera, share) in enumerate(zip(real, shares, strict=True)):
        middle = np.array(plate.pose)
        grey = draw_board(RayField(RigCamera.of(camera)), parse_board(plate.board), middle, noise=Noise(seed=i))
        there = share[..., None] / 255.0
        background = np.repeat(grey[..., None], 3, axis=2)
        images.append((background * (1.0 - there) + FILAMENT * there).round().astype(np.uint8))
        backgrounds.append(background)
    draw = np.random.default_rng(3)
    said = [nudged(camera, 0.5 if i != TOUCHED else 6.0, draw) for i, camera in enumerate(real)]
    write_capture(folder, frame, said, images, backgrounds=backgrounds)
    (folder / FILE_NAME).write_text(json.dumps({"format": FORMAT, "version": VERSION, **plate.as_dict()}))
    return read_capture(folder)


def test_a_plate_leaves_its_middle_free_for_the_print() -> None:
    board = parse_board("plate:10x7:40")
    assert board.text == "plate:10x7:40:30:APRILTAG_36h11"
    (face,) = faces(board)
    assert len(face.marker_ids) == 30 and len(corner_points(board)) == 120
    left, bottom, right, top = black_rectangles(face).T
    free = (np.minimum(right, 140.0) > np.maximum(left, -140.0)) & (np.minimum(top, 80.0) > np.maximum(bottom, -80.0))
    assert not free.any()
    assert right.max() == pytest.approx(4.5 * 40.0 + 15.0) and top.max() == pytest.approx(3.0 * 40.0 + 15.0)


def test_a_plate_that_is_too_small_or_has_too_many_tags_is_refused() -> None:
    with pytest.raises(InputError, match="not a size of such a board"):
        parse_board("plate:2x5:40")
    with pytest.raises(InputError, match="has 60 markers and 4X4_50 only 50"):
        parse_board("plate:16x16:20:15:4X4_50")


def test_a_plate_is_printed_by_one_command(tmp_path: Path) -> None:
    done("calibrate", "board", "--kind", "plate", "--size", "6x5", "--square", "30", "--out", tmp_path / "plate.pdf")
    assert (tmp_path / "plate.pdf").read_bytes().startswith(b"%PDF")


def test_corrections_between_cameras_are_those_that_were_made(real: tuple[Camera, ...]) -> None:
    freedoms = USUAL.deviations() * np.random.default_rng(1).normal(size=10)
    freedoms[LENS] = 0.0
    after = corrected(real[:1], freedoms[None])[0]
    np.testing.assert_allclose(corrections_between(real[0], after), freedoms, atol=1e-9)


def test_what_markers_leave_open_is_what_their_covariance_says(real: tuple[Camera, ...], plate: Plate) -> None:
    """Over many draws the true correction lies as far from the one found as ten independent freedoms do."""
    draw, points = (
        np.random.default_rng(7),
        corner_points(parse_board(BOARD)) @ plate.pose[:3, :3].T + plate.pose[:3, 3],
    )
    distances = []
    for _ in range(24):
        said = nudged(real[0], 1.0, draw)
        pixels = real[0].project(points)[0] + CORNER * draw.normal(size=(len(points), 2))
        found = resected(said, points, pixels, np.diag(USUAL.deviations() ** 2))
        missed = corrections_between(said, real[0]) - found.freedoms
        missed[LENS] = 0.0
        distances.append(missed @ np.linalg.solve(found.covariance, missed))
    assert 6.0 < np.mean(distances) < 14.0


def test_cameras_come_back_to_where_the_pictures_were_taken(capture: Capture, real: tuple[Camera, ...]) -> None:
    placed = through_plate(capture, USUAL)
    for view, said, camera, found in zip(placed.capture.views, capture.views, real, placed.found, strict=True):
        assert found is not None and found.corners >= 12
        points = capture.frame.vertices
        seen = camera.project(points)[0]
        before = np.linalg.norm(said.camera.project(points)[0] - seen, axis=1).mean()
        after = np.linalg.norm(view.camera.project(points)[0] - seen, axis=1).mean()
        assert before > 1.0 and after < 0.35


def test_a_fit_on_a_plate_names_the_touched_camera_and_uses_it(capture: Capture, real: tuple[Camera, ...]) -> None:
    twin = fit_capture(capture).twin
    assert evaluate(twin.control_points, twin.vertices, capture.frame).curves.mean < 0.08
    named = [reason for reason in twin.verdict.reasons if "by the plate's markers" in reason]
    assert [reason.split(":")[0] for reason in named] == [f"view {real[TOUCHED].name}"]
    assert all(view["used"] for view in twin.views)
    found = as_found([view.camera for view in capture.views], twin.cameras)
    for camera, wanted in zip(found, real, strict=True):
        off = camera.project(capture.frame.vertices)[0] - wanted.project(capture.frame.vertices)[0]
        assert np.linalg.norm(off, axis=1).mean() < 0.4


def test_exact_cameras_are_believed_against_the_plate(capture: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "ROUNDS", 0)
    twin = fit_capture(capture, changes={"cameras": "exact"}).twin
    assert not twin.cameras and not any("plate" in reason for reason in twin.verdict.reasons)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"board": "plate:8x8"}, "is not written as a board"),
        ({"board": None}, "is not a board and its pose"),
        ({"transform_matrix": [[2.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, "is not a rigid pose"),
        ({"version": 2}, "version"),
        ({"transform_matrix": [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, "its markers are .* px from"),
    ],
)
def test_a_plate_that_is_not_there_as_it_says_is_refused(
    capture: Capture, plate: Plate, change: dict[str, object], words: str
) -> None:
    data = {"format": FORMAT, "version": VERSION, **plate.as_dict(), **change}
    file = capture.root / FILE_NAME
    kept = file.read_bytes()
    try:
        file.write_text(json.dumps(data))
        with pytest.raises(InputError, match=words):
            through_plate(read_capture(capture.root), USUAL)
    finally:
        file.write_bytes(kept)


def test_a_plate_that_was_printed_larger_makes_the_twin_doubtful(capture: Capture, plate: Plate) -> None:
    larger = Plate("plate:8x8:15.5:12:APRILTAG_36h11", plate.pose)
    twin = fit_capture(dataclasses.replace(capture, plate=larger)).twin
    assert twin.verdict.status != "good" and any("printed at another size" in why for why in twin.verdict.reasons)


def test_views_without_markers_keep_their_cameras_and_are_named(capture: Capture, tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    shutil.copytree(capture.root, folder)
    view = capture.views[1]
    write_png(folder / capture.name_of(view.image), np.full((view.camera.height, view.camera.width), 90, np.uint8))
    placed = through_plate(read_capture(folder), USUAL)
    assert [found is None for found in placed.found] == [False, True, False, False, False, False]
    np.testing.assert_array_equal(placed.capture.views[1].camera.camera_to_world, view.camera.camera_to_world)
    frame = capture.frame
    whole = np.ones((frame.strut_count, 2))
    plan = Twin(frame.control_points, frame.vertices, whole, whole, whole[:, 0], whole[:, 0])
    twin = placed.told(plan)
    assert any(reason.startswith(f"view {view.camera.name} shows too little") for reason in twin.verdict.reasons)


def test_masks_that_show_no_markers_are_told_of_once(
    capture: Capture, real: tuple[Camera, ...], plate: Plate, tmp_path: Path
) -> None:
    write_capture(tmp_path / "masks", capture.frame, real, silhouettes(capture.frame, real))
    twin = fit_capture(dataclasses.replace(read_capture(tmp_path / "masks"), plate=plate)).twin
    assert [reason for reason in twin.verdict.reasons if "markers" in reason] == [NONE_SEEN]
    assert twin.verdict.status == "good" and not twin.cameras


def test_a_rig_keeps_its_plate_and_moves_it_along(real: tuple[Camera, ...], plate: Plate, tmp_path: Path) -> None:
    cameras = tuple(RigCamera.of(camera) for camera in real)
    motion = np.eye(4)
    motion[:3, 3] = 100.0, 20.0, -5.0
    rig = Rig(cameras, "robot", "checkerboard:9x6:25", plate=plate).moved(motion)
    write_rig(tmp_path, rig)
    back = read_rig(tmp_path)
    assert back.plate is not None and back.plate.board == BOARD
    np.testing.assert_allclose(back.plate.pose[:3, 3], plate.pose[:3, 3] + (100.0, 20.0, -5.0))


def test_anchor_plate_asks_for_a_plate(tmp_path: Path, capture: Capture, real: tuple[Camera, ...]) -> None:
    write_capture(tmp_path / "bare", capture.frame, real, silhouettes(capture.frame, real))
    assert "no markers on the plate" in refused(
        "fit", tmp_path / "bare", "--out", tmp_path / "run", "--anchor", "plate"
    )
