"""The curves of a fit that is under way: bright strands, unlike plan and twin, which Blender draws anew in a moment."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.scene.collections import remove_object
from frametwin.blender.scene.units import mm_per_unit
from frametwin.geometry import bezier

NAME = "FrameTwin fit"
KEY = "frametwin_preview"
PIECES = 4  # straight pieces of a strut
COLOUR = (0.0, 0.6, 1.0, 1.0)


def show_preview(control_points: np.ndarray, scene: bpy.types.Scene) -> bpy.types.Object:
    """Show curves (E, 4, 3) in mm, in the place of those that are shown.

    Looked up by its mark each time: between two calls the user may have deleted or undone it.
    """
    points = bezier.evaluate(control_points, np.linspace(0.0, 1.0, PIECES + 1)) / mm_per_unit(scene)
    obj = next((found for found in scene.objects if KEY in found), None)
    if obj is None or len(obj.data.points) != points.shape[0] * points.shape[1]:
        remove_preview(scene)
        obj = _new_preview(len(points), scene)
    obj.data.position_data.foreach_set("vector", points.astype(np.float32).ravel())
    obj.data.update_tag()
    return obj


def _new_preview(count: int, scene: bpy.types.Scene) -> bpy.types.Object:
    data = bpy.data.hair_curves.new(NAME)
    data.add_curves([PIECES + 1] * count)
    data.set_types(type="POLY")
    data.materials.append(_material())
    obj = bpy.data.objects.new(NAME, data)
    obj[KEY] = True
    obj.hide_select = obj.hide_render = obj.show_in_front = True
    obj.color = COLOUR
    scene.collection.objects.link(obj)
    return obj


def _material() -> bpy.types.Material:
    material = next((found for found in bpy.data.materials if KEY in found), None)
    if material is None:
        material = bpy.data.materials.new(NAME)
        material[KEY] = True
        material.diffuse_color = COLOUR
    return material


def remove_preview(scene: bpy.types.Scene | None = None) -> None:
    """Take away what `show_preview` has shown, in all scenes if none is given."""
    for obj in [found for found in (bpy.data if scene is None else scene).objects if KEY in found]:
        remove_object(obj)
    bpy.data.batch_remove([found for found in bpy.data.materials if KEY in found and not found.users])
