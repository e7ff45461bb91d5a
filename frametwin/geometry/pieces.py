"""Curves of any degree cut into cubics that follow each other: what draws cubics alone can draw them so."""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier


def cubic_pieces(curve: np.ndarray, count: int) -> np.ndarray:
    """Cubics over equal steps of the parameter, each with the points and velocities of the curve at its ends.

    Parameters
    ----------
    curve : (n + 1, 3) array, mm
    count : int
        Pieces.

    Returns
    -------
    (count, 4, 3) array, mm. Pieces of a cubic are that cubic.
    """
    u = np.arange(count + 1) / count
    points, reach = bezier.evaluate(curve, u), bezier.derivative(curve, u) / (3.0 * count)
    return np.stack([points[:-1], points[:-1] + reach[:-1], points[1:] - reach[1:], points[1:]], axis=1)


def pieces_deviation(curve: np.ndarray, count: int) -> float:
    """A bound in mm on how far `cubic_pieces` are off the curve (n + 1, 3) at any parameter.

    The difference of two Bezier curves of one degree is the Bezier curve of the differences of their control points,
    and lies within their hull.
    """
    degree, rest, most = len(curve) - 1, curve, 0.0
    if degree <= 3:
        return 0.0
    for i, piece in enumerate(cubic_pieces(curve, count)):
        own, rest = bezier.split(rest, 1.0 / (count - i))
        most = max(most, float(np.linalg.norm(own - bezier.elevate(piece, degree), axis=1).max()))
    return most


def pieces_needed(curve: np.ndarray, tolerance: float, least: int = 1, most: int = 64) -> int:
    """How many `cubic_pieces` of a curve (n + 1, 3) stay within ``tolerance`` mm of it, from ``least`` to ``most``."""
    return next((count for count in range(least, most) if pieces_deviation(curve, count) <= tolerance), most)
