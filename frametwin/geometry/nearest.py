"""The point of a Bezier curve that is nearest to another point."""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier

_STEPS = 3
"""Of Newton's method; a strut is bent little."""

_STARTS = np.linspace(0.0, 1.0, 17)


def nearest_parameters(points: np.ndarray, curves: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Find the nearest point of each curve by Newton's method on the squared distance.

    Parameters
    ----------
    points : (N, 3) array
        A point for each curve.
    curves : (N, n + 1, 3) array
        Control points, of a degree of 2 or more.
    start : (N,) array
        Parameters to start at, 0..1, in the valley of the nearest point.

    Returns
    -------
    (N,) float64, 0..1. Where the distance is not convex, its curvature is taken to be the squared speed.
    """
    nearest, degree = start, curves.shape[1] - 1
    velocity, bend = degree * np.diff(curves, axis=1), degree * (degree - 1) * np.diff(curves, n=2, axis=1)
    for _ in range(_STEPS):
        away = np.einsum("pk,pkd->pd", bezier.bernstein(degree, nearest), curves) - points
        speed = np.einsum("pk,pkd->pd", bezier.bernstein(degree - 1, nearest), velocity)
        turn = np.einsum("pk,pkd->pd", bezier.bernstein(degree - 2, nearest), bend)
        slope, curvature = (away * speed).sum(axis=1), (speed**2).sum(axis=1)
        convex = curvature + (away * turn).sum(axis=1)
        step = slope / np.maximum(np.where(convex > 0.1 * curvature, convex, curvature), 1e-300)
        nearest = np.clip(nearest - step, 0.0, 1.0)
    return nearest


def distances_to_curves(points: np.ndarray, curves: np.ndarray) -> np.ndarray:
    """(N,) distance of each point (N, 3) from its curve (N, n + 1, 3), wherever on the curve the nearest point is."""
    known = np.linalg.norm(bezier.evaluate(curves, _STARTS) - points[:, None], axis=-1)  # (N, 17)
    nearest = nearest_parameters(points, curves, _STARTS[known.argmin(axis=1)])
    basis = bezier.bernstein(curves.shape[1] - 1, nearest)
    found = np.linalg.norm(np.einsum("pk,pkd->pd", basis, curves) - points, axis=1)
    return np.asarray(np.minimum(found, known.min(axis=1)))
