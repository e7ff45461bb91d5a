"""Photos: the print in matte plastic on a blue table before black surroundings, and the same views without it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import mathutils
import numpy as np

from frametwin.blender.rendering import engines, materials, versions
from frametwin.blender.rendering.private_scene import NAME, PrivateScene
from frametwin.blender.rendering.render_job import RenderJob
from frametwin.blender.rendering.sensor import expose
from frametwin.capture.image_files import encode_png
from frametwin.capture.scene import PhotoLook
from frametwin.files import write_bytes

DENOISED_GAIN = 4
"""How many times the samples are taken where there is no denoiser."""

FILTER_WIDTH = 1.5
"""Of the pixel filter, in pixels, as a lens blurs."""

TABLE_REACH = (1.2, 3.0)
"""Distances from the middle of the table, in sizes of the frame, up to which it is lit and from which it is black."""


@dataclass(frozen=True)
class Light:
    """A square soft light that looks at the frame; distance and side in sizes of the frame, angles in degrees."""

    azimuth: float
    elevation: float
    distance: float
    side: float


KEY = Light(azimuth=0.0, elevation=55.0, distance=3.0, side=2.0)
RIM = Light(azimuth=180.0, elevation=30.0, distance=3.0, side=1.5)


def render_photos(job: RenderJob, folder: Path, background: Path) -> None:
    """Render every view with the frame into one folder and without it into the other."""
    look, scene = job.private.content.look, job.private.scene
    set_stage(job.private)
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
    image.color_mode, image.color_depth, image.exr_codec = "RGB", "32", "NONE"
    for stage, target in enumerate((folder, background)):
        job.private.struts.hide_render = target is background
        for i, camera in job.views():
            rng = np.random.default_rng([look.seed, i, stage])
            scene.cycles.seed = int(rng.integers(2**31 - 1))
            light = read_light(job.render(".exr"))
            write_bytes(target / f"{camera.name}.png", encode_png(expose(light, look, rng), noisy=True))
    job.private.struts.hide_render = False


def set_stage(private: PrivateScene) -> None:
    """Plastic, table and lights around the frame of the scene."""
    content, look = private.content, private.content.look
    low, high = content.truth.bounds
    radius = float(content.thickness.max())
    size = float(np.linalg.norm(high - low)) + 2.0 * radius
    centre = 0.5 * (low + high)
    private.add_smooth_normals()
    materials.fill_plastic(private.material, look)
    materials.fill_surroundings(private.world, look.fill)
    ground = np.array([centre[0], centre[1], low[2] - radius])
    _add_table(private, ground, size, look)
    for light, irradiance in ((KEY, look.key), (RIM, look.rim)):
        _add_light(private, light, irradiance, centre, size, look.light_azimuth)


def read_light(path: Path) -> np.ndarray:
    """Linear light (H, W, 3) float32 of a picture that Blender wrote, from the top row down."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.is_data = True  # the numbers as they are
        width, height = image.size
        values = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(values)
        return values.reshape(height, width, image.channels)[::-1, :, :3]
    finally:
        bpy.data.images.remove(image)


def _path_settings(scene: bpy.types.Scene, samples: int) -> None:
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_light_tree = False  # measured: they gain nothing here
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", FILTER_WIDTH
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 2, 2, 1
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0  # no lone bright pixels


def _add_table(private: PrivateScene, ground: np.ndarray, size: float, look: PhotoLook) -> None:
    """A plane, black at its rim, as opaque as a real one: from below struts get no light but what it casts back."""
    bright, dark = TABLE_REACH[0] * size, TABLE_REACH[1] * size
    data = private.keep(bpy.data.meshes.new(NAME))
    corners = [(-dark, -dark, 0.0), (dark, -dark, 0.0), (dark, dark, 0.0), (-dark, dark, 0.0)]
    data.from_pydata(corners, [], [(0, 1, 2, 3)])
    material = private.keep(bpy.data.materials.new(NAME))
    materials.fill_table(material, look, bright, dark)
    data.materials.append(material)
    table = private.add_object(data)
    table.location = ground


def _add_light(
    private: PrivateScene, light: Light, irradiance: float, centre: np.ndarray, size: float, azimuth: float
) -> None:
    """A soft light, as strong as makes this irradiance in the middle of the frame."""
    turn, up = np.radians(azimuth + light.azimuth), np.radians(light.elevation)
    outward = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    data = private.keep(bpy.data.lights.new(NAME, "AREA"))
    data.shape, data.size = "SQUARE", light.side * size
    # A lamp of the power P sends the radiance P / (pi side^2) off its face.
    data.energy = irradiance * np.pi * (light.distance * size) ** 2
    item = private.add_object(data)
    item.visible_camera = False
    rotation = mathutils.Vector(outward.tolist()).to_track_quat("Z", "Y").to_matrix().to_4x4()
    item.matrix_world = mathutils.Matrix.Translation(centre + light.distance * size * outward) @ rotation
