"""Cameras against OpenCV, and conversions there and back."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from camera_cases import CASES, assert_same, points_ahead, random_camera

from frametwin.cameras import (
    BlenderCamera,
    Camera,
    from_blender,
    from_nerfstudio,
    look_at,
    packed,
    to_blender,
    to_nerfstudio,
)
from frametwin.errors import InputError


@pytest.mark.parametrize("seed", CASES)
@pytest.mark.parametrize("distorted", [True, False])
def test_projection_is_opencvs(seed: int, distorted: bool) -> None:
    cv2 = pytest.importorskip("cv2")
    camera = random_camera(seed, distorted=distorted)
    points = points_ahead(camera)
    rotation, _ = cv2.Rodrigues(camera.world_to_camera[:3, :3].copy())
    # OpenCV counts pixel centres as whole numbers: half a pixel less, in the intrinsics and in the result.
    wanted, _ = cv2.projectPoints(
        points, rotation, camera.world_to_camera[:3, 3].copy(), camera.K_opencv, camera.distortion
    )
    pixels, depth = camera.project(points)
    np.testing.assert_allclose(pixels, wanted[:, 0] + 0.5, rtol=0, atol=1e-8)
    np.testing.assert_allclose(depth, (points - camera.centre) @ camera.forward, rtol=1e-12)


def test_undistorting_a_picture_with_opencv_moves_it_to_the_camera_without_distortion() -> None:
    cv2 = pytest.importorskip("cv2")
    camera = replace(random_camera(3), width=160, height=120, fl_x=150.0, fl_y=155.0, cx=82.0, cy=57.0)
    plain = camera.without_distortion()
    rows, columns = np.mgrid[0:120, 0:160]
    # A picture whose grey value at each pixel centre is a smooth function of the ray through it.
    rays = camera.unproject(np.stack([columns + 0.5, rows + 0.5], axis=-1), 300.0)
    picture = np.sin(rays @ np.array([0.02, 0.03, -0.01])).astype(np.float32)
    straightened = cv2.undistort(picture, camera.K_opencv, camera.distortion, None, plain.K_opencv)
    wanted = np.sin(
        plain.unproject(np.stack([columns + 0.5, rows + 0.5], axis=-1), 300.0) @ np.array([0.02, 0.03, -0.01])
    )
    inner = np.s_[20:-20, 20:-20]
    assert np.abs(straightened - wanted)[inner].max() < 2e-3


@pytest.mark.parametrize("seed", CASES)
def test_unproject_is_the_inverse_of_project(seed: int) -> None:
    camera = random_camera(seed)
    points = points_ahead(camera)
    pixels, depth = camera.project(points)
    np.testing.assert_allclose(camera.unproject(pixels, depth), points, rtol=0, atol=1e-9)
    assert camera.unproject(pixels.reshape(10, 20, 2), 5.0).shape == (10, 20, 3)


def test_unproject_of_what_the_lens_cannot_show_is_nan() -> None:
    barrel = replace(random_camera(0), distortion=np.array([-0.4, 0.0, 0.0, 0.0, 0.0]))
    far = barrel.unproject([[20.0 * barrel.width, 0.0], [barrel.cx, barrel.cy]], 100.0)
    assert np.isnan(far[0]).all()
    np.testing.assert_allclose(far[1], barrel.centre + 100.0 * barrel.forward, atol=1e-10)


def test_points_behind_the_camera_have_no_pixel() -> None:
    camera = random_camera(1)
    pixels, depth = camera.project(camera.centre - 10.0 * camera.forward)
    assert np.isnan(pixels).all()
    np.testing.assert_allclose(depth, -10.0)


def test_the_middle_of_the_first_pixel_is_a_half() -> None:
    camera = Camera("c", 4, 2, 10.0, 10.0, 2.0, 1.0, np.eye(4))
    pixels, _ = camera.project([[-0.15, -0.05, 1.0], [0.0, 0.0, 7.0]])
    np.testing.assert_allclose(pixels, [[0.5, 0.5], [2.0, 1.0]], atol=1e-15)


def test_resized_scales_the_picture_about_its_corner() -> None:
    camera = random_camera(2)
    points = points_ahead(camera)
    half = camera.resized(camera.width * 2, camera.height * 3)
    np.testing.assert_allclose(half.project(points)[0], camera.project(points)[0] * (2.0, 3.0), rtol=1e-12)


def test_packed_rows_project_like_the_camera() -> None:
    cameras = [random_camera(seed) for seed in CASES]
    rows = packed(cameras)
    assert rows.shape == (len(cameras), 16)
    for row, camera in zip(rows, cameras, strict=True):
        points = points_ahead(camera)
        local = points @ row[:9].reshape(3, 3).T + row[9:12]
        pixels = local[:, :2] / local[:, 2:] * row[12:14] + row[14:16]
        np.testing.assert_allclose(pixels, camera.project(points, distort=False)[0], rtol=1e-12)
    assert packed([]).shape == (0, 16)


def test_look_at_puts_the_target_in_the_middle_with_up_upwards() -> None:
    pose = look_at([300.0, -200.0, 150.0], [10.0, 20.0, 30.0])
    camera = Camera("c", 200, 100, 150.0, 150.0, 100.0, 50.0, pose)
    target, above = camera.project([[10.0, 20.0, 30.0], [10.0, 20.0, 40.0]])[0]
    np.testing.assert_allclose(target, (100.0, 50.0), atol=1e-10)
    assert above[1] < target[1] and abs(above[0] - target[0]) < 1e-10
    for direction in ([0.0, 0.0, 5.0], [0.0, 0.0, -5.0]):
        straight = look_at(direction, [0.0, 0.0, 0.0])
        np.testing.assert_allclose(straight[:3, :3] @ straight[:3, :3].T, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(np.linalg.det(straight), 1.0)
    with pytest.raises(ValueError, match="own centre"):
        look_at([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])


@pytest.mark.parametrize("seed", CASES)
def test_nerfstudio_and_back(seed: int) -> None:
    camera = random_camera(seed, distorted=seed % 2 == 0)
    frame = to_nerfstudio(camera, "images/a.png")
    assert frame["file_path"] == "images/a.png"
    assert ("k1" in frame) == camera.has_distortion
    assert_same(from_nerfstudio(frame, name=camera.name), camera)


def test_nerfstudio_axes_are_opengls() -> None:
    camera = random_camera(0)
    pose = np.array(to_nerfstudio(camera, "a.png")["transform_matrix"])
    np.testing.assert_allclose(-pose[:3, 2], camera.forward)
    np.testing.assert_allclose(-pose[:3, 1], camera.camera_to_world[:3, 1])
    np.testing.assert_allclose(pose[:3, 0], camera.camera_to_world[:3, 0])


def test_nerfstudio_intrinsics_may_be_shared_and_overridden() -> None:
    frame = to_nerfstudio(random_camera(4), "a.png")
    shared = {key: frame.pop(key) for key in ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2", "k3")}
    assert_same(from_nerfstudio(frame, shared=shared, name="view 4.png"), random_camera(4))
    assert from_nerfstudio({**frame, "fl_x": 77.0}, shared=shared).fl_x == 77.0


@pytest.mark.parametrize("seed", CASES)
def test_blender_and_back(seed: int) -> None:
    camera = random_camera(seed, distorted=False)
    blender = to_blender(camera, sensor_width=23.5)
    assert_same(from_blender(blender, camera.name), camera)
    for key in ("lens", "shift_x", "shift_y", "resolution_x", "resolution_y", "sensor_width"):
        again = getattr(to_blender(from_blender(blender, "c"), sensor_width=23.5), key)
        np.testing.assert_allclose(again, getattr(blender, key), rtol=1e-12, atol=1e-12)


def blender_camera(**changes) -> BlenderCamera:
    return replace(BlenderCamera(np.eye(4), 50.0, 36.0, 24.0, "AUTO", 0.0, 0.0, 1600, 1200), **changes)


def test_blender_angles_of_view_are_those_of_its_manual() -> None:
    # The angle of view along the fitted side is 2 atan(sensor / (2 lens)).
    wide = from_blender(blender_camera(), "c")
    np.testing.assert_allclose(2 * np.arctan(800 / wide.fl_x), 2 * np.arctan(18 / 50))
    tall = from_blender(blender_camera(resolution_x=1200, resolution_y=1600), "c")
    np.testing.assert_allclose(2 * np.arctan(800 / tall.fl_y), 2 * np.arctan(18 / 50))
    vertical = from_blender(blender_camera(sensor_fit="VERTICAL"), "c")
    np.testing.assert_allclose(2 * np.arctan(600 / vertical.fl_y), 2 * np.arctan(12 / 50))
    # A shift of +0.5 moves the view by half of the fitted side, to the right and upwards.
    shifted = from_blender(blender_camera(shift_x=0.5, shift_y=0.25), "c")
    np.testing.assert_allclose((shifted.cx, shifted.cy), (0.0, 600.0 + 400.0))


def test_blender_square_pixels_stay_square() -> None:
    camera = replace(random_camera(5, distorted=False), fl_x=1234.5, fl_y=1234.5)
    blender = to_blender(camera)
    assert (blender.pixel_aspect_x, blender.pixel_aspect_y) == (1.0, 1.0)
    oblong = to_blender(replace(camera, fl_y=1300.0))
    assert min(oblong.pixel_aspect_x, oblong.pixel_aspect_y) == 1.0


def test_blender_refuses_what_it_cannot_show() -> None:
    with pytest.raises(InputError, match=r"distortion.*without_distortion"):
        to_blender(random_camera(0))
    with pytest.raises(InputError, match=r"sensor_fit.*'WIDE'"):
        from_blender(blender_camera(sensor_fit="WIDE"), "c")


SHEARED = np.eye(4) + 0.1 * np.eye(4, k=1)
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"width": 0}, "width"),
        ({"height": 1.5}, "height"),
        ({"width": 10**9}, "width"),
        ({"height": True}, "height"),
        ({"fl_x": 0.0}, "fl_x"),
        ({"fl_y": -5.0}, "fl_y"),
        ({"fl_x": float("nan")}, "fl_x"),
        ({"cx": float("inf")}, "cx"),
        ({"cy": "middle"}, "cy"),
        ({"camera_to_world": np.eye(3)}, "camera_to_world"),
        ({"camera_to_world": np.full((4, 4), np.nan)}, "camera_to_world"),
        ({"camera_to_world": 2.0 * np.eye(4)}, "camera_to_world"),
        ({"camera_to_world": np.diag([2.0, 2.0, 2.0, 1.0])}, "camera_to_world"),
        ({"camera_to_world": SHEARED}, "camera_to_world"),
        ({"camera_to_world": MIRRORED}, "camera_to_world"),
        ({"distortion": np.zeros(4)}, "distortion"),
        ({"distortion": [0.0, 0.0, 0.0, 0.0, float("nan")]}, "distortion"),
    ],
)
def test_impossible_cameras_are_refused(changes: dict, field: str) -> None:
    with pytest.raises(InputError, match=field) as caught:
        replace(random_camera(0), **changes)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("camera view 0.png: ")


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"fl_x": None}, "fl_x"),
        ({"w": "wide"}, "w"),
        ({"transform_matrix": [[1, 0, 0, 0]]}, "transform_matrix"),
        ({"transform_matrix": None}, "transform_matrix"),
        ({"camera_model": "EQUIRECTANGULAR"}, "camera_model"),
        ({"k4": 0.1}, "k4"),
        ({"k1": "much"}, "k1"),
    ],
)
def test_damaged_nerfstudio_frames_are_refused(changes: dict, field: str) -> None:
    frame = {**to_nerfstudio(random_camera(0), "a.png"), **changes}
    with pytest.raises(InputError, match=f"^t.json frames.2.: {field}: "):
        from_nerfstudio(frame, source="t.json frames[2]")


def test_cameras_cannot_be_changed_behind_their_back() -> None:
    pose = look_at([100.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    camera = Camera("c", 4, 2, 10.0, 10.0, 2.0, 1.0, pose)
    pose[0, 3] = 5.0
    assert camera.centre[0] == 100.0
    for array in (camera.camera_to_world, camera.world_to_camera, camera.distortion):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_an_angle_of_view_tells_the_focal_length() -> None:
    pose = {"transform_matrix": np.eye(4).tolist(), "file_path": "r_0"}
    camera = from_nerfstudio(pose, shared={"camera_angle_x": np.pi / 2}, size=(800, 600))
    np.testing.assert_allclose((camera.fl_x, camera.fl_y, camera.cx, camera.cy), (400.0, 400.0, 400.0, 300.0))
    own = from_nerfstudio({**pose, "fl_x": 9.0, "fl_y": 9.0, "cx": 4, "cy": 3, "w": 8.0, "h": 6.0}, shared=pose)
    assert (own.fl_x, own.width) == (9.0, 8)


def test_a_list_of_coefficients_and_a_fisheye() -> None:
    frame = to_nerfstudio(random_camera(4, distorted=False), "a.png")
    listed = from_nerfstudio({**frame, "distortion_params": [0.1, 0.2, 0.3, 0.0, 0.01, 0.02]})
    np.testing.assert_array_equal(listed.distortion, [0.1, 0.2, 0.01, 0.02, 0.3])
    wide = from_nerfstudio({**frame, "camera_model": "OPENCV_FISHEYE", "k1": 0.02, "k4": 0.001})
    local = np.array([[0.4, -0.3, 1.0], [0.9, 0.2, 1.0]])
    world = local @ wide.camera_to_world[:3, :3].T + wide.centre
    wanted = cv2.fisheye.projectPoints(local[:, None], np.zeros(3), np.zeros(3), wide.K, wide.distortion)[0][:, 0]
    pixels, depth = wide.project(world)
    np.testing.assert_allclose(pixels, wanted, atol=1e-6)
    np.testing.assert_allclose(wide.unproject(pixels, depth), world, atol=1e-6)
    assert_same(from_nerfstudio(to_nerfstudio(wide, "a.png")), wide)
