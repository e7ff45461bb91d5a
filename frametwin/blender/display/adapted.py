"""Struts that are still to be printed, before and after they were moved to meet the twin."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from frametwin.blender.display.colours import paint
from frametwin.blender.display.twins import ghost
from frametwin.blender.frames.curves import wireframe_to_curve_steps
from frametwin.blender.scene.collections import new_collection, remove_collection
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

ROLE = "frametwin_adapted"
"""Custom property of the collection, and with ``before`` or ``after`` of its objects."""

ADAPTED_COLOUR = (0.1, 0.6, 0.2)


@dataclass(frozen=True, eq=False)
class AdaptedObjects:
    """The curves before and after, in a collection of their own."""

    collection: bpy.types.Collection
    before: bpy.types.Object
    after: bpy.types.Object


def show_adapted_steps(
    frame: Wireframe, answer: dict[str, Any], parent: bpy.types.Collection, scene: bpy.types.Scene | None = None
) -> Generator[None, None, AdaptedObjects]:
    """Show what the worker's job ``adapt`` answered: unprinted struts as planned (lines) and as they shall be printed.

    Parameters
    ----------
    frame
        The plan.
    answer
        Of the job.
    parent
        The collection in which to make another one; an earlier one of this kind is replaced.

    Raises
    ------
    InputError
        If everything is printed, so that there is nothing to adapt.
    """
    struts = np.asarray(answer["struts"], dtype=np.int64)
    if not len(struts):
        remedy = "fit a capture in which struts are still to be printed (Deform > Printed)"
        raise InputError.at(frame.name, "printed", "all struts are printed, so there is nothing to adapt", remedy)
    mask = np.zeros(frame.strut_count, dtype=bool)
    mask[struts] = True
    before, _ = frame.subset(mask)
    whole = np.array(frame.control_points)
    whole[struts] = answer["after"]
    vertices = np.array(answer["vertices"])
    vertices[frame.edges[struts]] = whole[struts][:, [0, 3]]
    after, _ = frame.replace(control_points=_closed(whole, vertices, frame), vertices=vertices).subset(mask)
    collection = new_collection(f"{frame.name} still to print", scene, parent)
    collection[ROLE] = True
    try:
        plan = yield from wireframe_to_curve_steps(
            before, name=f"{frame.name} planned", collection=collection, scene=scene, strut=struts
        )
        ghost(plan)
        plan[ROLE] = "before"
        obj = yield from wireframe_to_curve_steps(
            after, name=f"{frame.name} adapted", collection=collection, scene=scene, strut=struts
        )
        obj[ROLE] = "after"
        paint(obj, "FrameTwin adapted", ADAPTED_COLOUR)
    except BaseException:
        remove_collection(collection)
        raise
    for old in [child for child in parent.children if ROLE in child and child != collection]:
        remove_collection(old)
    return AdaptedObjects(collection, plan, obj)


def find_adapted(parent: bpy.types.Collection) -> AdaptedObjects | None:
    """What `show_adapted_steps` has shown in a collection; ``None`` if nothing, or the user deleted it."""
    for child in parent.children:
        roles = {obj.get(ROLE): obj for obj in child.objects}
        if ROLE in child and {"before", "after"} <= roles.keys():
            return AdaptedObjects(child, roles["before"], roles["after"])
    return None


def _closed(curves: np.ndarray, vertices: np.ndarray, frame: Wireframe) -> np.ndarray:
    """The curves with ends on the vertices, bit for bit."""
    closed = np.array(curves)
    closed[:, 0], closed[:, 3] = vertices[frame.edges[:, 0]], vertices[frame.edges[:, 1]]
    return closed
