"""Struts in two halves that meet in the middle, each a strut of its own; and what was found of them as whole struts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frametwin.fitting.fast_state import Problem
from frametwin.fitting.part_fit import PartFit
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

SAMPLES = 33
"""Points of each half through which one curve is laid."""

NEARER, FINE = 4, 257
"""Times that each of these is compared with the nearest point of the curve, of so many."""


@dataclass(frozen=True, eq=False)
class Halves:
    """Struts that are fitted as two, the second halves after all struts of the plan.

    Attributes
    ----------
    struts : (H,) array of int
        The second half of strut ``struts[i]`` is strut ``planned_struts + i``; they meet at vertex
        ``planned_vertices + i``.
    planned_struts, planned_vertices : int
        Of the plan.
    """

    struts: np.ndarray
    planned_struts: int
    planned_vertices: int

    @classmethod
    def none(cls, frame: Wireframe) -> Halves:
        """Of a frame whose struts are all whole."""
        return cls(np.zeros(0, dtype=np.int64), frame.strut_count, frame.vertex_count)

    @property
    def second(self) -> np.ndarray:
        """(H,) array of int: the struts that are second halves."""
        return self.planned_struts + np.arange(len(self.struts))

    @property
    def both(self) -> np.ndarray:
        """(2H,) array of int: first halves, then second ones."""
        return np.concatenate([self.struts, self.second])

    def edges(self, edges: np.ndarray) -> np.ndarray:
        """(E + H, 2) vertices of all struts, of edges (E, 2) some of which are halved."""
        result, middles = self.halved(edges), self.planned_vertices + np.arange(len(self.struts))
        result[self.struts, 1] = result[self.second, 0] = middles
        return result

    def halved(self, values: np.ndarray) -> np.ndarray:
        """Values of struts (E, ...), those of a strut for both its halves (E + H, ...)."""
        return np.concatenate([values, values[self.struts]])

    def larger(self, values: np.ndarray) -> np.ndarray:
        """(E,) of the values of both halves (E + H,) the larger."""
        result = values[: self.planned_struts].copy()
        result[self.struts] = np.maximum(result[self.struts], values[self.second])
        return result

    def joined(self, part: PartFit, degree: int) -> PartFit:
        """What was found with struts in halves, of whole struts.

        Struts that were halved get curves of ``degree``. Standard deviations are those of these curves: that of the
        worse half, and by how much the two are off the curve.
        """
        if not len(self.struts):
            return part
        first, second = part.control_points[self.struts], part.control_points[self.second]
        cubic = part.control_points[: self.planned_struts].copy()
        cubic[self.struts] = joined_curve(first, second, 3)
        curves = joined_curve(first, second, degree)
        off = np.zeros(self.planned_struts)
        off[self.struts] = np.sqrt(0.5 * (_mean_square_distance(first, curves) + _mean_square_distance(second, curves)))
        found: dict[str, Any] = {name: getattr(part, name) for name in ("sigma_across", "sigma_along")}
        found = {name: None if s is None else np.hypot(self.larger(s), off) for name, s in found.items()}
        return replace(
            part,
            control_points=cubic,
            vertices=part.vertices[: self.planned_vertices],
            thickness=self._along(part.thickness),
            opacity=self._along(part.opacity),
            confidence=-self.larger(-part.confidence),
            joint_radius=None if part.joint_radius is None else part.joint_radius[: self.planned_vertices],
            attached=None if part.attached is None else self._ends(part.attached),
            gap=None if part.gap is None else self._ends(part.gap),
            bent=dict(zip(self.struts.tolist(), curves, strict=True)),
            **found,
        )

    def _along(self, values: np.ndarray) -> np.ndarray:
        """(E, K) of values along both halves (E + H, K): of each two that follow each other the mean."""
        result = values[: self.planned_struts].copy()
        both = np.concatenate([values[self.struts], values[self.second]], axis=1)
        result[self.struts] = both.reshape(len(both), -1, 2).mean(axis=2)
        return result

    def _ends(self, values: np.ndarray) -> np.ndarray:
        """(E, 2) values of the ends of whole struts, from those of both halves (E + H, 2)."""
        result = values[: self.planned_struts].copy()
        result[self.struts, 1] = values[self.second, 1]
        return result


def joined_curve(first: np.ndarray, second: np.ndarray, degree: int) -> np.ndarray:
    """One curve through two that follow each other, by least squares with both ends fixed.

    Parameters
    ----------
    first, second : (N, 4, 3) array, mm
    degree : int

    Returns
    -------
    (N, degree + 1, 3) array, mm
    """
    half, fine = np.linspace(0.0, 1.0, SAMPLES), np.linspace(0.0, 1.0, FINE)
    lengths = bezier.arc_length(first), bezier.arc_length(second)
    cut = lengths[0] / np.maximum(lengths[0] + lengths[1], 1e-12)  # so that the speed is about even
    points = np.concatenate([bezier.evaluate(first, half), bezier.evaluate(second, half[1:])], axis=1)
    result = np.empty((len(first), degree + 1, 3))
    for i, where in enumerate(points):
        u = np.concatenate([cut[i] * half, cut[i] + (1.0 - cut[i]) * half[1:]])
        result[i] = _curve_through(where, u, degree)
        for _ in range(NEARER):
            gap = where[1:-1, None] - bezier.evaluate(result[i], fine)
            u[1:-1] = fine[np.einsum("nfx,nfx->nf", gap, gap).argmin(axis=1)]
            result[i] = _curve_through(where, u, degree)
    return result


def _mean_square_distance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(N,) mean square in mm^2 of the distances from points of curves (N, n + 1, 3) to others (N, m + 1, 3)."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    gap = bezier.evaluate(first, u)[:, :, None] - bezier.evaluate(second, np.linspace(0.0, 1.0, FINE))[:, None]
    return np.asarray(np.einsum("nsfx,nsfx->nsf", gap, gap).min(axis=2).mean(axis=1))


def _curve_through(points: np.ndarray, u: np.ndarray, degree: int) -> np.ndarray:
    """(degree + 1, 3) of the curve between the first and the last of points (N, 3) that is nearest to all at u (N,)."""
    basis, ends = bezier.bernstein(degree, u), points[[0, -1]]
    inner = np.linalg.lstsq(basis[:, 1:-1], points - basis[:, [0, -1]] @ ends, rcond=None)[0]
    return np.concatenate([ends[:1], inner, ends[1:]])


def halved_frame(frame: Wireframe, halves: Halves) -> Wireframe:
    """The frame with a vertex in the middle of each of the struts, whose second halves come after all others."""
    curves = cut(frame.control_points, halves)
    return frame.replace(
        vertices=np.concatenate([frame.vertices, curves[halves.second, 0]]),
        edges=halves.edges(frame.edges),
        control_points=curves,
        grounded=np.concatenate([frame.grounded, np.zeros(len(halves.struts), dtype=bool)]),
        **{name: halves.halved(getattr(frame, name)) for name in ("radius", "printed", "batch")},
    )


def cut(curves: np.ndarray, halves: Halves) -> np.ndarray:
    """(E + H, 4, 3) of curves (E, 4, 3), some of them in two halves."""
    first, second = bezier.split(curves[halves.struts], 0.5)
    result = halves.halved(curves)
    result[halves.struts], result[halves.second] = first, second
    return result


def laid_along(
    problem: Problem, joints: np.ndarray, curves: np.ndarray, middles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Freedoms of all joints (V, 6), of which only the ``middles`` change, and of struts (E, 6) that give curves."""
    moved = curves - problem.frame.control_points
    own, _ = problem.elastic.freedoms_of(moved)
    joints = joints.copy()
    joints[middles] = own[middles]
    rest = moved - problem.elastic.displaced(np.zeros_like(moved), joints, np.zeros((len(moved), 6)))
    return joints, rest[:, 1:3].reshape(-1, 6)
