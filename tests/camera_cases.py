"""Random cameras for tests, points before them, and when two cameras are the same."""

from __future__ import annotations

import numpy as np

from frametwin.cameras import Camera, look_at

LENS = np.array([-0.21, 0.08, 0.0011, -0.0007, -0.013])
CASES = range(8)


def random_camera(seed: int, *, distorted: bool = True) -> Camera:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    width, height = int(rng.integers(300, 4000)), int(rng.integers(300, 4000))
    return Camera(
        name=f"view {seed}.png",
        width=width,
        height=height,
        fl_x=rng.uniform(0.8, 2.0) * width,
        fl_y=rng.uniform(0.8, 2.0) * width,
        cx=width * rng.uniform(0.4, 0.6),
        cy=height * rng.uniform(0.4, 0.6),
        camera_to_world=look_at(400.0 * direction, rng.normal(scale=20.0, size=3), rng.normal(size=3)),
        distortion=LENS * rng.uniform(0.2, 1.0, size=5) if distorted else np.zeros(5),
    )


def points_ahead(camera: Camera, count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(99)
    pixels = rng.uniform(size=(count, 2)) * (camera.width, camera.height)
    return camera.without_distortion().unproject(pixels, rng.uniform(50.0, 900.0, size=count))


def assert_same(found: Camera, wanted: Camera) -> None:
    assert (found.name, found.width, found.height) == (wanted.name, wanted.width, wanted.height)
    for key in ("fl_x", "fl_y", "cx", "cy"):
        np.testing.assert_allclose(getattr(found, key), getattr(wanted, key), rtol=1e-12, atol=0)
    np.testing.assert_allclose(found.distortion, wanted.distortion, rtol=1e-12, atol=0)
    scale = np.abs(wanted.centre).max()
    np.testing.assert_allclose(found.centre, wanted.centre, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(found.camera_to_world[:3, :3], wanted.camera_to_world[:3, :3], rtol=0, atol=1e-12)
