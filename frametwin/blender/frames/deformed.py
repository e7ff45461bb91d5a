"""Where modifiers, shape keys and parents put the segments of a curve object.

Blender bends a curve in one of two ways. Hooks, soft bodies and modifiers with *Apply on Spline* move the
control points; the bent curve is again a cubic and is read exactly. All others, and a parent that deforms, move
the points of the finished line; what is seen is then no cubic, and the one nearest to it is read: the line is
evaluated at even parameters and refitted with its ends fixed (paper, Eq. 6-8).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from frametwin.blender.frames.described import only_describes, take_description
from frametwin.blender.frames.splines import Splines, read_splines
from frametwin.blender.scene.placement import current_depsgraph, evaluated_object, label
from frametwin.errors import InputError
from frametwin.geometry import bezier

SAMPLES = 16
"""Pieces of each segment of the line that is refitted."""

_ALWAYS_ON_SPLINES = ("HOOK", "SOFT_BODY")
_DEFORMING = (
    *_ALWAYS_ON_SPLINES,
    "ARMATURE",
    "CAST",
    "CURVE",
    "LATTICE",
    "MESH_DEFORM",
    "SHRINKWRAP",
    "SIMPLE_DEFORM",
    "SMOOTH",
    "WARP",
    "WAVE",
)


def rest_splines(obj: bpy.types.Object) -> Splines:
    """The splines as drawn, without modifiers; of a curve with shape keys, the basis.

    What is being changed in Edit Mode must have been written to the data.

    Raises
    ------
    InputError
        See `read_splines`.
    """
    splines = read_splines(obj.data, label(obj))
    keys = obj.data.shape_keys
    if keys is not None and len(keys.reference_key.data) == len(splines.points):
        for i, point in enumerate(keys.reference_key.data):
            splines.radius[i] = point.radius
            if _has_handles(point):
                splines.points[i] = point.handle_left, point.co, point.handle_right
            else:
                splines.points[i] = point.co
    return splines


def _has_handles(point: bpy.types.bpy_struct) -> bool:
    """Whether a point of a shape key belongs to a Bezier spline."""
    return isinstance(point, bpy.types.ShapeKeyBezierPoint)


def deformed_control_points(
    obj: bpy.types.Object, rest: Splines, depsgraph: bpy.types.Depsgraph | None = None
) -> np.ndarray:
    """Control points (N, 4, 3) of every segment of the evaluated object, in the object's own coordinates.

    Parameters
    ----------
    obj
        A curve object.
    rest
        Its splines at rest.
    depsgraph
        An up-to-date dependency graph; the current one by default.

    Raises
    ------
    InputError
        If the object is not evaluated, or a modifier adds or removes struts.
    """
    graph = current_depsgraph(obj) if depsgraph is None else depsgraph
    evaluated_object(obj, graph)
    if not _moves_finished_line(obj, graph):
        try:
            return read_splines(obj.to_curve(graph, apply_modifiers=True), label(obj)).control_points
        finally:
            obj.to_curve_clear()
    with _bare_copy(obj, graph) as (bare, bare_graph):
        evaluated = evaluated_object(bare, bare_graph)
        try:
            return _refitted(_line_points(evaluated.to_mesh()), rest, label(obj))
        finally:
            evaluated.to_mesh_clear()


def _moves_finished_line(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether anything acts on the line rather than on its control points, where `to_curve` would not see it.

    Blender applies to the control points every modifier up to the last one that asks for it, parents that deform
    first. In Edit Mode `to_curve` leaves out modifiers that are not shown there.
    """
    attribute = "show_render" if depsgraph.mode == "RENDER" else "show_viewport"
    modifiers = [each for each in obj.modifiers if getattr(each, attribute) and not only_describes(each)]
    bends = obj.parent is not None and obj.parent_type in ("ARMATURE", "LATTICE")
    if not modifiers:
        return bends
    last = modifiers[-1]
    on_splines = last.use_apply_on_spline or last.type in _ALWAYS_ON_SPLINES
    return obj.mode == "EDIT" or not on_splines or any(modifier.type not in _DEFORMING for modifier in modifiers)


@contextmanager
def _bare_copy(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> Iterator[tuple[bpy.types.Object, bpy.types.Depsgraph]]:
    """A copy of the object without thickness, evaluated, for the time of the context.

    Its line is that of the object; the thickness of the object itself would hide it. It is evaluated as in the
    viewport.
    """
    data, bare = obj.data.copy(), obj.copy()
    try:
        bare.data = data
        bare.hide_viewport = bare.hide_render = False
        take_description(bare)
        _thin(data)
        depsgraph.scene.collection.objects.link(bare)
        yield bare, current_depsgraph(bare, depsgraph.scene)
    finally:
        bpy.data.objects.remove(bare)
        bpy.data.curves.remove(data)


def _thin(curve: bpy.types.Curve) -> None:
    """Take the thickness from a curve, and draw each segment in `SAMPLES` pieces."""
    curve.animation_data_clear()
    curve.bevel_mode = "ROUND"
    curve.bevel_depth = curve.extrude = curve.offset = 0.0
    curve.bevel_factor_start, curve.bevel_factor_end = 0.0, 1.0
    curve.render_resolution_u = 0
    for spline in curve.splines:
        spline.resolution_u = SAMPLES
        if spline.type == "BEZIER":
            _free_vectors(spline.bezier_points)


def _free_vectors(points: bpy.types.bpy_prop_collection) -> None:
    """Make handles of the type *vector* free, where they are: between two of them Blender draws a single piece."""
    for name in ("handle_left_type", "handle_right_type"):
        for point in points:
            if getattr(point, name) == "VECTOR":
                setattr(point, name, "FREE")


def _line_points(mesh: bpy.types.Mesh) -> np.ndarray:
    """Vertices (L, 3) of the evaluated line."""
    found = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", found)
    return found.reshape(-1, 3).astype(np.float64)


def _piece_counts(rest: Splines, found: int, source: str) -> np.ndarray:
    """(S,) vertices that Blender draws each spline with, at `SAMPLES` pieces a segment; ``found`` in all."""
    is_open = (~rest.is_cyclic).astype(np.int64)
    counts = np.where(rest.is_bezier, SAMPLES * (rest.counts - is_open) + is_open, rest.counts)
    for lone in (0, 1):  # splines of a single point are drawn or not, as the modifiers go
        counts[rest.counts == 1] = lone
        if found == counts.sum():
            return counts
    raise InputError.at(
        source,
        "modifiers",
        f"they make {found} points of the {int(counts.sum())} on its struts",
        "apply or disable those that add or remove geometry, such as Array, Mirror or Build",
    )


def _refitted(line: np.ndarray, rest: Splines, source: str) -> np.ndarray:
    """Cubics (N, 4, 3) along the evaluated line (L, 3)."""
    start, end, spline = rest.segments
    counts = _piece_counts(rest, len(line), source)
    pieces = np.where(rest.is_bezier, SAMPLES, 1)[spline]  # (N,)
    first_point, first_vertex = np.cumsum(rest.counts) - rest.counts, np.cumsum(counts) - counts
    begin = first_vertex[spline] + pieces * (start - first_point[spline])
    finish = first_vertex[spline] + pieces * (end - first_point[spline])
    curves = bezier.straight(line[begin], line[finish])
    curved = rest.is_bezier[spline]
    inside = begin[curved, None] + np.arange(1, SAMPLES)
    samples = np.concatenate([begin[curved, None], inside, finish[curved, None]], axis=1)  # (B, SAMPLES + 1)
    curves[curved] = bezier.refit_matrix(SAMPLES) @ line[samples]
    return curves
