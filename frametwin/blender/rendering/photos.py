"""Photos: the print in matte plastic on a table before black surroundings, and the same views without it."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.rendering import engines, versions
from frametwin.blender.rendering.optics import through_lens, view_look
from frametwin.blender.rendering.photo_layers import Shot, layered_light, light_without_print
from frametwin.blender.rendering.photo_stage import PhotoStage
from frametwin.blender.rendering.render_job import RenderJob
from frametwin.blender.rendering.sensor import expose
from frametwin.cameras import Camera
from frametwin.capture.image_files import encode_png
from frametwin.files import write_bytes

DENOISED_GAIN = 4
"""How many times the samples are taken where there is no denoiser."""

FILTER_WIDTH = 1.5
"""Of the pixel filter, in pixels, as a lens blurs."""


def render_photos(job: RenderJob, folder: Path, background: Path) -> None:
    """Render every view with the frame into one folder and without it into the other."""
    look, scene = job.private.content.look, job.private.scene
    stage = PhotoStage(job.private)
    samples = look.samples
    scene.render.engine = engines.CYCLES
    if not (look.denoise and versions.choose_denoiser(scene)):
        scene.cycles.use_denoising = False
        if look.denoise:
            samples *= DENOISED_GAIN
            job.result.remarks.append(f"this build of Blender has no denoiser: {samples} samples a pixel instead")
    _path_settings(scene, samples)
    image = scene.render.image_settings
    versions.write_still_images(image, "OPEN_EXR")
    image.color_mode, image.color_depth, image.exr_codec = "RGBA", "32", "NONE"

    def shot(view: Camera, share: float) -> np.ndarray:
        job.private.look_through(view)
        scene.cycles.samples = max(1, round(share * samples))
        return read_light(job.render(".exr"), channels=4)

    for i, camera, warp in job.views(pictures=2):
        rngs = [np.random.default_rng([look.seed, i, part]) for part in (0, 1)]
        seeds = [int(rng.integers(2**31 - 1)) for rng in rngs]
        pinhole = camera if warp is None else warp.pinhole
        lights = _two_lights(stage, pinhole, shot, seeds)
        for target, light, rng in zip((folder, background), lights, rngs, strict=True):
            seen = through_lens(light if warp is None else warp.linear(light), look)
            photo = expose(seen, view_look(look, i, reference=target is background), rng)
            write_bytes(target / f"{camera.name}.png", encode_png(photo, noisy=True))


def read_light(path: Path, channels: int = 3) -> np.ndarray:
    """Linear light (H, W, C) float32 of a picture that Blender wrote, from the top row down."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.is_data = True  # the numbers as they are
        image.alpha_mode = "CHANNEL_PACKED"
        width, height = image.size
        values = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(values)
        return values.reshape(height, width, image.channels)[::-1, :, :channels]
    finally:
        bpy.data.images.remove(image)


def _two_lights(stage: PhotoStage, camera: Camera, shot: Shot, seeds: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Linear light (H, W, 3) of a view with the print and without it."""
    look, scene, struts = stage.private.content.look, stage.private.scene, stage.private.struts
    scene.cycles.seed = seeds[0]
    if look.layered:
        light, without = layered_light(stage, camera, shot)
        if not look.reference_turn:
            return light, without
    else:
        light = shot(camera, 1.0)[..., :3]
    scene.cycles.seed = seeds[1]
    stage.turn_lamps(look.light_azimuth + look.reference_turn)
    if look.layered:
        _, without = light_without_print(stage, camera, shot)
    else:
        struts.hide_render = True
        without = shot(camera, 1.0)[..., :3]
        struts.hide_render = False
    stage.turn_lamps(look.light_azimuth)
    return light, without


def _path_settings(scene: bpy.types.Scene, samples: int) -> None:
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_light_tree = False  # measured: they gain nothing here
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", FILTER_WIDTH
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 2, 2, 1
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0  # no lone bright pixels
