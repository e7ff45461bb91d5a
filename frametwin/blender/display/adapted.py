"""Struts that are still to be printed, before and after they were moved to meet the twin."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from frametwin.blender.display.colours import State
from frametwin.blender.display.job_struts import show_struts_steps
from frametwin.blender.scene.collections import new_collection, remove_collection
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

ROLE = "frametwin_adapted"
"""Custom property of the collection and of its object."""


@dataclass(frozen=True, eq=False)
class AdaptedObjects:
    """The struts as they shall be printed, with those of the plan as a ghost, in a collection of their own."""

    collection: bpy.types.Collection
    struts: bpy.types.Object


def show_adapted_steps(
    frame: Wireframe, answer: dict[str, Any], parent: bpy.types.Collection, scene: bpy.types.Scene | None = None
) -> Generator[None, None, AdaptedObjects]:
    """Show what the worker's job ``adapt`` answered: unprinted struts as they shall be printed, as planned for a ghost.

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
        obj = yield from show_struts_steps(
            after, before, State.ADAPTED, f"{frame.name} adapted", collection, scene, strut=struts, ghost=True
        )
        obj[ROLE] = "adapted"
    except BaseException:
        remove_collection(collection)
        raise
    for old in [child for child in parent.children if ROLE in child and child != collection]:
        remove_collection(old)
    return AdaptedObjects(collection, obj)


def find_adapted(parent: bpy.types.Collection) -> AdaptedObjects | None:
    """What `show_adapted_steps` has shown in a collection; ``None`` if nothing, or the user deleted it."""
    for child in parent.children:
        obj = next((obj for obj in child.objects if ROLE in obj), None)
        if ROLE in child and obj is not None:
            return AdaptedObjects(child, obj)
    return None


def _closed(curves: np.ndarray, vertices: np.ndarray, frame: Wireframe) -> np.ndarray:
    """The curves with ends on the vertices, bit for bit."""
    closed = np.array(curves)
    closed[:, 0], closed[:, 3] = vertices[frame.edges[:, 0]], vertices[frame.edges[:, 1]]
    return closed
