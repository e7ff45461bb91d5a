"""Photos rendered by Blender: the masks that the paper's thresholds make of them, their noise, and their seeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from rod_rays import cameras, faulty, margin

from frametwin.blender.rendering import photos, versions
from frametwin.blender.rendering.optics import through_lens
from frametwin.blender.rendering.render import render_scene
from frametwin.blender.rendering.sensor import expose, tone_curve
from frametwin.cameras import Camera
from frametwin.capture.image_files import decode_png
from frametwin.capture.scene import PhotoLook, Scene
from frametwin.errors import Cancelled

STRUT, DIFFERENCE = 120, 30
"""The paper's threshold (section V.B), and the least change against the background."""


def photo_scene(**look: object) -> Scene:
    return replace(faulty(), style="photo", cameras=cameras()[:1], look=PhotoLook(**{"samples": 4, **look}))


def picture(folder: Path, kind: str, camera: Camera) -> np.ndarray:
    return decode_png((folder / kind / f"{camera.name}.png").read_bytes())


def binarised(image: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Bright, colourless, and other than before."""
    channels = image.astype(int)
    bright = (channels.min(axis=2) > STRUT) & (np.ptp(channels, axis=2) < STRUT / 2)
    return bright & (np.abs(channels - background).max(axis=2) >= DIFFERENCE)


@pytest.mark.parametrize("denoise", [True, False])
def test_a_photo_shows_the_print_and_its_shaded_sides(denoise: bool, tmp_path: Path) -> None:
    scene = replace(photo_scene(denoise=denoise, samples=4 if denoise else 16, seed=3), cameras=cameras())
    found = render_scene(scene, tmp_path)
    assert found.engine == "cycles"
    for camera in scene.cameras:
        image, background = (picture(tmp_path, kind, camera) for kind in ("images", "background"))
        assert image.shape == background.shape == (camera.height, camera.width, 3)
        outside = margin(scene, camera)
        # The pixel filter spreads an edge over two pixels, of which the bright side wins.
        clear = np.abs(outside) > 1.2
        found_print, is_print = binarised(image, background)[clear], outside[clear] < 0.0
        assert not (found_print & ~is_print).any()
        # The table is opaque: undersides of struts are darker than the paper's rule takes for print, though not dark.
        assert 0.7 < found_print.sum() / is_print.sum() < 1.0
        changed = np.abs(image.astype(int) - background).max(axis=2)
        assert np.mean(changed[outside < -1.2] >= DIFFERENCE) > 0.97
        struts = image[outside < -1.2].astype(float)
        assert np.median(struts.min(axis=1)) > STRUT + 15
        assert np.mean(struts == 255) < 0.01
        assert background.min(axis=2).max() < STRUT - 30
        table = background.reshape(-1, 3).astype(float).mean(axis=0)
        assert table[2] > 1.5 * table[0]  # blue


def test_the_library_makes_the_same_mask(tmp_path: Path) -> None:
    pytest.importorskip("cv2", reason="the library binarises with OpenCV at hand")
    from frametwin.imaging.masks import BACKGROUND_DIFFERENCE, PHOTO_THRESHOLD, binarise_photo

    assert (PHOTO_THRESHOLD, BACKGROUND_DIFFERENCE) == (STRUT, DIFFERENCE)
    scene = photo_scene()
    render_scene(scene, tmp_path)
    image, background = (picture(tmp_path, kind, scene.cameras[0]) for kind in ("images", "background"))
    np.testing.assert_array_equal(binarise_photo(image, background) > 0, binarised(image, background))


def test_a_photo_depends_on_its_seed_alone(tmp_path: Path) -> None:
    pictures = {}
    for run, seed in (("first", 5), ("second", 5), ("other", 6)):
        scene = photo_scene(seed=seed)
        render_scene(scene, tmp_path / run)
        pictures[run] = [picture(tmp_path / run, kind, scene.cameras[0]) for kind in ("images", "background")]
    for one, again, other in zip(*pictures.values(), strict=True):
        np.testing.assert_array_equal(one, again)
        assert np.mean(one != other) > 0.3
    # Each picture has noise of its own.
    assert np.mean(pictures["first"][0][:10] != pictures["first"][1][:10]) > 0.2


def test_the_passes_of_a_photo_are_those_of_a_mask(tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR", reason="the passes are read with the OpenEXR package, outside of Blender")
    from frametwin.imaging.exr import read_passes

    scene = replace(photo_scene(samples=1), passes=True)
    for style in ("mask", "photo"):
        render_scene(replace(scene, style=style), tmp_path / style)
    name = f"{scene.cameras[0].name}.exr"
    one, other = (read_passes(tmp_path / style / "passes" / name) for style in ("mask", "photo"))
    assert (one.strut >= 0).any()
    for field in ("strut", "depth", "normal"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_a_build_without_denoiser_takes_more_samples_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(versions, "choose_denoiser", lambda scene: False)
    assert render_scene(photo_scene(samples=1), tmp_path).remarks == [
        "this build of Blender has no denoiser: 4 samples a pixel instead"
    ]
    assert not render_scene(photo_scene(samples=1, denoise=False), tmp_path).remarks


def light_of(folder: Path, camera: Camera, kind: str = "images") -> np.ndarray:
    """Linear light of a photo, by the middle of what each value stands for."""
    linear = np.arange(65536) / 65535.0
    middles = np.array([linear[tone_curve() == value].mean() for value in range(256)])
    return middles[picture(folder, kind, camera)]


@pytest.mark.parametrize(
    "change", [{}, {"light_side": 0.2}, {"clutter": ((0, 0.9, -0.4, 0.3, 0.3, 20.0, 0.6, 0.1, 0.1),)}]
)
def test_layers_make_the_picture_of_the_whole_scene(change: dict, tmp_path: Path) -> None:
    quiet = {"samples": 64, "denoise": False, "electrons": 1e6, "read_noise": 0.0, **change}
    for layered in (True, False):
        render_scene(photo_scene(layered=layered, **quiet), tmp_path / str(layered))
    camera = photo_scene().cameras[0]
    for kind, most in (("images", 0.012), ("background", 0.006)):
        one, other = (light_of(tmp_path / str(layered), camera, kind) for layered in (True, False))
        # Between all pixels the light is the same; single ones differ by the noise of paths, and at edges of things.
        np.testing.assert_allclose(one.mean(axis=(0, 1)), other.mean(axis=(0, 1)), rtol=0.02, atol=1e-3)
        assert np.abs(one - other).mean() < most
        blocks = [item.reshape(15, 8, 20, 8, 3).mean(axis=(1, 3)) for item in (one, other)]
        assert np.abs(blocks[0] - blocks[1]).max() < 0.05


def test_exposures_and_references_are_as_they_are_told(tmp_path: Path) -> None:
    quiet = {"samples": 4, "electrons": 1e6, "read_noise": 0.0}
    render_scene(photo_scene(**quiet), tmp_path / "plain")
    render_scene(photo_scene(**quiet, view_exposures=(-1.0,), reference_exposure=0.5), tmp_path / "told")
    camera = photo_scene().cameras[0]
    for kind, stops in (("images", -1.0), ("background", -0.5)):
        plain, told = (light_of(tmp_path / name, camera, kind) for name in ("plain", "told"))
        fine = (plain > 0.02) & (plain < 0.9)
        np.testing.assert_allclose(told[fine].mean(), 2.0**stops * plain[fine].mean(), rtol=0.02)


def test_corners_get_darker_and_edges_softer() -> None:
    look = PhotoLook(vignetting=0.4, defocus=2.0)
    even = through_lens(np.ones((61, 81, 3), dtype=np.float32), look)
    assert even[30, 40] == pytest.approx(1.0, abs=1e-6) and even[0, 0] == pytest.approx(0.6, abs=0.02)
    step = np.zeros((21, 60, 3), dtype=np.float32)
    step[:, 30:] = 1.0
    slope = np.diff(through_lens(step, replace(look, vignetting=0.0))[10, :, 0])
    place = np.arange(len(slope)) + 1.0
    assert slope.sum() == pytest.approx(1.0, abs=1e-5) and slope @ place == pytest.approx(30.0, abs=1e-3)
    assert np.sqrt(slope @ (place - 30.0) ** 2) == pytest.approx(2.0, rel=0.03)


def test_nothing_is_left_behind(tmp_path: Path) -> None:
    kinds = [p.identifier for p in bpy.data.bl_rna.properties if p.type == "COLLECTION"]
    before = {kind: len(getattr(bpy.data, kind)) for kind in kinds}
    render_scene(photo_scene(samples=1), tmp_path)
    with pytest.raises(Cancelled):
        render_scene(photo_scene(samples=1), tmp_path, lambda progress: progress.iteration < 1)
    assert {kind: len(getattr(bpy.data, kind)) for kind in kinds} == before


def test_light_is_read_as_it_was_rendered(tmp_path: Path) -> None:
    image = bpy.data.images.new("ramp", 5, 3, float_buffer=True, is_data=True)
    rows = np.linspace(0.0, 4.0, 45).reshape(3, 5, 3)  # from the top down
    image.pixels.foreach_set(np.concatenate([rows, np.ones((3, 5, 1))], axis=2)[::-1].ravel().astype(np.float32))
    image.file_format, image.filepath_raw = "OPEN_EXR", str(tmp_path / "ramp.exr")
    image.save()
    bpy.data.images.remove(image)
    np.testing.assert_allclose(photos.read_light(tmp_path / "ramp.exr"), rows, rtol=1e-3)
    assert not bpy.data.images


def test_noise_grows_with_the_root_of_the_light() -> None:
    look = PhotoLook(electrons=2000.0, read_noise=20.0)
    linear = np.arange(65536) / 65535.0
    for level in (0.05, 0.3, 0.7):
        photo = expose(np.full((200, 200, 3), level), look, np.random.default_rng(1))
        # Back to light by the middle of what each value stands for.
        middles = np.array([linear[tone_curve() == value].mean() for value in range(256)])
        light = middles[photo]
        assert light.mean() == pytest.approx(level, rel=0.01)
        assert light.std() == pytest.approx(np.sqrt(2000.0 * level + 20.0**2) / 2000.0, rel=0.03)


def test_exposure_counts_in_stops_and_white_stays_white() -> None:
    quiet = PhotoLook(electrons=1e6, read_noise=0.0)
    light = np.full((20, 20, 3), 0.1)
    doubled = expose(2.0 * light, quiet, np.random.default_rng(0)).mean()
    brighter = expose(light, replace(quiet, exposure=1.0), np.random.default_rng(0)).mean()
    assert brighter == pytest.approx(doubled, abs=0.2)
    assert expose(9.0 * np.ones((4, 4, 3)), quiet, np.random.default_rng(0)).min() == 255
    assert expose(-np.ones((4, 4, 3)), quiet, np.random.default_rng(0)).max() == 0


@pytest.mark.parametrize(("light", "value"), [(0.0, 0), (0.0021, 7), (0.2140, 127), (1.0, 255)])
def test_the_tone_curve_is_that_of_srgb(light: float, value: int) -> None:
    assert abs(int(tone_curve()[round(light * 65535)]) - value) <= 1
