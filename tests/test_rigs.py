"""Rigs: every camera sees the whole box, with the margin asked for and no more."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from frametwin.cameras.rigs import box_around, dome_rig, ring_rig
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

BOXES = {
    "cube": [[-50.0, -50.0, 0.0], [50.0, 50.0, 100.0]],
    "long": [[0.0, 0.0, 0.0], [200.0, 40.0, 35.0]],
    "tower": [[-30.0, 10.0, 5.0], [30.0, 70.0, 250.0]],
    "flat": [[0.0, 0.0, 0.0], [80.0, 60.0, 0.0]],
}
SIZES = [(1200, 1600), (1600, 1200), (100, 1000)]


def free_share(cameras, bounds) -> float:
    """The least distance of a corner of the box from the picture's edge, as a share of the picture."""
    corners = np.array(list(product(*np.transpose(bounds))))
    shares = []
    for camera in cameras:
        pixels, depth = camera.project(corners)
        assert (depth > 0.0).all()
        place = pixels / (camera.width, camera.height)
        shares.append(min(place.min(), 1.0 - place.max()))
    return min(shares)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("rig", [ring_rig, dome_rig])
def test_the_box_fills_the_picture_up_to_the_margin(rig, box: str, size: tuple[int, int]) -> None:
    cameras = rig(BOXES[box], 8, size=size, margin=0.1)
    assert len(cameras) == 8 and len({camera.name for camera in cameras}) == 8
    np.testing.assert_allclose(free_share(cameras, BOXES[box]), 0.1, atol=1e-12)


@pytest.mark.parametrize("rig", [ring_rig, dome_rig])
@pytest.mark.parametrize("box", BOXES)
def test_every_camera_fills_its_picture_between_two_opposite_sides(rig, box: str) -> None:
    corners = np.array(list(product(*np.transpose(BOXES[box]))))
    for camera in rig(BOXES[box], 7, margin=0.05):
        pixels, _ = camera.project(corners)
        low, high = pixels.min(axis=0) / (1600, 1200), 1.0 - pixels.max(axis=0) / (1600, 1200)
        tight = int(low[1] < low[0])
        np.testing.assert_allclose([low[tight], high[tight]], 0.05, atol=1e-9)
        assert min(low[1 - tight], high[1 - tight]) > 0.05 - 1e-9
        middle = np.mean(BOXES[box], axis=0)
        above = camera.project(middle + np.array([0.0, 0.0, 1.0]))[0] - camera.project(middle)[0]
        assert above[1] < 0.0  # upright


def angles(cameras) -> tuple[np.ndarray, np.ndarray]:
    outward = -np.array([camera.forward for camera in cameras])
    azimuth = np.round(np.degrees(np.arctan2(outward[:, 1], outward[:, 0])), 9) % 360.0
    return azimuth, np.degrees(np.arcsin(outward[:, 2]))


def test_ring_angles_are_those_asked_for() -> None:
    azimuth, elevation = angles(ring_rig(BOXES["cube"], 8))
    np.testing.assert_allclose(azimuth, np.arange(8) * 45.0, atol=1e-9)
    np.testing.assert_allclose(elevation, [20.0, 45.0] * 4, atol=1e-9)
    azimuth, elevation = angles(ring_rig(BOXES["cube"], 5, elevation_deg=30.0, start_deg=10.0))
    np.testing.assert_allclose(azimuth, 10.0 + np.arange(5) * 72.0, atol=1e-9)
    np.testing.assert_allclose(elevation, 30.0, atol=1e-9)
    _, elevation = angles(ring_rig(BOXES["cube"], 5, elevation_deg=[0.0, 10.0, 90.0]))
    np.testing.assert_allclose(elevation, [0.0, 10.0, 90.0, 0.0, 10.0], atol=1e-6)


