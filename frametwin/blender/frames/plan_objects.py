"""Plans in a scene: put there, seen, summed up, and their culprits shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from frametwin.blender.frames.curves import wireframe_to_curve
from frametwin.blender.frames.described import describe_plan
from frametwin.blender.frames.plan_checks import PlanProblem, plan_problems, select_struts
from frametwin.blender.frames.plans import plan_from_object
from frametwin.blender.scene import visibility
from frametwin.blender.scene.collections import PLANS, home_collection
from frametwin.blender.scene.placement import label
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

KEY = "frametwin_plan"


def add_plan(frame: Wireframe, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """Put a frame into the scene as a curve object, selected and active."""
    scene = bpy.context.scene if scene is None else scene
    obj = wireframe_to_curve(frame, collection=home_collection(scene, PLANS), scene=scene)
    obj[KEY] = True
    describe_plan(obj, frame, scene)
    make_active(obj)
    return obj


def is_added_plan(obj: bpy.types.Object) -> bool:
    """Whether an object was made by `add_plan`, and not drawn by the user."""
    return KEY in obj


def make_active(obj: bpy.types.Object, select: bool = True) -> bool:
    """Show one object and make it active, in Object Mode; whether the present view layer has it.

    Nothing else stays selected, and it is not either without ``select``: the outline would hide its colours.
    """
    layer = bpy.context.view_layer
    layer.update()  # what was linked a moment ago is not in it yet
    if layer.objects.get(obj.name) != obj:
        return False
    active = layer.objects.active
    if active is not None and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    visibility.show(obj)  # a button of the panel, or a job, may have hidden it
    space = bpy.context.space_data
    if space is not None and space.type == "VIEW_3D" and space.local_view is not None:
        obj.local_view_set(space, True)
    for other in list(bpy.context.selected_objects):
        other.select_set(False)
    obj.select_set(select)
    layer.objects.active = obj
    return True


@dataclass(frozen=True)
class PlanSummary:
    """What there is to say of a plan: counts, size in mm, and what is wrong with it."""

    struts: int
    joints: int
    size: tuple[float, float, float]
    radius: float
    problems: tuple[PlanProblem, ...]

    @classmethod
    def of(cls, frame: Wireframe) -> PlanSummary:
        """Sum a frame up."""
        low, high = frame.bounds
        return cls(
            struts=frame.strut_count,
            joints=int((frame.degree > 0).sum()),
            size=(float(high[0] - low[0]), float(high[1] - low[1]), float(high[2] - low[2])),
            radius=float(np.median(frame.radius)),
            problems=plan_problems(frame),
        )


def plan_summary(obj: bpy.types.Object, scene: bpy.types.Scene | None = None) -> PlanSummary:
    """Read an object as a plan and sum it up.

    Raises
    ------
    InputError
        See `plan_from_object`.
    """
    return PlanSummary.of(plan_from_object(obj, scene=scene))


def show_struts(obj: bpy.types.Object, struts: Iterable[int]) -> int:
    """Select struts of a frame's curve object and go to Edit Mode, where they are seen; how many were found.

    Raises
    ------
    InputError
        See `select_struts`; if the object is linked from another file, or its collection is hidden.
    """
    wanted = list(struts)
    if not (obj.is_editable and obj.data.is_editable):
        raise InputError.at(label(obj), "object", "is linked from another file", "make it local (Object > Relations)")
    shown = make_active(obj)
    if shown and not obj.visible_get():
        raise InputError.at(label(obj), "collection", "is hidden", "show it in the outliner")
    count = select_struts(obj, wanted)
    if shown:
        bpy.ops.object.mode_set(mode="EDIT")
    return count


def points_of(obj: bpy.types.Object, chosen: bool = False) -> np.ndarray:
    """Where the points of a frame's curve object are, those of `show_struts` alone if ``chosen``: (N, 3), in units."""
    bpy.context.view_layer.update()  # what was made a moment ago has no place yet
    places = [
        point.co
        for spline in obj.data.splines
        for point in spline.bezier_points
        if not chosen or point.select_control_point
    ]
    matrix = np.array(obj.matrix_world)
    return np.array(places, dtype=np.float64).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def user_is_editing() -> bool:
    """Whether the user is in a mode of some object's own, such as Edit Mode, out of which no job may take them."""
    active = bpy.context.view_layer.objects.active
    return active is not None and active.mode != "OBJECT"


def use_millimetres(scene: bpy.types.Scene) -> None:
    """Make a Blender unit of the scene a millimetre, so that grid, clipping and views suit frames."""
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.scale_length = 0.001
    scene.unit_settings.length_unit = "MILLIMETERS"
