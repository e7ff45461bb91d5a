"""Rotation-minimising (Bishop) frames along Bezier curves by double reflection.

Reference: W. Wang, B. Juettler, D. Zheng, Y. Liu, "Computation of rotation minimizing frames", ACM
Transactions on Graphics 27(1), 2008. The error falls with the fourth power of the step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.geometry import bezier

Floats = NDArray[np.float64]

STILL = 1e-9  # a derivative below this share of the control polygon's length counts as zero
VERTICAL = 1e-3  # a tangent this close to the vertical has no usable direction "up" beside it


class Frames(NamedTuple):
    """Right-handed orthonormal frames ``(tangent, normal, binormal)``, each of the shape ``(..., S, 3)``."""

    tangent: Floats
    normal: Floats
    binormal: Floats


def tangents(control_points: ArrayLike, u: ArrayLike) -> Floats:
    """Unit tangents, also where the first derivative vanishes.

    Parameters
    ----------
    control_points
        (..., n + 1, 3).
    u
        (S,) parameters.

    Returns
    -------
    (..., S, 3). Where the curve stands still (control points that coincide at an end, a cusp) the tangent is
    its one-sided limit: from the right in the first half of the curve, from the left in the second.

    Raises
    ------
    ValueError
        If all control points of a curve coincide.
    """
    points = np.asarray(control_points, dtype=np.float64)
    u = np.atleast_1d(np.asarray(u, dtype=np.float64))
    size = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)[..., None, None]
    result = np.zeros((*points.shape[:-2], u.size, 3))
    missing = np.ones((*points.shape[:-2], u.size, 1), dtype=bool)
    for order in range(1, points.shape[-2]):
        vector = bezier.derivative(points, u, order)
        if order % 2 == 0:
            vector = vector * np.where(u < 0.5, 1.0, -1.0)[:, None]
        length = np.linalg.norm(vector, axis=-1, keepdims=True)
        usable = missing & (length > STILL * size)
        result = np.where(usable, vector / np.where(usable, length, 1.0), result)
        missing &= ~usable
        if not missing.any():
            return result
    raise ValueError("a curve whose control points all coincide has no tangent")


def rotation_minimising_frames(
    control_points: ArrayLike, u: ArrayLike, *, start_normal: ArrayLike | None = None, steps: int = 64
) -> Frames:
    """Frames that turn about the tangent nowhere along the curve.

    Parameters
    ----------
    control_points
        (..., n + 1, 3) mm; straight, inflected and cusped curves are allowed.
    u
        (S,) parameters in 0..1, in any order.
    start_normal
        (..., 3) the normal at ``u = 0``; only its part across the tangent counts. When absent, the
        normal starts in the vertical plane of the tangent, pointing up, and along world x for vertical
        tangents.
    steps
        Number of equal steps over 0..1; the parameters ``u`` are visited in between.

    Returns
    -------
    Frames at ``u``. They depend on the curve and the start alone: another choice of ``u`` gives the same
    frames.

    Raises
    ------
    ValueError
        For parameters outside of 0..1, a curve of no length, or a ``start_normal`` along the tangent.
    """
    points = np.asarray(control_points, dtype=np.float64)
    wanted = np.atleast_1d(np.asarray(u, dtype=np.float64))
    if wanted.ndim != 1 or not np.all((wanted >= 0.0) & (wanted <= 1.0)):
        raise ValueError("parameters must be one row of numbers in 0..1")
    grid = np.union1d(np.linspace(0.0, 1.0, steps + 1), wanted)
    position, tangent = bezier.evaluate(points, grid), tangents(points, grid)
    normal = np.empty_like(tangent)
    normal[..., 0, :] = _start(tangent[..., 0, :], start_normal)
    mirrors = _mirrors(np.diff(position, axis=-2), tangent[..., :-1, :], tangent[..., 1:, :])
    for i in range(grid.size - 1):
        moved = normal[..., i, :]
        for mirror in mirrors:
            moved = moved - _dot(mirror[..., i, :], moved) * mirror[..., i, :]
        normal[..., i + 1, :] = _across(moved, tangent[..., i + 1, :])
    at = np.searchsorted(grid, wanted)
    tangent, normal = tangent[..., at, :], normal[..., at, :]
    return Frames(tangent, normal, np.cross(tangent, normal))


def _mirrors(chord: Floats, before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """The two mirrors, one after the other, that carry a normal over a step (double reflection).

    Every argument has the shape (..., 3). The mirrors are scaled so that a vector v is reflected to v - (m . v) m.
    """
    still = _dot(chord, chord) == 0.0  # the curve stands still: take the symmetric step between the two tangents
    first = _scaled(np.where(still, before + after, chord))
    return first, _scaled(after - (before - _dot(first, before) * first))


def _scaled(mirror: Floats) -> Floats:
    """The mirror with a length of sqrt(2); one of no length changes nothing (the limit at a cusp)."""
    square = _dot(mirror, mirror)
    return np.where(square > 0.0, mirror * np.sqrt(2.0 / np.where(square > 0.0, square, 1.0)), 0.0)


def _start(tangent: Floats, start_normal: ArrayLike | None) -> Floats:
    if start_normal is not None:
        wanted = np.broadcast_to(np.asarray(start_normal, dtype=np.float64), tangent.shape)
        length = np.linalg.norm(wanted, axis=-1)
        if np.any(np.linalg.norm(np.cross(tangent, wanted), axis=-1) <= 1e-9 * length):
            raise ValueError("the start normal must not run along the tangent")
        return _across(wanted, tangent)
    upright = np.hypot(tangent[..., 0], tangent[..., 1])[..., None] < VERTICAL
    return _across(np.where(upright, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), tangent)


def _across(vector: Floats, tangent: Floats) -> Floats:
    """The unit part of the vector across the tangent."""
    vector = vector - _dot(vector, tangent) * tangent
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.sum(a * b, axis=-1, keepdims=True)
