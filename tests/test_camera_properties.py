"""Cameras of any kind: what is drawn comes back, and so does what goes through the files of other programs."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from camera_cases import assert_same
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from strategies import cameras, numbers, parameters, rigid_motions

from frametwin.cameras import (
    Camera,
    from_blender,
    from_nerfstudio,
    read_colmap_text,
    to_blender,
    to_nerfstudio,
    write_colmap_text,
)
from frametwin.cameras.conversions import SENSOR_FITS, BlenderCamera
from frametwin.files import dump_json, parse_json


def places() -> st.SearchStrategy[np.ndarray]:
    """Places in a picture (5, 2), as shares of its sides."""
    return arrays.arrays(np.float64, (5, 2), elements=parameters())


def depths() -> st.SearchStrategy[np.ndarray]:
    """Depths (5,) in mm."""
    return arrays.arrays(np.float64, 5, elements=numbers(1.0, 5000.0))


@given(cameras(), places(), depths())
def test_the_pixel_of_an_unprojected_pixel_is_itself(camera: Camera, place: np.ndarray, depth: np.ndarray) -> None:
    pixels = place * (camera.width, camera.height)
    found, away = camera.project(camera.unproject(pixels, depth))
    np.testing.assert_allclose(found, pixels, rtol=0, atol=1e-6)
    np.testing.assert_allclose(away, depth, rtol=1e-9, atol=1e-9)


@given(cameras(distorted=False), places(), depths(), st.sampled_from([1e-3, 0.5, 2.0, 1e3]))
def test_all_points_of_a_ray_have_one_pixel(
    camera: Camera, place: np.ndarray, depth: np.ndarray, further: float
) -> None:
    pixels = place * (camera.width, camera.height)
    points = camera.unproject(pixels, depth)
    along = camera.centre + further * (points - camera.centre)
    np.testing.assert_allclose(camera.project(along)[0], pixels, rtol=0, atol=1e-5)


@given(cameras(), rigid_motions(), places(), depths())
def test_a_camera_that_moves_with_what_it_sees_sees_the_same(
    camera: Camera, motion: np.ndarray, place: np.ndarray, depth: np.ndarray
) -> None:
    pixels = place * (camera.width, camera.height)
    points = camera.unproject(pixels, depth) @ motion[:3, :3].T + motion[:3, 3]
    moved = replace(camera, camera_to_world=motion @ camera.camera_to_world)
    np.testing.assert_allclose(moved.project(points)[0], pixels, rtol=0, atol=1e-6)


@given(cameras(), st.integers(1, 6000), st.integers(1, 6000), places(), depths())
def test_a_resized_picture_shows_everything_at_the_same_share_of_its_sides(
    camera: Camera, width: int, height: int, place: np.ndarray, depth: np.ndarray
) -> None:
    points = camera.unproject(place * (camera.width, camera.height), depth)
    found = camera.resized(width, height).project(points)[0] / (width, height)
    np.testing.assert_allclose(found, place, rtol=0, atol=1e-8)


@given(cameras())
def test_through_nerfstudios_file_and_back(camera: Camera) -> None:
    entry = parse_json(dump_json(to_nerfstudio(camera, "images/a.png")), "transforms.json")
    found = from_nerfstudio(entry, name=camera.name)
    assert_same(found, camera)
    np.testing.assert_array_equal(found.camera_to_world, camera.camera_to_world)  # only signs change


@given(cameras(distorted=False), numbers(1.0, 100.0))
def test_through_blender_and_back(camera: Camera, sensor: float) -> None:
    assert_same(from_blender(to_blender(camera, sensor_width=sensor), camera.name), camera)


@given(st.sampled_from(SENSOR_FITS), st.integers(80, 120), st.integers(80, 120), numbers(1.0, 2.0), st.booleans())
def test_the_fitted_side_of_the_sensor_is_the_fitted_side_of_the_picture(
    fit: str, width: int, height: int, oblong: float, tall: bool
) -> None:
    aspect = (1.0, oblong) if tall else (oblong, 1.0)
    camera = from_blender(
        BlenderCamera(np.eye(4), 35.0, 36.0, 24.0, fit, 0.0, 0.0, width, height, *aspect), "c"
    )  # fmt: skip
    tangents = {"x": width / camera.fl_x, "y": height / camera.fl_y}  # of the whole picture, at depth 1
    shape = width * aspect[0], height * aspect[1]
    side = {"HORIZONTAL": "x", "VERTICAL": "y", "AUTO": "x" if shape[0] >= shape[1] else "y"}[fit]
    np.testing.assert_allclose(tangents[side], (24.0 if fit == "VERTICAL" else 36.0) / 35.0, rtol=1e-12)
    np.testing.assert_allclose(tangents["x"] / tangents["y"], shape[0] / shape[1], rtol=1e-12)


@given(st.lists(cameras(), min_size=1, max_size=4, unique_by=lambda camera: camera.name))
def test_through_colmaps_text_files_and_back(wanted: list[Camera]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write_colmap_text(Path(folder) / "model", wanted)
        found = read_colmap_text(Path(folder) / "model")
    assert len(found) == len(wanted)
    for one, other in zip(found, wanted, strict=True):
        assert_same(one, other)
