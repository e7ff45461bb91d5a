"""COLMAP text models: there and back, as COLMAP writes them, and damaged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from camera_cases import CASES, assert_same, random_camera

from frametwin.cameras import read_colmap_text, write_colmap_text
from frametwin.errors import InputError


def test_colmap_and_back(tmp_path: Path) -> None:
    no_k3 = replace(random_camera(90), distortion=np.array([0.1, -0.02, 1e-4, 3e-4, 0.0]))
    cameras = [*(random_camera(seed, distorted=seed % 2 == 0) for seed in CASES), no_k3]
    write_colmap_text(tmp_path / "model", cameras)
    models = {line.split()[1] for line in (tmp_path / "model/cameras.txt").read_text().splitlines()[1:]}
    assert models == {"PINHOLE", "OPENCV", "FULL_OPENCV"}
    assert (tmp_path / "model/points3D.txt").exists()
    for found, wanted in zip(read_colmap_text(tmp_path / "model"), cameras, strict=True):
        assert_same(found, wanted)


def test_colmap_fisheye_and_back(tmp_path: Path) -> None:
    """COLMAP's OPENCV_FISHEYE has the four coefficients of OpenCV's, in the same order."""
    lens = np.array([0.02, -0.004, 0.001, -0.0002])
    camera = replace(random_camera(3), distortion=lens, model="OPENCV_FISHEYE")
    write_colmap_text(tmp_path, [camera])
    fields = (tmp_path / "cameras.txt").read_text().splitlines()[1].split()
    assert fields[1] == "OPENCV_FISHEYE" and [float(value) for value in fields[8:]] == lens.tolist()
    (found,) = read_colmap_text(tmp_path)
    assert found.model == "OPENCV_FISHEYE" and np.array_equal(found.distortion, lens)


def test_colmap_poses_of_half_turns(tmp_path: Path) -> None:
    # Rotations by 180 degrees have w = 0 in the quaternion, where a careless conversion divides by zero.
    base = random_camera(0)
    cameras = []
    for axis in range(3):
        pose = np.diag([*(1.0 if i == axis else -1.0 for i in range(3)), 1.0])
        cameras.append(replace(base, name=f"{axis}.png", camera_to_world=pose))
    write_colmap_text(tmp_path, cameras)
    for found, wanted in zip(read_colmap_text(tmp_path), cameras, strict=True):
        assert_same(found, wanted)


def test_colmap_file_as_colmap_writes_it(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text(
        "# Camera list with one line of data per camera:\n7 SIMPLE_RADIAL 640 480 500.5 320 240 -0.01\n"
        "9 SIMPLE_PINHOLE 320 240 250 160 120\n"
    )
    (tmp_path / "images.txt").write_text(
        "# Image list with two lines of data per image:\n"
        "1 1 0 0 0 0 0 250 7 left side.jpg\n10.5 20.5 3 40.5 50.5 -1\n"
        "2 0.7071067811865476 0.7071067811865476 0 0 1 2 3 9 right.jpg\n\n"
    )
    left, right = read_colmap_text(tmp_path)
    assert (left.name, left.fl_x, left.fl_y) == ("left side.jpg", 500.5, 500.5)
    np.testing.assert_array_equal(left.distortion, [-0.01, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(left.project([0.0, 0.0, 0.0])[0], (320.0, 240.0))
    assert right.fl_y == 250.0
    # A quarter turn about x takes world y to camera z.
    np.testing.assert_allclose(right.forward, (0.0, 1.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(right.world_to_camera[:3, 3], (1.0, 2.0, 3.0), atol=1e-12)


GOOD_CAMERAS = "1 PINHOLE 640 480 500 500 320 240\n"
GOOD_IMAGES = "1 1 0 0 0 0 0 250 1 a.jpg\n\n"


@pytest.mark.parametrize(
    ("cameras", "images", "message"),
    [
        ("1 FOV 640 480 500 320 240 0\n", GOOD_IMAGES, "MODEL"),
        ("1 PINHOLE 640 480 500 500 320\n", GOOD_IMAGES, "PARAMS"),
        ("1 PINHOLE 640 480 five 500 320 240\n", GOOD_IMAGES, "PARAMS"),
        ("1 FULL_OPENCV 640 480 5 5 3 2 0 0 0 0 0 0.1 0 0\n", GOOD_IMAGES, "k4"),
        ("1 PINHOLE 640 480 0 500 320 240\n", GOOD_IMAGES, "fl_x"),
        (GOOD_CAMERAS, "1 1 0 0 0 0 0 250 1\n\n", "ten values"),
        (GOOD_CAMERAS, "1 1 0 0 0 0 0 far 1 a.jpg\n\n", "pose"),
        (GOOD_CAMERAS, "1 2 0 0 0 0 0 250 1 a.jpg\n\n", "quaternion"),
        (GOOD_CAMERAS, "1 nan 0 0 0 0 0 250 1 a.jpg\n\n", "quaternion"),
        (GOOD_CAMERAS, "1 1 0 0 0 0 0 250 5 a.jpg\n\n", "CAMERA_ID"),
    ],
)
def test_damaged_colmap_files_are_refused_by_line(tmp_path: Path, cameras: str, images: str, message: str) -> None:
    (tmp_path / "cameras.txt").write_text(cameras)
    (tmp_path / "images.txt").write_text(images)
    with pytest.raises(InputError, match=message) as caught:
        read_colmap_text(tmp_path)
    assert ".txt: line 1: " in str(caught.value)


def test_colmap_missing_files_and_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cameras\.txt"):
        read_colmap_text(tmp_path)
    camera = random_camera(0)
    with pytest.raises(InputError, match="NAME"):
        write_colmap_text(tmp_path, [camera, camera])
    with pytest.raises(InputError, match="NAME"):
        write_colmap_text(tmp_path, [replace(camera, name="two\nlines")])
    assert not list(tmp_path.iterdir())
