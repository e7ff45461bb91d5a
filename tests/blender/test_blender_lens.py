"""Lenses that distort, rendered by Blender: masks, passes and photos show what the rays of the lens meet."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from rod_rays import cameras, faulty, margin

from frametwin.blender.rendering.render import render_scene
from frametwin.cameras import Camera
from frametwin.cameras.camera import FISHEYE
from frametwin.capture.image_files import decode_png
from frametwin.capture.scene import PhotoLook, Scene
from frametwin.geometry import bezier

EDGE = 0.5
"""Pixels about an outline within which a mask may be either: its pixels come from a picture twice as fine."""


def distorted() -> tuple[Camera, Camera]:
    left, right = cameras()
    return (
        replace(left, distortion=np.array([-0.3, 0.1, 0.002, -0.001, 0.0])),
        replace(right, distortion=np.array([0.08, -0.02, 0.0, 0.0]), model=FISHEYE),
    )


@pytest.fixture(scope="module")
def scene() -> Scene:
    return replace(faulty(), cameras=distorted(), engine="cycles", passes=find_spec("OpenEXR") is not None)


@pytest.fixture(scope="module")
def rendered(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lens")
    render_scene(scene, folder)
    return folder


def picture(folder: Path, kind: str, camera: Camera) -> np.ndarray:
    return decode_png((folder / kind / f"{camera.name}.png").read_bytes())


@pytest.mark.parametrize("i", [0, 1])
def test_a_mask_is_white_where_the_ray_of_the_lens_meets_a_strut(scene: Scene, rendered: Path, i: int) -> None:
    camera = scene.cameras[i]
    mask, outside = picture(rendered, "images", camera), margin(scene, camera)
    assert mask.shape == (camera.height, camera.width) and set(np.unique(mask)) == {0, 255}
    clear = np.abs(outside) > EDGE
    np.testing.assert_array_equal(mask[clear] > 0, outside[clear] < 0.0)
    # The lens matters: its picture is not that of the pinhole camera.
    straight = margin(scene, camera.without_distortion())
    assert np.mean((mask > 0) != (straight < 0.0)) > 0.01


@pytest.mark.parametrize("i", [0, 1])
def test_projected_curves_fall_on_the_mask(scene: Scene, rendered: Path, i: int) -> None:
    camera = scene.cameras[i]
    mask = picture(rendered, "images", camera)
    whole = np.flatnonzero(scene.truth.printed & (scene.present == (0.0, 1.0)).all(axis=1))
    points = bezier.evaluate(scene.truth.control_points[whole], np.linspace(0.05, 0.95, 40))
    pixels, _ = camera.project(points.reshape(-1, 3))
    column, row = np.floor(pixels).astype(int).T
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    assert inside.sum() > 300
    assert (mask[row[inside], column[inside]] == 255).all()


@pytest.mark.parametrize("i", [0, 1])
def test_passes_tell_what_the_lens_sees(scene: Scene, rendered: Path, i: int) -> None:
    pytest.importorskip("OpenEXR", reason="the passes are read with the OpenEXR package, outside of Blender")
    from frametwin.imaging.exr import read_passes

    camera = scene.cameras[i]
    passes = read_passes(rendered / "passes" / f"{camera.name}.exr")
    np.testing.assert_array_equal(passes.strut >= 0, picture(rendered, "images", camera) > 0)
    rows, columns = np.nonzero(passes.strut >= 0)
    centres = np.stack([columns + 0.5, rows + 0.5], axis=1)
    points = camera.unproject(centres, passes.depth[rows, columns])
    curves = bezier.evaluate(scene.truth.control_points, np.linspace(0.0, 1.0, 200))
    away = np.array(
        [
            np.linalg.norm(curves[k] - point, axis=1).min()
            for k, point in zip(passes.strut[rows, columns], points, strict=True)
        ]
    )
    # On the surface of the strut that is named: its radius is 0.7 to 1.3 mm; a quarter of a pixel is 0.15 mm.
    assert np.mean((away > 0.5) & (away < 1.5)) > 0.97
    facing = np.einsum("ni,ni->n", passes.normal[rows, columns], camera.centre - points)
    assert np.mean(facing > 0.0) > 0.97


def test_photos_show_the_lens_too(scene: Scene, tmp_path: Path) -> None:
    look = PhotoLook(samples=4, electrons=1e5, read_noise=0.0)
    render_scene(replace(scene, style="photo", passes=False, cameras=scene.cameras[:1], look=look), tmp_path)
    camera = scene.cameras[0]
    image, background = (picture(tmp_path, kind, camera).astype(int) for kind in ("images", "background"))
    outside, changed = margin(scene, camera), np.abs(image - background).max(axis=2)
    assert np.mean(changed[outside < -1.2] > 30) > 0.95
    assert np.mean(image[outside < -1.2].min(axis=1) > background[outside < -1.2].min(axis=1) + 30) > 0.9
