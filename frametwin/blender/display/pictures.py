"""A picture of a twin with its colours and their legend, without a window."""

from __future__ import annotations

import bpy

from frametwin.blender.display.legend_entries import legend_entries
from frametwin.blender.display.stage import PhotoStage, clear_stage
from frametwin.blender.display.twins import TwinObjects
from frametwin.blender.rendering.render_job import call_renderer
from frametwin.blender.scene.units import mm_per_unit
from frametwin.capture.image_files import strip_png
from frametwin.errors import FrameTwinError
from frametwin.files import PathLike, write_bytes
from frametwin.scratch import scratch_folder


def render_twin(shown: TwinObjects, path: PathLike, size: tuple[int, int] = (1200, 1600)) -> None:
    """Render the twin as it is coloured, seen from a corner above, with the legend below.

    Parameters
    ----------
    shown
        The twin in its scene, which is left as it was; it must not have been moved.
    path
        The PNG file, written whole or not at all.
    size
        Height and width in pixels.

    Raises
    ------
    FrameTwinError
        If Blender does not render, or the file cannot be written.
    """
    points = shown.frame().control_points.reshape(-1, 3)
    scene = bpy.data.scenes.new("FrameTwin picture")
    try:
        scene.collection.objects.link(shown.twin)
        stage = PhotoStage(scene, points / mm_per_unit(bpy.context.scene), size)
        stage.add_legend(shown.legend, legend_entries([shown.twin]))
        with scratch_folder() as scratch:
            file = scratch / "twin.png"
            scene.render.filepath = str(file)
            render(scene)
            write_bytes(path, strip_png(file.read_bytes(), file))
    finally:
        bpy.data.scenes.remove(scene)
        clear_stage()


def render(scene: bpy.types.Scene, animation: bool = False) -> None:
    """Let Blender render a scene, one picture or its whole timeline, to the path that is set in it.

    Raises
    ------
    FrameTwinError
        If it does not.
    """
    try:
        call_renderer(scene.name, animation)
    except RuntimeError as error:
        raise FrameTwinError(f"Blender did not render: {' '.join(str(error).split())}") from error
