"""The curves of a fit that is under way, as lines: a mesh, since Blender draws it anew in a moment, unlike curves."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.scene.collections import remove_object
from frametwin.blender.scene.units import mm_per_unit
from frametwin.geometry import bezier

NAME = "FrameTwin fit"
KEY = "frametwin_preview"
PIECES = 4  # straight pieces of a strut


def show_preview(control_points: np.ndarray, scene: bpy.types.Scene) -> bpy.types.Object:
    """Show curves (E, 4, 3) in mm, in the place of those that are shown.

    Looked up by its mark each time: between two calls the user may have deleted or undone it.
    """
    points = bezier.evaluate(control_points, np.linspace(0.0, 1.0, PIECES + 1)) / mm_per_unit(scene)
    obj = next((found for found in scene.objects if KEY in found), None)
    if obj is None or len(obj.data.vertices) != points.shape[0] * points.shape[1]:
        remove_preview(scene)
        obj = _new_preview(points, scene)
    obj.data.vertices.foreach_set("co", points.astype(np.float32).ravel())
    obj.data.update()
    return obj


def _new_preview(points: np.ndarray, scene: bpy.types.Scene) -> bpy.types.Object:
    count, steps = points.shape[:2]
    first = (np.arange(count) * steps)[:, None] + np.arange(steps - 1)  # (E, PIECES)
    mesh = bpy.data.meshes.new(NAME)
    mesh.vertices.add(count * steps)
    mesh.edges.add(first.size)
    mesh.edges.foreach_set("vertices", np.stack([first, first + 1], axis=-1).astype(np.int32).ravel())
    obj = bpy.data.objects.new(NAME, mesh)
    obj[KEY] = True
    obj.hide_select = obj.hide_render = obj.show_in_front = True
    obj.color = (0.1, 0.55, 1.0, 1.0)
    scene.collection.objects.link(obj)
    return obj


def remove_preview(scene: bpy.types.Scene | None = None) -> None:
    """Take away what `show_preview` has shown, in all scenes if none is given."""
    for obj in [found for found in (bpy.data if scene is None else scene).objects if KEY in found]:
        remove_object(obj)
