"""Normals of struts against rays on cylinders, and light told by them against Lambert's law."""

from __future__ import annotations

import numpy as np
import pytest
from photo_cases import WHITE, codes
from small_frames import tower

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.coverage import coverage_about
from frametwin.imaging.neighbourhood import Neighbourhood
from frametwin.imaging.photograph import photograph
from frametwin.imaging.shading import FEWEST, harmonics, shaded_light, shading
from frametwin.raster.normals import surface_normals
from frametwin.raster.silhouette import silhouettes

LAMP = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
GROUND = np.array([0.2, 0.2, 0.21])


def lambert(normals: np.ndarray, ambient: float = 0.08) -> np.ndarray:
    """Share (...) of a lamp's light that a surface shows, and what comes from all around."""
    return ambient + (1.0 - ambient) * np.clip(normals @ LAMP, 0.0, 1.0)


def one_strut() -> Wireframe:
    return Wireframe.create([[2.0, 3.0, 5.0], [18.0, 12.0, 33.0]], [[0, 1]], radius=1.5, name="strut")


def rays_of(camera: Camera, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Directions (N, 3) in the world of the rays through the middles of pixels."""
    ways = np.stack([(columns + 0.5 - camera.cx) / camera.fl_x, (rows + 0.5 - camera.cy) / camera.fl_y], axis=1)
    ways = np.column_stack([ways, np.ones(len(rows))]) @ np.array(camera.camera_to_world)[:3, :3].T
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def test_normals_are_those_where_rays_meet_the_cylinder() -> None:
    frame = one_strut()
    for camera in ring_rig(tower(), 3, size=(150, 200)):
        normals = surface_normals(frame, camera)
        rows, columns = np.nonzero((normals != 0.0).any(axis=-1))
        assert len(rows) > 500
        ray = rays_of(camera, rows, columns)
        start, end = frame.vertices
        along = (end - start) / np.linalg.norm(end - start)
        origin = camera.centre - start
        flat, apart = ray - np.outer(ray @ along, along), origin - (origin @ along) * along
        a, b, c = (flat**2).sum(axis=1), flat @ apart, apart @ apart - 1.5**2
        hit = b * b - a * c > 0.02 * a  # well within the rim
        way = (-b[hit] - np.sqrt(b[hit] ** 2 - a[hit] * c)) / a[hit]
        place = (origin + way[:, None] * ray[hit]) @ along
        expected = (apart + way[:, None] * flat[hit]) / 1.5
        between = (place > 0.5) & (place < np.linalg.norm(end - start) - 0.5)
        cosine = (expected * normals[rows[hit], columns[hit]]).sum(axis=1)[between]
        assert between.sum() > 400 and cosine.min() > 0.98 and cosine.mean() > 0.999


def test_the_nearer_of_two_struts_is_seen_and_rims_go_on_outside() -> None:
    frame = tower()
    camera = ring_rig(frame, 1, size=(150, 200))[0]
    normals, wider = surface_normals(frame, camera), surface_normals(frame, camera, 3.0)
    covered = (normals != 0.0).any(axis=-1)
    np.testing.assert_allclose(np.linalg.norm(normals[covered], axis=-1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(wider[covered], normals[covered])
    (drawn,) = silhouettes(frame, [camera])
    assert (covered == (drawn > 0)).mean() > 0.985
    assert (wider != 0.0).any(axis=-1).sum() > 1.2 * covered.sum()
    rows, columns = np.nonzero(covered)
    assert (normals[covered] * rays_of(camera, rows, columns)).sum(axis=1).max() < 0.1  # all face the camera


def test_light_of_second_order_is_found_exactly() -> None:
    draw = np.random.default_rng(2)
    normals = draw.normal(size=(3000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    wanted = draw.uniform(-0.2, 0.2, (9, 3)) + 3.0 * np.eye(9)[:, :1]
    found = shading(harmonics(normals) @ wanted, harmonics(normals), np.ones(3000))
    np.testing.assert_allclose(harmonics(normals) @ found, harmonics(normals) @ wanted, rtol=0.01)


def test_too_few_pixels_of_print_leave_its_light_even() -> None:
    light = np.full((40, 40, 3), 0.3, dtype=np.float32)
    normals = np.zeros((40, 40, 3), dtype=np.float32)
    normals[5:15, 5:15, 2] = 1.0
    seeds = (normals[..., 2] > 0.0).astype(np.float32)
    assert seeds.sum() < FEWEST
    np.testing.assert_allclose(shaded_light(light, normals, seeds, ((1.0, 5.0), (2.0, 6.0))), 0.3, atol=1e-5)


@pytest.mark.parametrize("off", [0.0, 0.15])
def test_a_dark_side_through_the_backgrounds_own_brightness_stays_print(off: float) -> None:
    """A white strut before grey is brighter than it on one side and darker on the other, and as bright between."""
    frame = tower()
    up = np.array([0.0, 0.0, off])
    twin = frame.replace(vertices=frame.vertices + up, control_points=frame.control_points + up)
    missed, missed_before = [], []
    for i, camera in enumerate(ring_rig(frame, 3, size=(180, 240))):
        normals = surface_normals(frame, camera, 2.0)
        (share, about) = (silhouettes(f, [camera], supersampling=4)[0][..., None] / 255.0 for f in (frame, twin))
        light = share * lambert(normals)[..., None] * np.array(WHITE) + (1.0 - share) * GROUND
        image, before = codes(light, seed=i), codes(np.zeros_like(light) + GROUND, seed=50 + i)
        where = Neighbourhood.of(frame, camera)
        photo = photograph(image, before, where)
        drawn = about[..., 0].astype(np.float32)
        margin = 0.6 * where.pixels_per_mm
        for turned, told in ((surface_normals(twin, camera, 6.0), missed), (None, missed_before)):
            found = coverage_about(photo, drawn, margin, normals=turned).share
            told.append(float(np.abs(found - share[..., 0]).sum() / share.sum()))
    assert np.mean(missed) < 0.8 * np.mean(missed_before)
    assert np.mean(missed) < 0.06 + 0.1 * off
