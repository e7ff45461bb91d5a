"""Exact silhouettes against closed forms and against rays followed one by one in numpy."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rod_cases import camera_at

from frametwin.cameras import Camera
from frametwin.errors import Cancelled, InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress
from frametwin.raster.silhouette import silhouettes


def strut(start: list[float], end: list[float], radius: float, **more: object) -> Wireframe:
    return Wireframe.create([start, end], [[0, 1]], radius=radius, **more)


def centred(camera: Camera) -> Camera:
    return replace(camera, cx=camera.width / 2.0, cy=camera.height / 2.0)


def rays(camera: Camera) -> np.ndarray:
    """(H, W, 3) unit directions through the pixel centres, in the world."""
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fl_x
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fl_y
    local = np.stack([*np.meshgrid(x, y), np.ones((camera.height, camera.width))], axis=-1)
    return local / np.linalg.norm(local, axis=-1, keepdims=True) @ camera.camera_to_world[:3, :3].T


def distance_to_curve(camera: Camera, curve: np.ndarray, samples: int = 1500) -> np.ndarray:
    """(H, W) least distance of every pixel's ray from one curve (4, 3), by trying points along it."""
    toward = rays(camera)
    least = np.full(toward.shape[:2], np.inf)
    for point in bezier.evaluate(curve, np.linspace(0.0, 1.0, samples)) - camera.centre:
        along = toward @ point
        least = np.minimum(least, np.sqrt(np.maximum(point @ point - along**2, 0.0)))
    return least


CAMERAS = {
    "far": camera_at([120.0, 15.0, 40.0], (60, 80), 250.0),
    "oblong pixels": camera_at([20.0, -90.0, 30.0], (70, 50), 160.0, stretch=1.4),
    "near, wide angle": camera_at([9.0, 3.0, 2.0], (60, 90), 30.0),
    "along the strut": camera_at([-60.0, -18.0, -12.0], (60, 60), 180.0),
}


@pytest.mark.parametrize("bend", [0.0, 4.0])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_pixel_is_white_when_its_ray_passes_within_the_radius(name: str, bend: float) -> None:
    camera = CAMERAS[name]
    frame = strut([-10.0, -3.0, -2.0], [6.0, 5.0, 3.0], 1.5)
    curve = frame.control_points.copy()
    curve[0, 1:3, 2] += bend
    frame = frame.replace(control_points=curve)
    picture = silhouettes(frame, [camera])[0]
    distance = distance_to_curve(camera, frame.control_points[0])
    # Chords leave the curve, and the tried points each other, by a few thousandths of a millimetre.
    clear = np.abs(distance - 1.5) > (1e-4 if bend == 0.0 else 6e-3)
    assert picture.dtype == np.uint8
    assert set(np.unique(picture)) == {0, 255}
    assert clear.mean() > 0.97
    np.testing.assert_array_equal(picture[clear] == 255, (distance < 1.5)[clear])


def test_a_rod_across_the_view_is_as_wide_as_its_tangent_rays() -> None:
    camera = centred(camera_at([0.0, -50.0, 0.0], (121, 161), 200.0))
    picture = silhouettes(strut([-9.0, 0.0, 0.0], [9.0, 0.0, 0.0], 3.0), [camera])[0]
    half = 200.0 * 3.0 / np.sqrt(50.0**2 - 3.0**2)  # pixels
    rows = np.abs(np.arange(121) + 0.5 - 60.5) <= half
    columns = np.abs(np.arange(161) + 0.5 - 80.5) <= 200.0 * 9.0 / 50.0 - 1.0
    np.testing.assert_array_equal(picture[:, columns], np.tile(255 * rows[:, None], columns.sum()))


def test_a_rod_seen_end_on_is_the_disc_of_its_nearer_end() -> None:
    camera = centred(camera_at([0.0, -50.0, 0.0], (121, 161), 200.0))
    picture = silhouettes(strut([0.0, 10.0, 0.0], [0.0, -10.0, 0.0], 3.0), [camera])[0]
    y, x = np.mgrid[:121, :161]
    half = 200.0 * 3.0 / np.sqrt(40.0**2 - 3.0**2)
    np.testing.assert_array_equal(picture == 255, np.hypot(x - 80.0, y - 60.0) <= half)


