"""Pictures of lenses that distort: places by the lens's own formula, round trips, and lenses that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from frametwin.cameras import Camera, look_at
from frametwin.cameras.camera import FISHEYE
from frametwin.cameras.lens_warp import lens_warp
from frametwin.errors import InputError

BARREL = Camera(
    "barrel", 203, 151, 180.0, 178.0, 99.0, 77.0, look_at([300.0, 40.0, 120.0], [0.0, 0.0, 50.0]),
    np.array([-0.25, 0.08, 0.001, -0.0005, 0.0]),
)  # fmt: skip
PINCUSHION = replace(BARREL, name="pincushion", distortion=np.array([0.2, 0.01, 0.0, 0.001, 0.0]))
FISH = replace(BARREL, name="fish", distortion=np.array([0.03, -0.01, 0.002, 0.0]), model=FISHEYE)
LENSES = (BARREL, PINCUSHION, FISH)
STRIP = {"height": 6, "cy": 3.0, "cx": 1.0}
"""Seen from its end; a lens is inverted at so many places a focal length, which are many in a picture that wide."""


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.name)
@pytest.mark.parametrize("finer", [1.0, 2.0])
def test_each_pixel_sees_the_same_ray_in_both_pictures(camera: Camera, finer: float) -> None:
    warp = lens_warp(camera, finer)
    places = np.stack([warp.columns, warp.rows], axis=-1).astype(float)
    seen = warp.pinhole.unproject(places, np.full(places.shape[:2], 300.0))
    pixels, _ = camera.project(seen)
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], axis=-1), atol=0.005)
    assert places[..., 0].min() > 1.0 and places[..., 0].max() < warp.pinhole.width - 1.0
    assert places[..., 1].min() > 1.0 and places[..., 1].max() < warp.pinhole.height - 1.0


def test_a_camera_without_distortion_gets_its_own_picture_back() -> None:
    camera = BARREL.without_distortion()
    warp = lens_warp(camera)
    picture = np.random.default_rng(0).random((warp.pinhole.height, warp.pinhole.width, 3))
    top, left = round(warp.pinhole.cy - camera.cy), round(warp.pinhole.cx - camera.cx)
    part = picture[top : top + camera.height, left : left + camera.width]
    np.testing.assert_allclose(warp.linear(picture), part, atol=1e-3)
    np.testing.assert_array_equal(warp.nearest(picture), part)


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.name)
def test_a_ramp_keeps_its_values(camera: Camera) -> None:
    warp = lens_warp(camera)
    x, y = np.meshgrid(np.arange(warp.pinhole.width) + 0.5, np.arange(warp.pinhole.height) + 0.5)
    found = warp.linear(np.stack([x, y], axis=-1))
    np.testing.assert_allclose(found, np.stack([warp.columns, warp.rows], axis=-1), atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"distortion": np.array([-2.0, 0.0, 0.0, 0.0, 0.0])}, "distortion: has no inverse"),
        ({**STRIP, "fl_x": 50.0, "distortion": np.zeros(5)}, "fl_x: sees more than 75 degrees"),
    ],
)
def test_lenses_that_no_flat_picture_holds_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        lens_warp(replace(BARREL, **changes))
