"""How deep the nozzle goes into struts at finely sampled poses, with nothing taken from the planner.

The tip is put at many points of its way, and the distance from the nozzle's surface to many points of every printed
strut is compared with that strut's radius; points that are sure to be free are passed over. What lies between two
samples is missed by at most half their distance.

Helpers and constants of the compiled loops are in this file too, and nowhere else: numba keeps machine code until the
file of the function that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py``
sees to it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from frametwin.geometry import bezier
from frametwin.printing.sequencing.nozzle import Nozzle

POSE_STEP = 0.5
"""Distance between poses of the nozzle along a strut, in strut radii."""

POINT_STEP = 0.25
"""Distance between points of the printed struts, in strut radii."""

JOINED = 1.05
"""Struts within this many sums of radii of each other are joined by design, as those that share a joint are."""


@dataclass(frozen=True, eq=False)
class SampledStruts:
    """Struts in the order in which they are laid, as closely spaced points along their centrelines.

    Attributes
    ----------
    first : (N + 1,) int64 array
        The points of strut k are ``points[first[k]:first[k + 1]]``, from its start to its end.
    points : (P, 3) array, mm
    step : (N,) array, mm
        Largest distance between neighbouring points of each strut.
    radius : (N,) array, mm
    edges : (N, 2) int64 array
        Joints of each strut.
    """

    first: np.ndarray
    points: np.ndarray
    step: np.ndarray
    radius: np.ndarray
    edges: np.ndarray

    @classmethod
    def build(cls, curves: np.ndarray, radius: np.ndarray, edges: np.ndarray) -> SampledStruts:
        """Sample struts in the order in which they are laid.

        Parameters
        ----------
        curves : (N, 4, 3) array, mm
            Control points, each from the strut's start to its end.
        radius : (N,) array, mm
        edges : (N, 2) int64 array
        """
        counts = np.maximum(8, np.ceil(bezier.arc_length(curves) / (POINT_STEP * radius))).astype(np.int64) + 1
        first = np.concatenate([[0], np.cumsum(counts)])
        pieces = [bezier.evaluate(c, np.linspace(0.0, 1.0, n)) for c, n in zip(curves, counts.tolist(), strict=True)]
        step = np.array([np.linalg.norm(np.diff(piece, axis=0), axis=1).max() for piece in pieces])
        return cls(first, np.concatenate(pieces), step, radius, edges)

    def joined(self, places: np.ndarray) -> np.ndarray:
        """Tell which struts the design joins: they share a joint, or nearly touch.

        Parameters
        ----------
        places : (M,) int64 array
            Struts by their place in the order.

        Returns
        -------
        (M, N) bool array
            A strut counts as joined to itself.
        """
        joined = places[:, None] == np.arange(len(self.radius))
        _mark_joined(places, self.edges, self.radius, self.first, self.step, self.points, joined)
        return joined


@dataclass(frozen=True, eq=False)
class ToolPoses:
    """Poses of the tool while struts are laid, and on the ways to and from them.

    Attributes
    ----------
    place : (M,) int64 array
        The struts that are laid, by their place in the order of `SampledStruts`: all before it are there.
    first : (M + 1,) int64 array
        Poses ``first[m]`` to ``first[m + 1]`` belong to strut ``place[m]``.
    tip, axis : (P, 3) array, mm
        Of the nozzle; ``axis`` is a unit vector from the tip upwards.
    laid : (P,) array
        Share of the strut that has been laid by then, 0 to 1.
    """

    place: np.ndarray
    first: np.ndarray
    tip: np.ndarray
    axis: np.ndarray
    laid: np.ndarray


def collision_depths(struts: SampledStruts, poses: ToolPoses, nozzle: Nozzle) -> np.ndarray:
    """Find how deep the nozzle, with its clearance, goes into each strut while others are laid.

    Parameters
    ----------
    struts
        In the order in which they are laid.
    poses
        Of the tool. Of the strut that is being laid, what lies behind the tip counts.
    nozzle
        Within its bead it may touch struts that are joined to the one that is being laid.

    Returns
    -------
    (M, N) array, mm
        For each strut that is laid, the greatest depth in each strut of the order; 0 where nothing is hit.
    """
    depth = np.zeros((len(poses.place), len(struts.radius)))
    scene = (struts.first, struts.step, struts.points, struts.radius, struts.joined(poses.place))
    tool = np.array([nozzle.bead, nozzle.clearance]), nozzle.profile
    _depths(poses.place, poses.first, poses.tip, poses.axis, poses.laid, scene, tool, depth)
    return depth


@nb.njit(cache=True, parallel=True)
def _mark_joined(places, edges, radius, first, step, points, joined):  # type: ignore[no-untyped-def]
    for row in nb.prange(len(places)):
        i = places[row]
        for j in range(len(edges)):
            for end in edges[j]:
                joined[row, j] |= end == edges[i, 0] or end == edges[i, 1]
            limit = JOINED * (radius[i] + radius[j])
            p = first[i]
            while p < first[i + 1] and not joined[row, j]:
                nearest = np.inf
                q = first[j]
                while q < first[j + 1]:
                    gap = np.sqrt(((points[p] - points[q]) ** 2).sum())
                    nearest = min(nearest, gap)
                    q += 1 + max(0, int((gap - max(limit, nearest)) / step[j]))
                joined[row, j] = nearest < limit
                p += 1 + max(0, int((nearest - limit) / step[i]))


@nb.njit(cache=True)
def _outside(rho: float, height: float, low: float, high: float, lower: float, upper: float) -> float:
    """Distance from a frustum; inside, the depth below its mantle or its ends, as a negative number."""
    if height < low:
        across = max(0.0, rho - lower)
        return np.sqrt(across**2 + (low - height) ** 2)
    slope = np.arctan2(upper - lower, high - low)
    along = (rho - lower) * np.sin(slope) + (height - low) * np.cos(slope)
    out = (rho - lower) * np.cos(slope) - (height - low) * np.sin(slope)
    length = (high - low) / np.cos(slope)
    if out <= 0.0:
        return max(out, max(low - height, height - high)) if height <= high else height - high
    if along < 0.0:
        return np.sqrt(out**2 + along**2)
    return np.sqrt(out**2 + max(0.0, along - length) ** 2)


@nb.njit(cache=True, parallel=True)
def _depths(place, first_pose, tips, axes, laid, scene, tool, depth):  # type: ignore[no-untyped-def]
    first, step, points, radius, joined = scene
    (bead, clearance), profile = tool
    for k in nb.prange(len(place)):
        n = place[k]
        for pose in range(first_pose[k], first_pose[k + 1]):
            tip, axis = tips[pose], axes[pose]
            for j in range(n + 1):
                last = first[j + 1]
                if j == n:  # only what has been laid of it
                    if laid[pose] <= 0.0:
                        continue
                    last = first[j] + np.int64(laid[pose] * (first[j + 1] - first[j] - 1)) + 1
                p = first[j]
                while p < last:
                    x, y, z = points[p, 0] - tip[0], points[p, 1] - tip[1], points[p, 2] - tip[2]
                    height = x * axis[0] + y * axis[1] + z * axis[2]
                    square = x * x + y * y + z * z
                    rho = np.sqrt(max(0.0, square - height * height))
                    gap = np.inf
                    for part in range(2):
                        low, high, lower, upper = profile[part]
                        gap = min(gap, _outside(rho, height, low, high, lower, upper))
                    air = gap - radius[j] - clearance
                    if air < 0.0 and not (joined[k, j] and square <= bead * bead):
                        depth[k, j] = max(depth[k, j], -air)
                    p += 1 + max(0, int(air / step[j]))  # the next points cannot be nearer than that
