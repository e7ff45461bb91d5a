"""Struts of one state shown as Curves: what stands, what comes next, what fell."""

from __future__ import annotations

from collections.abc import Generator, Mapping

import bpy
import numpy as np

from frametwin.blender.display.colours import State
from frametwin.blender.display.display_group import add_display
from frametwin.blender.display.display_inputs import GHOST, SIDES, sides_for
from frametwin.blender.display.point_values import strut_attributes
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.frames.strut_curves import PIECES, Attribute, Sampling, StrutCurves, strut_curves_steps
from frametwin.blender.scene.units import mm_per_unit
from frametwin.geometry.wireframe import Wireframe


def show_struts_steps(
    frame: Wireframe,
    plan: Wireframe,
    state: State,
    name: str,
    collection: bpy.types.Collection,
    scene: bpy.types.Scene | None = None,
    *,
    strut: np.ndarray,
    values: Mapping[str, StrutValues] | None = None,
    ghost: bool = False,
) -> Generator[None, None, bpy.types.Object]:
    """Show struts of one state by the display.

    Parameters
    ----------
    frame, plan
        The struts, and where they should be.
    state
        What they are.
    name
        Of the object.
    collection, scene
        Where to link it, and whose unit scale holds; the current one by default.
    strut
        (E,) numbers of the struts in the whole frame.
    values
        Quantities of these struts, for attributes.
    ghost
        Whether to draw the plan too.
    """
    scene = bpy.context.scene if scene is None else scene
    sampling = Sampling.of(np.full(frame.strut_count, PIECES))
    attributes = {
        "state": Attribute("INT", np.full(frame.strut_count, state), "CURVE"),
        **strut_attributes(values or {}),
    }
    content = StrutCurves(frame, plan, sampling, attributes, strut)
    obj = yield from strut_curves_steps(content, name, collection, mm_per_unit(scene))
    add_display(obj, **{GHOST: ghost, SIDES: sides_for(frame.strut_count)})
    return obj
