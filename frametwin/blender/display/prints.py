"""The real print in a scene: the plan's struts as they sagged, and which of them are there."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import bpy
import idprop
import numpy as np

from frametwin.blender.frames.curves import wireframe_to_curve, wireframe_to_curve_steps
from frametwin.blender.frames.described import describe_print
from frametwin.blender.frames.plans import plan_and_deformed, plan_from_object
from frametwin.blender.scene.collections import PRINTS, home_collection, remove_empty_homes
from frametwin.blender.scene.placement import label
from frametwin.capture.capture_checks import check_truth
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

KEY = "frametwin_present"
PRINT_COLOUR = (0.85, 0.4, 0.1)
HOW_MUCH = ("all", "share", "batch", "height")


@dataclass(frozen=True, eq=False)
class ScenePrint:
    """A print: the plan with what is printed, the real geometry, and (E, 2) where each strut is there."""

    plan: Wireframe
    truth: Wireframe
    present: np.ndarray


def partly_printed(frame: Wireframe, how: str, value: float = 1.0) -> Wireframe:
    """Mark what has been printed of a plan.

    Parameters
    ----------
    frame
        The plan.
    how
        ``"all"``; ``"batch"``: batches up to ``value``; ``"height"``: struts whose both ends are not more than
        ``value`` mm above the lowest joint. (``"share"`` is the worker's: `frametwin.simulation.print_order`.)

    Raises
    ------
    InputError
        If nothing would be printed, or the way is not known.
    """
    if how == "batch":
        printed = frame.batch <= value
    elif how == "height":
        top = frame.vertices[frame.edges, 2].max(axis=1)
        printed = top <= frame.vertices[frame.edges, 2].min() + value + 1e-9 * frame.extent
    elif how == "all":
        printed = np.ones(frame.strut_count, dtype=bool)
    else:
        raise InputError.at(frame.name, "printed", f"{how!r} is not known", f"give one of {', '.join(HOW_MUCH)}")
    if not printed.any():
        raise InputError.at(frame.name, "printed", f"no strut is printed up to {how} {value:g}", "give a higher one")
    return frame.replace(printed=printed)


def show_print_steps(
    plan: Wireframe,
    simulated: dict[str, Any],
    scene: bpy.types.Scene | None = None,
) -> Generator[None, None, bpy.types.Object]:
    """Put what the worker's job ``simulate`` answered into the scene, as a curve object beside the plan.

    Unprinted struts are left out of the drawing; the object knows the whole frame.
    """
    printed = np.asarray(simulated["printed_struts"], dtype=bool)
    truth = plan.replace(
        control_points=np.asarray(simulated["control_points"]),
        vertices=np.asarray(simulated["vertices"]),
        printed=printed,
    )
    scene = bpy.context.scene if scene is None else scene
    collection = home_collection(scene, PRINTS)
    try:
        obj = yield from wireframe_to_curve_steps(truth, name=f"{plan.name} print", collection=collection, scene=scene)
    except BaseException:
        remove_empty_homes()
        raise
    present = np.asarray(simulated["present"])
    _mark(obj, present)
    describe_print(obj, truth, plan, present, scene)
    return obj


def copy_to_bend(plan_object: bpy.types.Object, scene: bpy.types.Scene | None = None) -> bpy.types.Object:
    """A copy of the plan as a curve object for the user to bend by hand or with modifiers.

    Raises
    ------
    InputError
        See `plan_from_object`.
    """
    plan = plan_from_object(plan_object, scene=scene)
    scene = bpy.context.scene if scene is None else scene
    collection = home_collection(scene, PRINTS)
    obj = wireframe_to_curve(plan, name=f"{plan.name} print", collection=collection, scene=scene)
    present = _everywhere(np.ones(plan.strut_count))
    _mark(obj, present)
    describe_print(obj, plan, plan, present, scene)
    return obj


def is_made_print(obj: bpy.types.Object) -> bool:
    """Whether an object was made by `show_print_steps` or `copy_to_bend`, and not drawn by the user."""
    return KEY in obj


def _mark(obj: bpy.types.Object, present: np.ndarray) -> None:
    obj[KEY] = np.ascontiguousarray(present, dtype=np.float64).ravel()
    paint(obj, "FrameTwin print", PRINT_COLOUR)


def read_print(
    plan_object: bpy.types.Object, print_object: bpy.types.Object | None, scene: bpy.types.Scene | None = None
) -> ScenePrint:
    """The print that an object shows.

    Parameters
    ----------
    plan_object
        The plan, whose modifiers count for nothing unless it is the print as well.
    print_object
        The same struts bent: made by `show_print_steps` or `copy_to_bend` (and bent further by hand or modifiers), or
        ``None`` or the plan itself, for the plan as its modifiers and shape keys bend it.

    Raises
    ------
    InputError
        If one cannot be read, or they are not of the same struts.
    """
    if print_object is None or print_object == plan_object:
        plan, truth = plan_and_deformed(plan_object, scene=scene)
        return ScenePrint(plan, truth, _everywhere(plan.printed))
    plan = plan_from_object(plan_object, scene=scene)
    truth = plan_from_object(print_object, evaluated=True, scene=scene)
    check_truth(truth, plan, label(print_object))
    plan, truth = plan.replace(printed=truth.printed), truth.replace(radius=plan.radius, grounded=plan.grounded)
    kept = print_object.get(KEY)
    if isinstance(kept, idprop.types.IDPropertyArray) and len(kept) == 2 * plan.strut_count:
        return ScenePrint(plan, truth, np.array(kept, dtype=np.float64).reshape(-1, 2))
    return ScenePrint(plan, truth, _everywhere(plan.printed))


def _everywhere(printed: np.ndarray) -> np.ndarray:
    return np.stack([np.zeros(len(printed)), printed.astype(np.float64)], axis=1)


def paint(obj: bpy.types.Object, name: str, colour: tuple[float, float, float]) -> None:
    """Give a curve object one plain material, shared by all that were painted under this name."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 1.0)
    obj.data.materials.clear()
    obj.data.materials.append(material)