def test_dome_cameras_stay_in_the_band_and_apart() -> None:
    cameras = dome_rig(BOXES["cube"], 40, elevation_deg=(15.0, 60.0))
    _, elevation = angles(cameras)
    assert elevation.min() > 15.0 and elevation.max() < 60.0
    outward = -np.array([camera.forward for camera in cameras])
    nearest = np.degrees(np.arccos(np.sort(outward @ outward.T, axis=1)[:, -2]))
    # Each camera's share of the band has the area pi r^2 of a cap; neighbours are then about 2 r apart.
    area = 2.0 * np.pi * (np.sin(np.radians(60.0)) - np.sin(np.radians(15.0))) / 40
    assert nearest.min() > np.degrees(np.sqrt(area / np.pi))


def test_the_field_of_view_is_vertical() -> None:
    camera = ring_rig(BOXES["cube"], 1, size=(300, 700), fov_deg=50.0)[0]
    top = camera.unproject([350.0, 0.0], 1.0) - camera.centre
    angle = np.degrees(np.arccos(top @ camera.forward / np.linalg.norm(top)))
    np.testing.assert_allclose(angle, 25.0)


def test_a_frame_is_taken_with_the_thickness_of_its_struts() -> None:
    frame = Wireframe.create([[0, 0, 0], [40, 0, 0], [0, 40, 50]], [[0, 1], [1, 2], [2, 0]], radius=[1.0, 4.0, 2.0])
    ends = frame.vertices[frame.edges]
    for camera in ring_rig(frame, 5, margin=0.1):
        nearest = []
        for side, limit in ((0, 1600), (1, 1200)):
            for sign in (-1.0, 1.0):
                # The cone that keeps the margin touches the thickest strut's sphere with its own normal.
                edge = camera.unproject(np.where(np.arange(2) == side, (0.5 + 0.4 * sign) * limit, (800, 600)), 1.0)
                ray = edge - camera.centre
                across = camera.camera_to_world[:3, 1 - side]
                normal = np.cross(ray, across)
                normal *= np.sign(normal @ (edge - camera.centre - camera.forward)) / np.linalg.norm(normal)
                inside = -(ends - camera.centre) @ normal - frame.radius[:, None]
                nearest.append(inside.min())
                assert inside.min() > -1e-9
        assert min(nearest) < 4.0  # no farther than the largest radius, which is allowed for everywhere


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"count": 0}, "count"),
        ({"size": (0, 100)}, "size"),
        ({"elevation_deg": [20.0, 95.0]}, "elevation_deg"),
        ({"elevation_deg": [float("nan"), 20.0]}, "elevation_deg"),
        ({"elevation_deg": []}, "elevation_deg"),
        ({"fov_deg": 180.0}, "fov_deg"),
        ({"margin": 0.5}, "margin"),
        ({"margin": -0.1}, "margin"),
        ({"target": [[0, 0, 0], [1, 1, -1]]}, "bounds"),
        ({"target": [[0, 0, 0], [0, 0, 0]]}, "bounds"),
        ({"target": [[0, 0, float("nan")], [0, 0, 1]]}, "bounds"),
    ],
)
@pytest.mark.parametrize("rig", [ring_rig, dome_rig])
def test_settings_out_of_range_are_refused(rig, changes: dict, field: str) -> None:
    settings = {"target": BOXES["cube"], "count": 8, **changes}
    with pytest.raises(InputError, match=f"^rig: {field}: "):
        rig(settings.pop("target"), settings.pop("count"), **settings)


def test_a_dome_needs_two_angles_in_order() -> None:
    with pytest.raises(InputError, match="elevation_deg"):
        dome_rig(BOXES["cube"], 8, elevation_deg=(60.0, 20.0))


def test_the_box_around_frames_holds_every_strut_with_its_radius() -> None:
    low = Wireframe.create([[0.0, 0.0, 0.0], [10.0, 0.0, 20.0]], [[0, 1]], radius=1.0)
    high = Wireframe.create([[0.0, 5.0, 0.0], [8.0, 5.0, 25.0]], [[0, 1]], radius=2.0)
    assert box_around(low).tolist() == [[-1.0, -1.0, -1.0], [11.0, 1.0, 21.0]]
    assert box_around(low, high).tolist() == [[-2.0, -1.0, -2.0], [11.0, 7.0, 27.0]]
