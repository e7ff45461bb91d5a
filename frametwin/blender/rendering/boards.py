"""Photographs of calibration boards and blocks, by Cycles."""

from __future__ import annotations

from pathlib import Path

import bpy
import mathutils
import numpy as np

from frametwin.blender.rendering import engines, materials, versions
from frametwin.blender.rendering.photo_layers import box_of, cropped
from frametwin.blender.rendering.photos import FILTER_WIDTH, read_light
from frametwin.blender.rendering.private_scene import NAME, PrivateScene
from frametwin.blender.rendering.render_job import RenderJob
from frametwin.blender.rendering.sensor import expose
from frametwin.cameras.lens_warp import LensWarp, lens_warp
from frametwin.capture.board_scene import BoardScene, BoardShot, Body
from frametwin.capture.image_files import encode_png
from frametwin.capture.scene import PhotoLook
from frametwin.files import write_bytes

SAMPLES = 32
"""Paths a pixel: corners are found to some hundredths of a pixel, so their edges have to be smooth."""

PAPER, INK, ROOM = 0.8, 0.02, 0.15
"""Reflectance of paper and ink, and light of what is around."""

LIGHT = 0.6
"""Light that comes evenly from everywhere: boards have no shaded side, as between soft lamps."""

MARGIN = 4.0
"""Pixels that are rendered around a board."""


def render_boards(job: RenderJob, boards: BoardScene, folder: Path) -> None:
    """Render every shot into its file below a folder."""
    private = job.private
    scene = private.scene
    for item in scene.collection.objects:
        item.hide_render = item.type != "CAMERA"
    materials.fill_even(private.world, LIGHT)
    scene.render.engine = engines.CYCLES
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", FILTER_WIDTH
    scene.cycles.max_bounces = 0
    scene.render.film_transparent = True
    image = scene.render.image_settings
    versions.write_still_images(image, "OPEN_EXR")
    image.color_mode, image.color_depth, image.exr_codec = "RGBA", "32", "NONE"
    things = {name: _add_body(private, body) for name, body in boards.bodies.items()}
    look, warps = PhotoLook(), dict[str, LensWarp]()
    for shot in boards.shots:
        job.report_progress()
        for name, thing in things.items():
            thing.hide_render = name != shot.body
        things[shot.body].matrix_world = mathutils.Matrix(shot.pose.tolist())
        warp = warps.setdefault(shot.camera.name, lens_warp(shot.camera))
        light = _light(job, shot, boards.bodies[shot.body], warp)
        photo = expose(light, look, np.random.default_rng(shot.seed))
        path = folder / shot.file
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, encode_png(photo, noisy=True))
        job.done += 1


def _light(job: RenderJob, shot: BoardShot, body: Body, warp: LensWarp) -> np.ndarray:
    """Linear light (H, W, 3) of one shot; only the part of the picture that the body covers is rendered."""
    pinhole = warp.pinhole
    light = np.full((pinhole.height, pinhole.width, 3), ROOM, dtype=np.float32)
    corners = body.white.reshape(-1, 3) @ shot.pose[:3, :3].T + shot.pose[:3, 3]
    box = box_of(pinhole, corners, MARGIN)
    if box is not None:
        left, top, right, bottom = box
        job.private.look_through(cropped(pinhole, box))
        job.private.scene.cycles.seed = shot.seed % (2**31 - 1)
        layer = read_light(job.render(".exr"), channels=4)
        part = light[top:bottom, left:right]
        part *= 1.0 - layer[..., 3:]
        part += layer[..., :3]
    return warp.linear(light) if shot.camera.has_distortion else light[_inside(warp, shot)]


def _inside(warp: LensWarp, shot: BoardShot) -> tuple[slice, slice]:
    """Where the picture of a camera without distortion lies in the wider one."""
    top, left = round(warp.pinhole.cy - shot.camera.cy), round(warp.pinhole.cx - shot.camera.cx)
    return slice(top, top + shot.camera.height), slice(left, left + shot.camera.width)


def _add_body(private: PrivateScene, body: Body) -> bpy.types.Object:
    pieces = np.concatenate([body.white, body.black])
    data = private.keep(bpy.data.meshes.new(NAME))
    faces = np.arange(4 * len(pieces)).reshape(-1, 4)
    data.from_pydata(pieces.reshape(-1, 3).tolist(), [], faces.tolist())
    for grey in (PAPER, INK):
        material = private.keep(bpy.data.materials.new(NAME))
        materials.fill_matte(material, grey)
        data.materials.append(material)
    data.polygons.foreach_set("material_index", (np.arange(len(pieces)) >= len(body.white)).astype(np.int32))
    data.update()
    return private.add_object(data)
