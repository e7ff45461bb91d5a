"""The splines of legacy curve data-blocks as arrays: written and read without operators, thousands in a moment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from frametwin.errors import InputError
from frametwin.geometry import bezier

LEFT, POINT, RIGHT = range(3)
FREE = 0  # number of the handle type, as `foreach_set` wants it


@dataclass(frozen=True, eq=False)
class Splines:
    """The points of all splines of a curve, spline after spline, in the curve's own coordinates.

    Attributes
    ----------
    counts
        (S,) number of points of each spline.
    is_bezier
        (S,) bool; the others are polygons.
    is_cyclic
        (S,) bool.
    points
        (P, 3, 3) float32 left handle, point and right handle; all three alike in polygons.
    radius
        (P,) float32 factor of the bevel depth.
    """

    counts: np.ndarray
    is_bezier: np.ndarray
    is_cyclic: np.ndarray
    points: np.ndarray
    radius: np.ndarray

    @cached_property
    def segments(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First point, last point and spline of each segment, (N,) each; a cyclic spline closes with its last."""
        ends = np.cumsum(self.counts)
        spline = np.repeat(np.arange(len(self.counts)), self.counts)  # (P,)
        start = np.arange(len(spline))
        end = start + 1
        is_last = end == ends[spline]
        end[is_last] = (ends - self.counts)[spline[is_last]]
        keep = ~is_last | (self.is_cyclic & (self.counts > 1))[spline]
        return start[keep], end[keep], spline[keep]

    @property
    def control_points(self) -> np.ndarray:
        """(N, 4, 3) float32 cubic of each segment."""
        start, end, spline = self.segments
        p = self.points
        curves = np.stack([p[start, POINT], p[start, RIGHT], p[end, LEFT], p[end, POINT]], axis=1)
        straight = ~self.is_bezier[spline]
        curves[straight] = bezier.straight(curves[straight, 0], curves[straight, 3])
        return curves

    @property
    def segment_radius(self) -> np.ndarray:
        """(N,) mean radius factor of the two ends of each segment."""
        start, end, _ = self.segments
        return 0.5 * (self.radius[start].astype(np.float64) + self.radius[end])

    @property
    def are_struts(self) -> bool:
        """Whether every spline is a single open Bezier segment, as this project writes them."""
        return bool(np.all(self.is_bezier & ~self.is_cyclic & (self.counts == 2)))


def handles_of(control_points: np.ndarray) -> np.ndarray:
    """(E, 2, 3, 3) float32 left handle, point, right handle of both ends of each cubic (E, 4, 3).

    The outer handles carry the inner ones on beyond the ends, so that an end can be bent smoothly by hand.
    """
    a, b, c, d = np.moveaxis(control_points, 1, 0)
    return np.stack([2.0 * a - b, a, b, c, d, 2.0 * d - c], axis=1).reshape(-1, 2, 3, 3).astype(np.float32)


def add_struts(curve: bpy.types.Curve, control_points: np.ndarray, radius: np.ndarray) -> None:
    """Add a Bezier spline of two points with free handles for each strut.

    Parameters
    ----------
    curve
        The curve data-block.
    control_points
        (E, 4, 3) in the curve's coordinates.
    radius
        (E,) factor of the bevel depth.
    """
    handles = handles_of(control_points)
    columns = [np.ascontiguousarray(handles[:, :, k]).reshape(-1, 6) for k in (LEFT, POINT, RIGHT)]
    factors = np.repeat(np.asarray(radius, dtype=np.float32)[:, None], 2, axis=1)  # (E, 2)
    free = np.full(2, FREE, dtype=np.int32)
    new = curve.splines.new
    for left, point, right, factor in zip(*columns, factors, strict=True):
        points = new("BEZIER").bezier_points
        points.add(1)  # the first is there already
        points.foreach_set("handle_left_type", free)
        points.foreach_set("handle_right_type", free)
        points.foreach_set("co", point)
        points.foreach_set("handle_left", left)
        points.foreach_set("handle_right", right)
        points.foreach_set("radius", factor)


def set_struts(curve: bpy.types.Curve, control_points: np.ndarray, radius: np.ndarray | None = None) -> None:
    """Give splines made by `add_struts` other control points (E, 4, 3), and radius factors (E,) where given."""
    handles = handles_of(control_points)
    columns = [np.ascontiguousarray(handles[:, :, k]).reshape(-1, 6) for k in (LEFT, POINT, RIGHT)]
    for spline, left, point, right in zip(curve.splines, *columns, strict=True):
        points = spline.bezier_points
        points.foreach_set("co", point)
        points.foreach_set("handle_left", left)
        points.foreach_set("handle_right", right)
    if radius is not None:
        factors = np.repeat(np.asarray(radius, dtype=np.float32)[:, None], 2, axis=1)
        for spline, factor in zip(curve.splines, factors, strict=True):
            spline.bezier_points.foreach_set("radius", factor)


def has_struts(curve: bpy.types.Curve, count: int) -> bool:
    """Whether a curve has as many splines, each of two Bezier points: much quicker than reading it."""
    splines = curve.splines
    return len(splines) == count and all(len(spline.bezier_points) == 2 for spline in splines)


def read_splines(curve: bpy.types.Curve, source: str) -> Splines:
    """Read all splines.

    Parameters
    ----------
    curve
        The curve data-block.
    source
        What to call the object in messages.

    Raises
    ------
    InputError
        For NURBS splines: their points do not lie on the curve, so they say nothing about joints.
    """
    kinds = [spline.type for spline in curve.splines]
    for i, kind in enumerate(kinds):
        if kind not in ("BEZIER", "POLY"):
            raise InputError.at(
                source,
                f"splines[{i}]",
                f"is a {kind} spline, which has no points on the curve",
                "set the spline type to Bezier or Poly in Edit Mode (Curve > Set Spline Type)",
            )
    is_bezier = np.array([kind == "BEZIER" for kind in kinds], dtype=bool)
    handles = [
        spline.bezier_points if bezier_spline else spline.points
        for spline, bezier_spline in zip(curve.splines, is_bezier.tolist(), strict=True)
    ]
    counts = np.array([len(points) for points in handles], dtype=np.int64)
    total = int(counts.sum())
    columns = np.empty((3, 3 * total), dtype=np.float32)  # left, point, right
    radius = np.empty(total, dtype=np.float32)
    first = 0
    for points, count, bezier_spline in zip(handles, counts.tolist(), is_bezier.tolist(), strict=True):
        place, last = slice(3 * first, 3 * (first + count)), first + count
        if bezier_spline:
            points.foreach_get("handle_left", columns[LEFT, place])
            points.foreach_get("co", columns[POINT, place])
            points.foreach_get("handle_right", columns[RIGHT, place])
        else:
            homogeneous = np.empty(4 * count, dtype=np.float32)
            points.foreach_get("co", homogeneous)
            columns[:, place] = homogeneous.reshape(-1, 4)[:, :3].ravel()
        points.foreach_get("radius", radius[first:last])
        first = last
    return Splines(
        counts=counts,
        is_bezier=is_bezier,
        is_cyclic=np.array([spline.use_cyclic_u for spline in curve.splines], dtype=bool),
        points=np.ascontiguousarray(columns.reshape(3, total, 3).swapaxes(0, 1)),
        radius=radius,
    )
