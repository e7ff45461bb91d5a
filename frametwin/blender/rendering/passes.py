"""Passes: depth, normal and strut index of every view, in one OpenEXR file each (see `frametwin.imaging.exr`)."""

from __future__ import annotations

from pathlib import Path

from frametwin.blender.rendering import engines, materials, versions
from frametwin.blender.rendering.masks import FINER
from frametwin.blender.rendering.render_job import RenderJob
from frametwin.cameras.lens_warp import LensWarp
from frametwin.errors import InputError
from frametwin.files import write_bytes


def render_passes(job: RenderJob, folder: Path) -> None:
    """Depth, normal and strut index of what the centre of every pixel sees, 32 bits a value."""
    scene, layer = job.private.scene, job.private.scene.view_layers[0]
    job.private.show_struts_alone()
    job.private.add_smooth_normals()
    scene.render.engine = engines.CYCLES
    engines.set_single_sample(scene)
    layer.use_pass_combined = False
    layer.use_pass_z = layer.use_pass_normal = True
    index = layer.aovs.add()
    index.name, index.type = materials.STRUT_PASS, "VALUE"
    image = scene.render.image_settings
    versions.write_multilayer_images(image)
    image.color_depth, image.exr_codec = "32", "ZIP"
    for _, camera, warp in job.views(finer=FINER):
        path = job.render(".exr")
        if warp is not None:
            bend_passes(path, warp)
        write_bytes(folder / f"{camera.name}.exr", path.read_bytes())


def bend_passes(path: Path, warp: LensWarp) -> None:
    """Resample the passes in a file to what the lens sees; every value is one that is there.

    Raises
    ------
    InputError
        If there is no package for such files in this Python, as in a Blender of its own.
    """
    try:
        from frametwin.imaging.exr import resample_channels
    except ImportError as error:
        remedy = "render with the bpy module, or leave the passes or the lens out"
        raise InputError.at(
            "scene", "passes", "of a lens that distorts need the package OpenEXR, which this Python lacks", remedy
        ) from error
    resample_channels(path, warp.nearest)