def test_the_outline_has_the_area_of_a_swept_sphere() -> None:
    camera = camera_at([0.0, -3000.0, 0.0], (600, 800), 30000.0)  # 10 pixels a millimetre, nearly parallel rays
    frame = strut([-17.0, 0.0, -8.0], [15.0, 0.0, 9.0], 4.0)
    area = frame.lengths[0] * 8.0 + np.pi * 4.0**2
    assert (silhouettes(frame, [camera])[0] == 255).sum() / 100.0 == pytest.approx(area, rel=2e-3)


def test_only_what_is_present_is_drawn() -> None:
    camera = CAMERAS["far"]
    frame = strut([-10.0, -3.0, -2.0], [6.0, 5.0, 3.0], 1.0)
    interval = np.array([[0.25, 0.625]])
    ends = bezier.evaluate(frame.control_points[0], interval[0])
    part = strut(*ends.tolist(), 1.0)
    found = silhouettes(frame, [camera], present=interval)[0]
    np.testing.assert_array_equal(found, silhouettes(part, [camera])[0])
    assert not silhouettes(frame, [camera], present=np.array([[0.4, 0.4]]))[0].any()


def test_a_part_of_a_curve_is_the_curve_that_was_cut_there() -> None:
    camera = CAMERAS["far"]
    curve = np.array([[[-10.0, -3.0, -2.0], [-6.0, 0.0, 9.0], [2.0, 3.0, -9.0], [6.0, 5.0, 3.0]]])
    frame = strut(curve[0, 0].tolist(), curve[0, 3].tolist(), 1.0, control_points=curve)
    kept = bezier.split(curve, 0.7)[0]
    part = strut(kept[0, 0].tolist(), kept[0, 3].tolist(), 1.0, control_points=kept)
    found = silhouettes(frame, [camera], present=np.array([[0.0, 0.7]]))[0]
    np.testing.assert_array_equal(found, silhouettes(part, [camera])[0])


@pytest.mark.parametrize("bend", [0.0, 4.0])
@pytest.mark.parametrize("name", CAMERAS)
def test_the_radius_may_change_along_the_strut(name: str, bend: float) -> None:
    camera = CAMERAS[name]
    frame = strut([-10.0, -3.0, -2.0], [6.0, 5.0, 3.0], 1.0)
    curve = frame.control_points.copy()
    curve[0, 1:3, 2] += bend
    frame = frame.replace(control_points=curve)
    thickness, interval = np.array([[1.5, 0.6, 2.0, 1.1]]), np.array([[0.15, 0.9]])
    toward, outside = rays(camera), np.full((camera.height, camera.width), np.inf)
    u = np.linspace(*interval[0], 1500)
    radius = np.interp(u, np.linspace(0.0, 1.0, 4), thickness[0])
    for point, r in zip(bezier.evaluate(curve[0], u) - camera.centre, radius, strict=True):
        distance = np.sqrt(np.maximum(point @ point - (toward @ point) ** 2, 0.0))
        outside = np.minimum(outside, distance - r)
    picture = silhouettes(frame, [camera], present=interval, thickness=thickness)[0]
    clear = np.abs(outside) > (1e-4 if bend == 0.0 else 6e-3)
    assert clear.mean() > 0.97
    np.testing.assert_array_equal(picture[clear] == 255, outside[clear] < 0.0)


def test_an_even_thickness_is_the_radius() -> None:
    cameras = list(CAMERAS.values())
    frame = triangle()
    for count in (2, 5):
        thickness = np.repeat(frame.radius[:, None], count, axis=1)
        found = silhouettes(frame.replace(radius=np.full(3, 0.1)), cameras, thickness=thickness)
        for one, other in zip(found, silhouettes(frame, cameras), strict=True):
            np.testing.assert_array_equal(one, other)


