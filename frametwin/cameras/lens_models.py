"""The two lens models of a rig, OpenCV's perspective and fisheye one, with their derivatives.

References: OpenCV's documentation of ``calib3d`` and ``calib3d::fisheye``; J. Kannala and S. S. Brandt, "A generic
camera model and calibration method for conventional, wide-angle, and fish-eye lenses", PAMI 28(8), 2006.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.cameras import distortion, fisheye
from frametwin.cameras.camera import DISTORTION_KEYS, FISHEYE, PERSPECTIVE

Floats = NDArray[np.float64]

LENS_KEYS: dict[str, tuple[str, ...]] = {
    model: ("fl_x", "fl_y", "cx", "cy", *keys) for model, keys in DISTORTION_KEYS.items()
}
"""Parameters of each model by their names in ``transforms.json``, in the order in which they stand in arrays."""


def project(model: str, lens: ArrayLike, local: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Pixels of points given in the camera's axes, and how they change.

    Parameters
    ----------
    model
        ``OPENCV`` or ``OPENCV_FISHEYE``.
    lens : (P,) array
        Its parameters, as `LENS_KEYS` names them.
    local : (N, 3) array, mm
        Points in OpenCV axes; in front of the camera for the perspective model.

    Returns
    -------
    pixels : (N, 2) array
        Pixel centres at +0.5 if those of the principal point are.
    by_point : (N, 2, 3) array
        Derivative of the pixels by the points.
    by_lens : (N, 2, P) array
        Derivative of the pixels by the parameters.
    """
    values, points = np.asarray(lens, dtype=np.float64), np.asarray(local, dtype=np.float64)
    plane, by_point, by_coefficients = (_fisheye if model == FISHEYE else _perspective)(values[4:], points)
    focal = values[:2]
    by_lens = np.zeros((len(points), 2, len(values)))
    by_lens[:, 0, 0], by_lens[:, 1, 1] = plane[:, 0], plane[:, 1]
    by_lens[:, 0, 2] = by_lens[:, 1, 3] = 1.0
    by_lens[:, :, 4:] = focal[:, None] * by_coefficients
    return plane * focal + values[2:4], focal[:, None] * by_point, by_lens


def rays(model: str, lens: ArrayLike, pixels: ArrayLike) -> Floats:
    """Directions in the camera's axes of pixels; the inverse of `project`.

    Returns
    -------
    (N, 3) array
        Unit vectors; NaN where the model has no inverse.
    """
    values = np.asarray(lens, dtype=np.float64)
    plane = (np.asarray(pixels, dtype=np.float64) - values[2:4]) / values[:2]
    if model == PERSPECTIVE:
        directions = np.concatenate([distortion.undistort(plane, values[4:9]), np.ones((len(plane), 1))], axis=1)
        return directions / np.linalg.norm(directions, axis=1, keepdims=True)
    bent = np.linalg.norm(plane, axis=1)
    angle = fisheye.straight_angle(bent, values[4:8])
    share = np.sin(angle) / np.maximum(bent, 1e-300)
    share = np.where(bent < 1e-12, 1.0, share)
    return np.concatenate([plane * share[:, None], np.cos(angle)[:, None]], axis=1)


def _perspective(coefficients: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    k1, k2, p1, p2, k3 = coefficients
    depth = points[:, 2]
    x, y = points[:, 0] / depth, points[:, 1] / depth
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    plane = distortion.distort(np.stack([x, y], axis=1), coefficients)
    mixed = slope * x * y + 2.0 * (p1 * x + p2 * y)
    a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    by_point = np.stack(
        [
            np.stack([a, mixed, -(a * x + mixed * y)], axis=1) / depth[:, None],
            np.stack([mixed, d, -(mixed * x + d * y)], axis=1) / depth[:, None],
        ],
        axis=1,
    )
    powers = np.stack([r2, r2**2], axis=1)
    tangential_x = np.stack([2.0 * x * y, r2 + 2.0 * x * x], axis=1)
    tangential_y = np.stack([r2 + 2.0 * y * y, 2.0 * x * y], axis=1)
    last = r2[:, None] ** 3
    by_x = np.concatenate([x[:, None] * powers, tangential_x, x[:, None] * last], axis=1)
    by_y = np.concatenate([y[:, None] * powers, tangential_y, y[:, None] * last], axis=1)
    return plane, by_point, np.stack([by_x, by_y], axis=1)


def _fisheye(coefficients: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    x, y, z = points.T
    aside = np.maximum(np.hypot(x, y), 1e-9 * np.abs(z))
    square = aside**2 + z**2
    angle = np.arctan2(aside, z)
    bent, slope = fisheye.bent_angle(angle, coefficients)
    unit = np.stack([x, y], axis=1) / aside[:, None]
    along = np.stack([unit[:, 0] * z, unit[:, 1] * z, -aside], axis=1) / square[:, None]  # d angle / d point
    by_point = (slope[:, None, None] * unit[:, :, None]) * along[:, None, :]
    turn = (bent / aside)[:, None, None] * (np.eye(2) - unit[:, :, None] * unit[:, None, :])
    by_point[:, :, :2] += turn
    powers = angle[:, None] ** np.array([3, 5, 7, 9])
    return bent[:, None] * unit, by_point, unit[:, :, None] * powers[:, None, :]
