"""What is in view where something else comes to stand in its place: what the add-on made gives way, hers stays."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.display.adapted import ROLE as ADAPTED_ROLE
from frametwin.blender.display.display_inputs import KEY as DISPLAY
from frametwin.blender.display.preview import KEY as PREVIEW
from frametwin.blender.display.print_jobs import ROLE_KEY as JOB_ROLE
from frametwin.blender.display.prints import is_made_print
from frametwin.blender.display.twins import ROLE_KEY as TWIN_ROLE
from frametwin.blender.display.twins import find_twin
from frametwin.blender.frames.described import DESCRIBES
from frametwin.blender.frames.plan_objects import is_added_plan
from frametwin.blender.frames.plans import READABLE
from frametwin.blender.scene import visibility
from frametwin.blender.views.rig_distance import set_distance
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.wording import enumerated

from .recolour import recolour_afresh
from .steps import plan_of, print_of, rig_of, twin_of

BOX = 8
"""Corners of a box."""


def hide(obj: bpy.types.Object | None) -> None:
    """Hide the plan, which stands where the print is shown, or both, where the twin is; not from who is editing it.

    The panels' buttons show it again.
    """
    if obj is not None and obj.mode == "OBJECT":
        visibility.hide(obj)


def hide_for_print(scene: bpy.types.Scene) -> None:
    """Hide plan and twin, which stand where the print is shown; see `hide`."""
    hide(scene.frametwin.plan)
    hide_twin(scene.frametwin.twin)


def can_be_chosen(obj: bpy.types.Object) -> bool:
    """Whether the lists of plans and prints offer an object; what belongs to a twin or a job is only in the way."""
    ours = (TWIN_ROLE, ADAPTED_ROLE, JOB_ROLE, PREVIEW, DESCRIBES, DISPLAY)
    return obj.type in READABLE and not any(key in obj for key in ours)


def plan_chosen(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Show the plan that was chosen in the place of the one before; called by Blender when it changes.

    An object that the user drew herself is not hidden: she would not know why it is gone.
    """
    new, old = settings.plan, settings.plan_before
    if new is None or new == old:
        return
    if old is not None and is_added_plan(old):
        hide(old)
    visibility.show(new)
    settings.plan_before = new


def distance_changed(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Let a rig that was made about the frame follow; called by Blender when the distance changes."""
    rig = rig_of(context)
    if rig is not None:
        set_distance(rig, settings.distance, context.scene)


def twin_chosen(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Show the twin that was chosen in the place of the one before; called by Blender when it changes."""
    new, old = settings.twin, settings.twin_before
    if new is not None and new != old:
        hide_twin(old)
        show_twin(new, context.view_layer)
        settings.twin_before = new
    recolour_afresh(settings, context)


def hide_twin(collection: bpy.types.Collection | None) -> None:
    """Hide a twin with all that belongs to it; not from who is editing it."""
    if collection is not None and all(obj.mode == "OBJECT" for obj in collection.all_objects):
        visibility.hide_all(collection)


def show_twin(collection: bpy.types.Collection, layer: bpy.types.ViewLayer) -> None:
    """Show a twin with all that belongs to it, also where its collection is hidden."""
    visibility.show_all(collection, layer)


def make_way(context: bpy.types.Context, plan: bpy.types.Object, keep_twin: bool = False) -> str:
    """Hide the print and the twin of the plan before; returns what there is to say of what stays in view."""
    before, real, twin = plan_of(context), print_of(context), twin_of(context)
    if real is not None and is_made_print(real):
        hide(real)
    if not keep_twin:
        hide_twin(twin)
    stays = [obj for obj, ours in ((before, is_added_plan), (real, is_made_print)) if obj is not None and not ours(obj)]
    names = sorted({obj.name for obj in stays if obj != plan and obj.visible_get()})
    return f"; {enumerated(names)}, of your own, stays in view" if names else ""


def hide_boxes_around(context: bpy.types.Context, plan: bpy.types.Object) -> list[str]:
    """Hide boxes in which all of a plan would be out of sight, as the cube of the start-up file; their names."""
    context.view_layer.update()
    low, high = _bounds(plan)
    hidden = []
    for obj in context.view_layer.objects:
        if obj.type != "MESH" or len(obj.data.vertices) > BOX or obj.mode != "OBJECT" or not obj.visible_get():
            continue
        outer_low, outer_high = _bounds(obj)
        if len(obj.data.polygons) and (outer_low < low).all() and (high < outer_high).all():
            visibility.hide(obj)
            hidden.append(obj.name)
    return sorted(hidden)


def _bounds(obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    matrix = np.array(obj.matrix_world)
    corners = np.array(obj.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
    return corners.min(axis=0), corners.max(axis=0)


def twin_shows(context: bpy.types.Context, frame: Wireframe) -> bool:
    """Whether the twin that is looked at is one of this very frame."""
    twin = twin_of(context)
    if twin is None:
        return False
    try:
        plan = find_twin(twin).plan()
    except InputError:
        return False
    return np.array_equal(plan.control_points, frame.control_points)
