"""How far curves have moved, at equal parameter."""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier

SAMPLES = 30
"""Intervals of the curve parameter in which the largest displacement is looked for first."""


def curve_change(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The curves of displacement, at equal parameter, between two sets of curves of any two degrees, in mm."""
    degree = max(before.shape[-2], after.shape[-2]) - 1
    return bezier.elevate(after, degree) - bezier.elevate(before, degree)


def strut_displacements(change: np.ndarray, intervals: int = SAMPLES) -> np.ndarray:
    """(E,) largest length in mm of each of the curves ``change`` (E, n + 1, 3), at the ends of so many intervals."""
    u = np.arange(intervals + 1) / intervals
    return np.asarray(np.linalg.norm(bezier.evaluate(change, u), axis=2).max(axis=1))


def largest_displacement(change: np.ndarray) -> float:
    """Largest length in mm of the cubic curves ``change`` (E, 4, 3) of displacement, to about six digits.

    0 where there are none.
    """
    if not len(change):
        return 0.0
    coarse = strut_displacements(change)
    near = change[coarse >= 0.98 * coarse.max()]
    return float(np.linalg.norm(bezier.evaluate(near, np.linspace(0.0, 1.0, 601)), axis=2).max())


def largest_deviation(design: np.ndarray, real: np.ndarray) -> float:
    """Largest distance in mm between points at equal parameter of curves (N, 4, 3); 0 where there are none."""
    return largest_displacement(real - design)
