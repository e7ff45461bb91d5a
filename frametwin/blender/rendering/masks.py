"""Masks: white struts on black, every pixel what its centre sees."""

from __future__ import annotations

from pathlib import Path

from frametwin.blender.rendering import engines, versions
from frametwin.blender.rendering.render_job import RenderJob
from frametwin.capture.image_files import decode_png, encode_png, strip_png
from frametwin.files import write_bytes

COMPRESSION = 50
"""Of PNG files, in percent: two thirds of the size of Blender's usual 15 in the same time."""

FINER = 2.0
"""How many times as fine as a lens's own a picture is from which its pixels are taken: they err by a quarter of one."""


def render_masks(job: RenderJob, engine: str, folder: Path) -> None:
    """White struts on black: 0 and 255 only, since every pixel is what its centre sees."""
    scene = job.private.scene
    scene.render.engine = engine
    if engine == engines.WORKBENCH:
        scene.display.render_aa = "OFF"
        shading = scene.display.shading
        shading.light, shading.color_type, shading.single_color = "FLAT", "SINGLE", (1.0, 1.0, 1.0)
        shading.show_object_outline = shading.show_cavity = shading.show_shadows = False
        shading.show_backface_culling = shading.show_xray = False
    else:
        engines.set_single_sample(scene)
    image = scene.render.image_settings
    versions.write_still_images(image, "PNG")
    image.color_mode, image.color_depth, image.compression = "BW", "8", COMPRESSION
    for _, camera, warp in job.views(finer=FINER):
        path = job.render(".png")
        data = path.read_bytes()
        picture = strip_png(data, path) if warp is None else encode_png(warp.nearest(decode_png(data, path)))
        write_bytes(folder / f"{camera.name}.png", picture)
