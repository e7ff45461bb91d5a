"""A wireframe as a Blender curve object, one Bezier spline a strut, and back, also after the user has bent it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from frametwin.arrays import checked_array
from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.frames.curve_reading import read_curve
from frametwin.blender.frames.joints import Reading
from frametwin.blender.frames.records import FrameRecord, load_record, store_record
from frametwin.blender.frames.splines import add_struts, has_struts, set_struts
from frametwin.blender.scene.placement import Placement, label
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

BEVEL_RESOLUTION = 2  # Blender draws 4 sides and 2 for each step
CURVE_RESOLUTION = 8  # pieces of a strut that are drawn
STRUTS_A_STEP = 250  # about two milliseconds


def wireframe_to_curve(
    frame: Wireframe,
    *,
    name: str | None = None,
    collection: bpy.types.Collection | None = None,
    scene: bpy.types.Scene | None = None,
    strut: Any = None,
) -> bpy.types.Object:
    """Make a curve object of a frame.

    Parameters
    ----------
    frame
        The frame, mm.
    name
        Of the object; the frame's by default. Blender may add a number.
    collection
        Where to link it; the scene's own collection by default.
    scene
        Whose unit scale holds; the current one by default.
    strut
        (E,) the number of each strut in the frame that ``frame`` was taken out of; 0, 1, 2 ... by default.

    Returns
    -------
    An object at the origin. Each strut is a Bezier spline of two points with free handles, thick by the bevel: the
    bevel depth is the median radius, and the radius of the points the strut's share of it. What splines have no
    place for is kept in custom properties of the curve data (`FrameRecord`).

    Raises
    ------
    InputError
        If ``strut`` has another length.
    """
    return run_steps(wireframe_to_curve_steps(frame, name=name, collection=collection, scene=scene, strut=strut))


def wireframe_to_curve_steps(
    frame: Wireframe,
    *,
    name: str | None = None,
    collection: bpy.types.Collection | None = None,
    scene: bpy.types.Scene | None = None,
    strut: Any = None,
) -> Generator[None, None, bpy.types.Object]:
    """Do as `wireframe_to_curve` in steps of a few milliseconds; if they are not gone on with, nothing is left."""
    scene = bpy.context.scene if scene is None else scene
    unit = mm_per_unit(scene)
    record = FrameRecord.of(frame, unit, strut)
    curve = bpy.data.curves.new(name or frame.name, "CURVE")
    try:
        curve.dimensions = "3D"
        curve.bevel_mode = "ROUND"
        curve.bevel_depth = record.bevel_depth
        curve.bevel_resolution = BEVEL_RESOLUTION
        curve.resolution_u = CURVE_RESOLUTION
        curve.use_fill_caps = True
        points, factors = record.control_points / unit, record.rounded_factors()
        for first in range(0, len(points), STRUTS_A_STEP):
            part = slice(first, first + STRUTS_A_STEP)
            add_struts(curve, points[part], factors[part])
            yield
        store_record(curve, record)
    except BaseException:
        bpy.data.curves.remove(curve)
        raise
    obj = bpy.data.objects.new(name or frame.name, curve)
    (scene.collection if collection is None else collection).objects.link(obj)
    return obj


def update_curve(
    obj: bpy.types.Object, control_points: Any, *, radius: Any = None, scene: bpy.types.Scene | None = None
) -> None:
    """Move the struts of a curve object made by `wireframe_to_curve`, quickly enough for an animation.

    Parameters
    ----------
    obj
        The object; its own position, rotation and scale are allowed for.
    control_points
        (E, 4, 3) mm, world, ends of struts that share a joint at the same place.
    radius
        (E,) mm; unchanged by default.
    scene
        Whose unit scale holds; see `scene_of`.

    Raises
    ------
    InputError
        If the object is not such a curve (any more), has shape keys, or the arrays do not fit it.
    """
    where = label(obj)
    record = _unedited_record(obj)
    count = len(record.edges)
    world = checked_array(control_points, "f", (count, 4, 3), where, "control_points")
    place = Placement.quickly(obj, scene)
    place.refuse_flat(where)
    points = place.to_object(world)  # (E, 4, 3) mm
    vertices = record.vertices * (place.unit / record.mm_per_unit)
    vertices[record.edges] = points[:, [0, 3]]
    radii = record.radius * (place.unit / record.mm_per_unit)
    if radius is not None:
        radii = checked_array(radius, "f", (count,), where, "radius") / place.scale
        obj.data.bevel_depth = record.bevel_depth  # the user may have changed it
    moved = replace(record, mm_per_unit=place.unit, vertices=vertices, control_points=points, radius=radii)
    set_struts(obj.data, points / place.unit, None if radius is None else moved.rounded_factors())
    store_record(obj.data, moved)
    obj.data.update_tag()


def _unedited_record(obj: bpy.types.Object) -> FrameRecord:
    where = label(obj)
    if obj.type != "CURVE":
        raise InputError.at(where, "type", f"is {obj.type}, not a curve", "give the curve object of a frame")
    record = load_record(obj.data, where)
    if record is None or not has_struts(obj.data, len(record.edges)):
        raise InputError.at(
            where, "splines", "are not those of a frame, one a strut", "make the curve object of the frame again"
        )
    if obj.data.shape_keys is not None:
        raise InputError.at(where, "shape keys", "hide every change of its splines", "remove them")
    return record


def wireframe_from_curve(
    obj: bpy.types.Object,
    *,
    evaluated: bool = True,
    depsgraph: bpy.types.Depsgraph | None = None,
    reading: Reading | None = None,
) -> Wireframe:
    """Read a frame from a curve object.

    Parameters
    ----------
    obj
        A curve object: made by `wireframe_to_curve`, or any with Bezier or polygon splines, whose segments are then
        the struts.
    evaluated
        Whether modifiers, shape keys and parents that deform count; what the user changed in Edit Mode always does.
    depsgraph
        An up-to-date dependency graph; the current one by default.
    reading
        Tolerance of joints, radius where there is none, what to do about joints that were pulled open.

    Returns
    -------
    Mm, world. Of an object made by `wireframe_to_curve`: struts, vertices and all properties in the order of that
    frame, coordinates that were not touched to the last digit. If struts were deleted or added, the object is read
    as it is drawn; struts that are still in their place keep what is known of them, the others are taken to be
    printed. The radius of a strut is the mean of its two points', at rest.

    Raises
    ------
    InputError
        If the object is no curve or has no struts, struts were pulled apart at a joint (unless ``reading.split``), a
        modifier pulls them apart, or `Wireframe` refuses what is drawn.
    """
    drawing = read_curve(obj, reading, depsgraph=depsgraph)
    return drawing.deformed() if evaluated else drawing.plan()


def strut_numbers(obj: bpy.types.Object) -> np.ndarray:
    """Which strut of its frame each segment of a curve object is, also after others were deleted.

    Returns
    -------
    (N,) int64, one for each spline of a frame's curve, counted as ``strut`` of `wireframe_to_curve` says; -1 for
    what is not (or no longer to be told as) one of the frame's.

    Raises
    ------
    InputError
        If the object is not a curve, or holds splines that cannot be read.
    """
    return read_curve(obj, Reading(split=True)).strut_numbers()
