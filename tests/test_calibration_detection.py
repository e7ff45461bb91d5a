"""Boards in pictures of known cameras: corners to a part of a pixel, and boards printed in odd ways recognised."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from board_pictures import Noise, RayField, draw_board, ring, write_pictures
from calibration_scene import LENS, SIZE

from frametwin.calibration.boards import corner_points, parse_board
from frametwin.calibration.detection import Look, find_corners, object_points, possible_looks
from frametwin.calibration.looking import look_for
from frametwin.calibration.pictures import list_pictures
from frametwin.cameras.lens_models import project
from frametwin.dataset.calibration_shots import random_pose
from frametwin.errors import InputError

CAMERA = ring(1, 500.0, LENS, SIZE)[0]


@pytest.fixture(scope="module")
def field() -> RayField:
    return RayField(CAMERA)


def true_pixels(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    world = points @ pose[:3, :3].T + pose[:3, 3]
    local = (world - CAMERA.centre) @ CAMERA.camera_to_world[:3, :3]
    return project(CAMERA.model, CAMERA.lens, local)[0]


def facing(seed: int, tilt_deg: float = 30.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return random_pose(rng, rng.uniform(-20.0, 20.0, size=3), CAMERA.centre, tilt_deg)


@pytest.mark.parametrize(
    ("text", "rms"),
    [("checkerboard:9x6:22", 0.03), ("charuco:7x5:28", 0.03), ("charuco:6x8:24", 0.03), ("aprilgrid:5x4:32", 0.2)],
)
def test_corners_are_where_they_are(field: RayField, text: str, rms: float) -> None:
    board = parse_board(text)
    errors = []
    for seed in range(2):
        pose = facing(seed)
        corners, pixels = find_corners(draw_board(field, board, pose, noise=Noise(seed=seed)), board, Look())
        assert len(corners) >= 0.9 * len(corner_points(board))
        errors.append(pixels - true_pixels(corner_points(board)[corners], pose))
    error = np.concatenate(errors)
    assert np.sqrt((error**2).mean()) < rms
    assert np.abs(error.mean(axis=0)).max() < 0.03  # half a pixel would be another convention


@pytest.mark.parametrize("text", ["checkerboard:9x6:22", "charuco:7x5:28"])
@pytest.mark.parametrize(("tilt", "blur", "rms"), [(30.0, 0.6, 0.03), (30.0, 1.5, 0.03), (70.0, 0.6, 0.04)])
def test_steep_boards_blur_and_a_tone_curve_do_not_move_corners(
    field: RayField, text: str, tilt: float, blur: float, rms: float
) -> None:
    board = parse_board(text)
    pose = facing(1, 0.0)
    angle = np.radians(tilt)
    pose[:3, :3] = pose[:3, :3] @ [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    light = draw_board(field, board, pose, noise=Noise(blur=blur)) / 255.0
    picture = np.rint(255.0 * light ** (1.0 / 2.2)).astype(np.uint8)
    corners, pixels = find_corners(picture, board, Look())
    error = pixels - true_pixels(corner_points(board)[corners], pose)
    assert len(corners) >= 0.75 * len(corner_points(board)) and np.sqrt((error**2).mean()) < rms
    assert np.abs(error).max() < 0.3


def test_three_faces_of_the_block_are_seen_at_once(field: RayField) -> None:
    board = parse_board("cuboid:50x60x70:14:10")
    pose = np.eye(4)
    corners, pixels = find_corners(draw_board(field, board, pose), board, Look())
    error = pixels - true_pixels(corner_points(board)[corners], pose)
    assert len(corners) >= 15 and len(np.unique(corner_points(board)[corners].round(1), axis=0)) == len(corners)
    assert np.median(np.linalg.norm(error, axis=1)) < 0.05 and np.abs(error).max() < 0.2


@pytest.mark.parametrize("text", ["charuco:7x5:28", "charuco:5x6:28", "aprilgrid:5x4:32"])
def test_boards_printed_in_odd_ways_are_recognised_and_told(field: RayField, tmp_path: Path, text: str) -> None:
    board = parse_board(text)
    for look in possible_looks(board):
        folder = tmp_path / f"{look.inverted}{look.mirrored}{look.legacy}"
        pose = facing(3)
        write_pictures(folder, "cam", [("a", draw_board(field, board, pose, look))])
        looked = look_for(list_pictures(folder), board, folder)
        assert looked.looks == {"cam": look}
        notes = " ".join(looked.notes)
        assert ("inverted" in notes, "mirrored" in notes, "4.6" in notes) == (look.inverted, look.mirrored, look.legacy)
        sighting = looked.sightings[0]
        np.testing.assert_array_equal(sighting.points, object_points(board, sighting.corners, look))
        error = sighting.pixels - true_pixels(sighting.points, pose)
        assert np.median(np.abs(error)) < 0.15


def test_a_camera_that_mirrors_its_pictures_is_named(field: RayField, tmp_path: Path) -> None:
    board = parse_board("charuco:7x5:28")
    picture = draw_board(field, board, facing(1))
    write_pictures(tmp_path, "a", [("0", picture)])
    write_pictures(tmp_path, "b", [("0", np.ascontiguousarray(picture[:, ::-1]))])
    with pytest.raises(InputError, match=r"b: camera: .*mirrored"):
        look_for(list_pictures(tmp_path), board, tmp_path)


def test_a_checkerboard_may_be_given_by_its_squares(field: RayField, tmp_path: Path) -> None:
    picture = draw_board(field, parse_board("checkerboard:8x5:24"), facing(1))
    write_pictures(tmp_path, "a", [("0", picture)])
    looked = look_for(list_pictures(tmp_path), parse_board("checkerboard:9x6:24"), tmp_path)
    assert looked.board.text == "checkerboard:8x5:24" and "9 x 6 squares" in looked.notes[0]


def test_another_dictionary_is_told(field: RayField, tmp_path: Path) -> None:
    picture = draw_board(field, parse_board("charuco:7x5:28:20:5X5_100"), facing(1))
    write_pictures(tmp_path, "a", [("0", picture)])
    with pytest.raises(InputError, match="markers of 5X5"):
        look_for(list_pictures(tmp_path), parse_board("charuco:7x5:28:20:4X4_250"), tmp_path)


def test_pictures_of_no_use_are_named_with_the_reason(field: RayField, tmp_path: Path) -> None:
    board = parse_board("charuco:7x5:28")
    good = draw_board(field, board, facing(1))
    write_pictures(tmp_path, "a", [("0", good), ("1", good), ("2", np.full_like(good, 90)), ("3", good[:-8])])
    data = (tmp_path / "a" / "0.png").read_bytes()
    (tmp_path / "a" / "4.png").write_bytes(data[: len(data) // 2])
    (tmp_path / "a" / "5.jpg").write_bytes(b"no picture")
    looked = look_for(list_pictures(tmp_path), board, tmp_path)
    reasons = {note.picture: note.reason for note in looked.left_out}
    assert [sighting.picture for sighting in looked.sightings] == ["0"]
    for name, words in {
        "1": "same picture",
        "2": "not found",
        "3": "pixels where",
        "4": "cut short",
        "5": "PNG",
    }.items():
        assert words in reasons[name]


def test_folders_without_pictures_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        list_pictures(tmp_path / "none")
    with pytest.raises(InputError, match="holds no pictures"):
        list_pictures(tmp_path)
    (tmp_path / "a").mkdir()
    for name in ("x.png", "x.jpg"):
        assert cv2.imwrite(str(tmp_path / "a" / name), np.zeros((4, 4), dtype=np.uint8))
    with pytest.raises(InputError, match="two pictures"):
        list_pictures(tmp_path)