def triangle(**changes: object) -> Wireframe:
    vertices = [[-10.0, 0.0, -6.0], [10.0, 2.0, -6.0], [0.0, 0.0, 9.0]]
    return Wireframe.create(vertices, [[0, 1], [1, 2], [2, 0]], radius=[0.6, 1.0, 1.4], **changes)


def test_struts_that_are_not_printed_are_not_drawn() -> None:
    cameras = list(CAMERAS.values())[:2]
    printed = np.array([True, False, True])
    kept, _ = triangle().subset(printed)
    for whole, part in zip(silhouettes(triangle(printed=printed), cameras), silhouettes(kept, cameras), strict=True):
        assert part.any()
        np.testing.assert_array_equal(whole, part)


def test_a_frame_is_the_union_of_its_struts() -> None:
    camera = CAMERAS["far"]
    alone = [silhouettes(triangle().subset(np.arange(3) == k)[0], [camera])[0] for k in range(3)]
    np.testing.assert_array_equal(silhouettes(triangle(), [camera])[0], np.max(alone, axis=0))


def test_how_a_straight_strut_is_parametrised_does_not_show() -> None:
    frame = triangle()
    ends = frame.control_points[:, [0, 3]]
    share = np.array([0.0, 0.55, 0.9, 1.0])[:, None]  # the same lines, passed through at another pace
    uneven = ends[:, :1] * (1.0 - share) + ends[:, 1:] * share
    for camera in CAMERAS.values():
        one, other = (silhouettes(f, [camera])[0] for f in (frame, frame.replace(control_points=uneven)))
        np.testing.assert_array_equal(one, other)


def test_a_curve_drawn_backwards_is_the_same() -> None:
    curve = np.array([[[-10.0, -3.0, -2.0], [-6.0, 0.0, 9.0], [2.0, 3.0, -9.0], [6.0, 5.0, 3.0]]])
    there = strut(curve[0, 0].tolist(), curve[0, 3].tolist(), 1.0, control_points=curve)
    back = strut(curve[0, 3].tolist(), curve[0, 0].tolist(), 1.0, control_points=curve[:, ::-1])
    for one, other in zip(*(silhouettes(f, list(CAMERAS.values())) for f in (there, back)), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("samples", [2, 3])
def test_supersampling_takes_the_mean(samples: int) -> None:
    camera = CAMERAS["oblong pixels"]
    fine = silhouettes(triangle(), [camera.resized(50 * samples, 70 * samples)])[0]
    found = silhouettes(triangle(), [camera], supersampling=samples)[0]
    mean = fine.reshape(70, samples, 50, samples).mean(axis=(1, 3))
    assert found.dtype == np.uint8
    assert len(np.unique(found)) > 3
    assert np.abs(found - mean).max() <= 0.5


def test_nothing_is_seen_behind_a_camera() -> None:
    camera = camera_at([0.0, -50.0, 0.0], (60, 80), 100.0, target=[0.0, -90.0, 0.0])
    assert not silhouettes(triangle(), [camera])[0].any()


def test_lens_distortion_is_refused() -> None:
    camera = replace(CAMERAS["far"], distortion=np.array([0.1, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(InputError, match=r"view: distortion: .*without_distortion"):
        silhouettes(triangle(), [camera])


def test_progress_is_told_of_every_view_and_can_cancel() -> None:
    cameras = list(CAMERAS.values())
    told: list[Progress] = []
    silhouettes(triangle(), cameras, progress=lambda p: told.append(p))
    assert [(p.iteration, p.total) for p in told] == [(i, 4) for i in range(5)]
    with pytest.raises(Cancelled):
        silhouettes(triangle(), cameras, progress=lambda p: p.iteration < 2)


def test_same_bits_with_any_number_of_threads() -> None:
    cameras = list(CAMERAS.values())
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = silhouettes(triangle(), cameras, supersampling=2)
    finally:
        numba.set_num_threads(before)
    for one, other in zip(alone, silhouettes(triangle(), cameras, supersampling=2), strict=True):
        np.testing.assert_array_equal(one, other)
