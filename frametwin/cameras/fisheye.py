"""OpenCV's fisheye lens (Kannala and Brandt's polynomial of the angle) on the plane at depth 1, and its inverse.

References: OpenCV's documentation of ``calib3d::fisheye``; J. Kannala and S. S. Brandt, "A generic camera model and
calibration method for conventional, wide-angle, and fish-eye lenses", PAMI 28(8), 2006.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

_STEPS, _TOLERANCE = 50, 1e-13


def distort(plane: ArrayLike, coefficients: ArrayLike) -> Floats:
    """Points on the plane at depth 1, as the lens shifts them.

    Parameters
    ----------
    plane : (..., 2) array
        Undistorted points x / z, y / z.
    coefficients : (4,) array
        k1, k2, k3, k4.

    Returns
    -------
    (..., 2) array
        Distorted points.
    """
    points = np.asarray(plane, dtype=np.float64)
    aside = np.linalg.norm(points, axis=-1)
    bent, _ = bent_angle(np.arctan(aside), np.asarray(coefficients, dtype=np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(aside > 1e-12, bent / aside, 1.0)
    return points * share[..., None]


def undistort(plane: ArrayLike, coefficients: ArrayLike) -> Floats:
    """The inverse of `distort`.

    Returns
    -------
    (..., 2) array
        Undistorted points; NaN for rays that do not meet the plane, and where the polynomial has no inverse.
    """
    points = np.asarray(plane, dtype=np.float64)
    bent = np.linalg.norm(points, axis=-1)
    angle = straight_angle(bent, np.asarray(coefficients, dtype=np.float64))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(bent > 1e-12, np.tan(angle) / bent, 1.0)
    return np.where((angle < 0.5 * np.pi)[..., None], points * share[..., None], np.nan)


def bent_angle(angle: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
    """The angle that the lens makes of an angle, radians, and its derivative."""
    even = angle[..., None] ** np.array([2, 4, 6, 8])
    return angle * (1.0 + even @ coefficients), 1.0 + even @ (coefficients * np.array([3, 5, 7, 9]))


def straight_angle(bent: Floats, coefficients: Floats) -> Floats:
    """The inverse of `bent_angle` by Newton's method; NaN where there is none below 180 degrees."""
    angle = np.minimum(bent, 1.5)
    for _ in range(_STEPS):
        value, slope = bent_angle(angle, coefficients)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.clip((value - bent) / slope, -0.3, 0.3)
        angle = angle - step
        if not np.any(np.abs(step) > _TOLERANCE):
            break
    value, slope = bent_angle(angle, coefficients)
    fine = (np.abs(value - bent) < 1e-9) & (slope > 0.0) & (angle >= 0.0) & (angle < np.pi)
    return np.where(fine, angle, np.nan)
