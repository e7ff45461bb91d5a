"""OpenCV's lens distortion (radial k1, k2, k3, tangential p1, p2) on the plane at depth 1, and its inverse.

Reference: D. C. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32(3), 1966, in the
form and order of coefficients that OpenCV documents.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

MAX_STEPS = 50
TOLERANCE = 1e-14


def distort(plane: ArrayLike, coefficients: ArrayLike) -> Floats:
    """Points on the plane at depth 1, as the lens shifts them.

    Parameters
    ----------
    plane
        (..., 2) undistorted points x / z, y / z.
    coefficients
        (5,) k1, k2, p1, p2, k3.

    Returns
    -------
    (..., 2) distorted points.
    """
    x, y = np.moveaxis(np.asarray(plane, dtype=np.float64), -1, 0)
    k1, k2, p1, p2, k3 = np.asarray(coefficients, dtype=np.float64)
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(plane: ArrayLike, coefficients: ArrayLike) -> Floats:
    """The inverse of :func:`distort` by Newton's method.

    Parameters
    ----------
    plane
        (..., 2) distorted points.
    coefficients
        (5,) k1, k2, p1, p2, k3.

    Returns
    -------
    (..., 2) undistorted points; NaN where there is none on the sheet of the lens that starts at its centre.
    """
    wanted = np.asarray(plane, dtype=np.float64)
    points = wanted.copy()
    for _ in range(MAX_STEPS):
        (a, b), (c, d) = _jacobian(points, coefficients)
        error = distort(points, coefficients) - wanted
        determinant = a * d - b * c
        with np.errstate(divide="ignore", invalid="ignore"):
            step = (
                np.stack([d * error[..., 0] - b * error[..., 1], a * error[..., 1] - c * error[..., 0]], axis=-1)
                / determinant[..., None]
            )
        # Past the fold the map runs backwards, and a full step from near it would jump to another sheet.
        size = np.linalg.norm(step, axis=-1, keepdims=True)
        step *= np.minimum(1.0, 0.5 * (0.1 + np.linalg.norm(points, axis=-1, keepdims=True)) / np.maximum(size, 1e-300))
        points = points - step
        if not np.any(size > TOLERANCE * (1.0 + np.linalg.norm(points, axis=-1, keepdims=True))):
            break
    (a, b), (c, d) = _jacobian(points, coefficients)
    missed = np.linalg.norm(distort(points, coefficients) - wanted, axis=-1)
    good = (missed < 1e-10 * (1.0 + np.linalg.norm(wanted, axis=-1))) & (a * d - b * c > 0.0)
    return np.where(good[..., None], points, np.nan)


def _jacobian(plane: Floats, coefficients: ArrayLike) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    x, y = np.moveaxis(plane, -1, 0)
    k1, k2, p1, p2, k3 = np.asarray(coefficients, dtype=np.float64)
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))  # d radial / d x = slope * x
    mixed = slope * x * y + 2.0 * (p1 * x + p2 * y)
    return (
        (radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x, mixed),
        (mixed, radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x),
    )
