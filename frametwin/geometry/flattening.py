"""How far chords leave a Bezier curve, and whether it is one chord itself.

A chord over the parameter step h leaves its curve by at most h^2 / 8 times the largest second derivative there. That of
a Bezier curve is a Bezier curve itself, and so nowhere larger than the largest of its control points.

References
----------
G. Farin, *Curves and Surfaces for CAGD*, 5th ed., 2002 (derivatives in Bernstein form, convex hull property).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.geometry import bezier

Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""Tolerance for curves that are meant to be straight, as a share of a length: above what rounding adds up to."""


def second_derivative_bound(control_points: ArrayLike) -> Floats:
    """Bound on the length of the second derivative of curves.

    Parameters
    ----------
    control_points : (..., n + 1, D) array, mm

    Returns
    -------
    (...) array, mm per square of the parameter
    """
    points = np.asarray(control_points, dtype=np.float64)
    n = points.shape[-2] - 1
    return n * (n - 1) * np.linalg.norm(np.diff(points, n=2, axis=-2), axis=-1).max(axis=-1, initial=0.0)


def chord_error(control_points: ArrayLike, chords: ArrayLike) -> Floats:
    """Bound on how far curves leave their chords; the inverse of `chords_needed`.

    Parameters
    ----------
    control_points : (..., n + 1, D) array, mm
    chords : (...) array or number
        Into how many equal steps the whole parameter is cut, above 0; need not be a whole number.

    Returns
    -------
    (...) array, mm
    """
    return second_derivative_bound(control_points) / (8.0 * np.square(chords))


def chords_needed(control_points: ArrayLike, tolerance: ArrayLike) -> Floats:
    """Into how many equal steps of the parameter a curve is cut so that no chord leaves it by more than a tolerance.

    Parameters
    ----------
    control_points : (..., n + 1, D) array, mm
    tolerance : (...) array or number, mm
        Above 0.

    Returns
    -------
    (...) array
        Not rounded up to whole numbers, and 0 for straight curves of even speed. A part of the parameter needs the same
        part of the chords.
    """
    return np.sqrt(second_derivative_bound(control_points) / (8.0 * np.asarray(tolerance)))


def is_straight(control_points: ArrayLike, tolerance: ArrayLike, *, even: bool = False) -> NDArray[np.bool_]:
    """Whether curves are no more than the chords between their ends.

    Parameters
    ----------
    control_points : (..., n + 1, D) array, mm
    tolerance : (...) array or number, mm
        By how far control points may lie beside the chord or beyond its ends.
    even
        Ask for an even speed as well: no coordinate of a control point differs by more than the tolerance from those of
        `bezier.straight`.

    Returns
    -------
    (...) array
    """
    points = np.asarray(control_points, dtype=np.float64)
    tolerance = np.asarray(tolerance)
    start, end = points[..., 0, :], points[..., -1, :]
    if even:
        away = np.abs(points - bezier.straight(start, end, points.shape[-2] - 1))
        return away.max(axis=(-2, -1), initial=0.0) <= tolerance
    chord = end - start
    length = np.linalg.norm(chord, axis=-1)
    direction = chord / np.where(length > 0.0, length, 1.0)[..., None]
    along = np.einsum("...ix,...x->...i", points - start[..., None, :], direction)
    beside = np.linalg.norm(points - start[..., None, :] - along[..., None] * direction[..., None, :], axis=-1)
    beyond = np.maximum(-along, along - length[..., None])
    return np.maximum(beside, beyond).max(axis=-1, initial=0.0) <= tolerance
