"""An arrow at a camera of the rig that is dragged to bring all of them nearer to the frame, or further from it."""

# No postponed annotations here: Blender reads them as properties.
from typing import ClassVar

import bpy
import mathutils

from frametwin.blender.views.rig_distance import distance_of, handle_of

from .steps import rig_of, settings_of

COLOUR = (0.0, 0.6, 1.0)
LENGTH = 0.8
"""Of the arrow, in what Blender takes for the size of a gizmo."""

TWEAK = "GIZMOGROUP_OT_gizmo_tweak"
"""What Blender runs while a gizmo is dragged."""

LOOK = 0.05
"""Seconds between two looks whether it still is."""


def camera_with_arrow(context: bpy.types.Context) -> bpy.types.Object | None:
    """The camera at which the arrow stands: of the rig that is selected, active or the active collection."""
    rig = rig_of(context)
    if distance_of(rig) is None:
        return None
    cameras = [obj for obj in rig.all_objects if obj.type == "CAMERA" and obj.visible_get()]
    active, collection = context.view_layer.objects.active, context.view_layer.active_layer_collection.collection
    chosen = [obj for obj in cameras if obj == active and obj.select_get()] or [
        obj for obj in cameras if obj.select_get()
    ]
    if not chosen and (collection == rig or active in cameras):
        chosen = [obj for obj in cameras if obj in (active, context.scene.camera)] or cameras
    return chosen[0] if chosen else None


class FRAMETWIN_GGT_rig_distance(bpy.types.GizmoGroup):
    """The distance of the rig, in the view"""

    bl_idname = "FRAMETWIN_GGT_rig_distance"
    bl_label = "FrameTwin rig distance"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options: ClassVar = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        view = context.space_data.region_3d
        return view.view_perspective != "CAMERA" and camera_with_arrow(context) is not None

    def setup(self, context: bpy.types.Context) -> None:
        arrow = self.gizmos.new("GIZMO_GT_arrow_3d")
        arrow.target_set_handler("offset", get=_offset, set=_set_offset)
        arrow.draw_style = "BOX"
        arrow.length = LENGTH
        arrow.color, arrow.alpha = COLOUR, 0.8
        arrow.color_highlight, arrow.alpha_highlight = (1.0, 1.0, 1.0), 1.0
        self.arrow = arrow
        self.draw_prepare(context)

    def draw_prepare(self, context: bpy.types.Context) -> None:
        obj = camera_with_arrow(context)
        handle = None if obj is None else handle_of(obj, context.scene)
        self.arrow.hide = handle is None
        if handle is not None:
            self.arrow.matrix_basis = mathutils.Matrix(handle[0].tolist())


def _reach() -> float:
    """Blender units along the arrow that a distance of 1 is."""
    context = bpy.context
    obj = camera_with_arrow(context)
    handle = None if obj is None else handle_of(obj, context.scene)
    return 1.0 if handle is None else handle[1]


def _offset() -> float:
    return float(distance_of(rig_of(bpy.context)) or 1.0) * _reach()


def _set_offset(value: float) -> None:
    """Set the panel's distance, which moves the rig; when the arrow is let go, that is a step of undo."""
    cameras = settings_of(bpy.context).cameras
    if not bpy.app.timers.is_registered(_when_let_go):
        _begun.append(cameras.distance)
        bpy.app.timers.register(_when_let_go, first_interval=LOOK)
    cameras.distance = value / _reach()


_begun: list[float] = []
"""The distance at which dragging began."""


def _when_let_go() -> float | None:
    """Remember the distance for undo: Blender does so for what its own arrows move, not for what handlers set."""
    window = bpy.context.window_manager.windows[0]
    for each in bpy.context.window_manager.windows:
        if any(operator.bl_idname == TWEAK for operator in each.modal_operators):
            return LOOK
    changed = _begun.pop() != settings_of(window).cameras.distance  # not by a drag that was cancelled
    if changed:
        with bpy.context.temp_override(window=window):
            bpy.ops.ed.undo_push(message="FrameTwin: Rig Distance")
    return None


CLASSES = (FRAMETWIN_GGT_rig_distance,)
