"""Rotations as matrices, and as vectors: their axis times their angle in radians."""

from __future__ import annotations

import numpy as np


def cross_matrix(t: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) that take the cross product with the vectors ``t`` (..., 3) from the left."""
    matrix = np.zeros((*t.shape[:-1], 3, 3))
    x, y, z = np.moveaxis(t, -1, 0)
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


def rotation_matrices(vectors: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) about ``vectors`` (..., 3) by their lengths in radians (Rodrigues' formula)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    turn = cross_matrix(vectors)
    # np.sinc keeps both quotients, sin(a) / a and (1 - cos(a)) / a^2, exact at zero.
    return np.eye(3) + np.sinc(angle / np.pi) * turn + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * turn @ turn


def turns_of(matrices: np.ndarray) -> np.ndarray:
    """The inverse of `rotation_matrices` for less than half a turn: vectors (..., 3) of rotations (..., 3, 3).

    Exact for the smallest turns; towards half a turn, where the axis is to be read from what is left of next to
    nothing, the less so.
    """
    skew = 0.5 * (matrices - np.swapaxes(matrices, -1, -2))
    sine_axis = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    sine = np.linalg.norm(sine_axis, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(matrices, axis1=-2, axis2=-1) - 1.0))
    return np.asarray(sine_axis * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[..., None])
