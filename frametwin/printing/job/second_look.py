"""A second opinion on collisions, by other geometry than the first: balls inside of the tool, and a tree of points.

The tool is filled with balls along its axis, each as large as fits, and the printed struts are points along their
centrelines. Of every ball the nearest point is looked up. As the balls lie inside of the tool, and the points on the
struts, whatever is found to touch does touch; what is a little larger than its balls, at the rims, is the first check's
matter. So both must fail before a collision goes unnoticed, and the least air between tool and print comes with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from frametwin.geometry import bezier
from frametwin.printing.sequencing.nozzle import Nozzle

POINT_STEP = 0.5
"""Distance between points of the printed struts, in strut radii."""

BALL_STEP = 0.5
"""Distance between balls in the tool, in radii of the ball."""

JOINED = 1.1
"""Struts within so many sums of radii of each other are joined by design."""

TOLERANCE = 1e-3
"""Depth up to which nothing counts as touched, in strut radii."""


@dataclass(frozen=True)
class Nearest:
    """What comes nearest to the tool while a strut is laid.

    Attributes
    ----------
    air : float, mm
        Between the tool and the surface of the other strut, the tool's clearance not taken off; below 0 where they
        run into each other. Infinite where nothing stands.
    strut : int
        The other one; -1 where nothing stands.
    """

    air: float = np.inf
    strut: int = -1


def tool_balls(nozzle: Nozzle) -> tuple[np.ndarray, np.ndarray]:
    """Balls along the tool's axis that lie within it.

    Returns
    -------
    height, radius : (B,) array, mm
        Of their centres above the tip, and their size.
    """
    heights, sizes = [], []
    top = nozzle.length
    for low, high, lower, upper in nozzle.profile:  # above the cone is the body, which is wider
        slope = np.arctan2(upper - lower, high - low)
        height = low
        while height < high:
            side = (lower + (height - low) * np.tan(slope)) * np.cos(slope)  # from the axis to the mantle
            radius = min(side, max(height - low, 0.0), top - height)
            if radius > 0.02 * side:
                heights.append(height)
                sizes.append(radius)
            height += max(BALL_STEP * radius, 0.1 * side)
    return np.array(heights), np.array(sizes)


class StandingPoints:
    """Points along struts that stand.

    Parameters
    ----------
    curves : (N, 4, 3) array, mm
    radius : (N,) array, mm
    numbers : (N,) array of int
        What the struts are called.
    """

    def __init__(self, curves: np.ndarray, radius: np.ndarray, numbers: np.ndarray) -> None:
        counts = np.maximum(4, np.ceil(bezier.arc_length(curves) / (POINT_STEP * radius))).astype(int) + 1
        parts = [
            bezier.evaluate(curve, np.linspace(0.0, 1.0, count))
            for curve, count in zip(curves, counts.tolist(), strict=True)
        ]
        self.points = np.concatenate(parts) if parts else np.zeros((0, 3))
        self.strut = np.repeat(np.arange(len(numbers)), counts) if parts else np.zeros(0, dtype=int)
        self.numbers, self.radius = np.asarray(numbers), np.asarray(radius)

    def gap_to(self, point: np.ndarray) -> np.ndarray:
        """(N,) array, mm: from a point (3,) to the surface of each strut; below 0 inside."""
        away = np.linalg.norm(self.points - point, axis=1)
        nearest = np.full(len(self.numbers), np.inf)
        np.minimum.at(nearest, self.strut, away)
        return nearest - self.radius

    def joined_to(self, curve: np.ndarray, radius: float, shared: np.ndarray) -> np.ndarray:
        """Struts that the design joins to another one: they share a joint with it, or run into it.

        Parameters
        ----------
        curve : (4, 3) array, mm
        radius : float, mm
        shared : (N,) bool array
            Those that share a joint.
        """
        if not len(self.points):
            return shared
        count = max(4, int(np.ceil(float(bezier.arc_length(curve[None])[0]) / (POINT_STEP * radius)))) + 1
        away, _ = cKDTree(bezier.evaluate(curve, np.linspace(0.0, 1.0, count))).query(self.points)
        nearest = np.full(len(self.numbers), np.inf)
        np.minimum.at(nearest, self.strut, away)
        return shared | (nearest < JOINED * (self.radius + radius))

    def nearest(self, tip: np.ndarray, axis: np.ndarray, nozzle: Nozzle, joined: np.ndarray) -> Nearest:
        """What comes nearest to the tool on its way.

        Parameters
        ----------
        tip, axis : (P, 3) array, mm
            Poses of the tool.
        nozzle : Nozzle
            Within its bead it may touch struts that are joined to the one that is laid.
        joined : (N,) bool array
            Those struts.
        """
        height, size = tool_balls(nozzle)
        centres = tip[:, None] + height[:, None] * axis[:, None]  # (P, B, 3)
        best = Nearest()
        free = ~joined[self.strut]
        for radius in np.unique(self.radius):
            chosen = np.flatnonzero(free & (self.radius[self.strut] == radius))
            if not len(chosen):
                continue
            away, index = cKDTree(self.points[chosen]).query(centres.reshape(-1, 3))
            best = self._nearer(best, away.reshape(centres.shape[:2]) - size - radius, chosen[index])
        beside = np.flatnonzero(joined[self.strut])
        for pose in range(len(tip)) if len(beside) else ():
            points = self.points[beside]
            out = np.linalg.norm(points - tip[pose], axis=1) > nozzle.bead
            if not out.any():
                continue
            away = np.linalg.norm(points[out][None] - centres[pose][:, None], axis=2)  # (B, M)
            air = away - size[:, None] - self.radius[self.strut[beside[out]]]
            best = self._nearer(best, air, np.broadcast_to(beside[out], air.shape).ravel())
        return best

    def _nearer(self, best: Nearest, air: np.ndarray, index: np.ndarray) -> Nearest:
        place = int(np.argmin(air))
        least = float(air.ravel()[place])
        return Nearest(least, int(self.numbers[self.strut[index[place]]])) if least < best.air else best
