"""Bezier curves of any degree in Bernstein form, for many curves at once.

Control points have the shape ``(..., n + 1, D)``: any number of leading axes (struts), the degree ``n`` read
off the last axis but one, and usually ``D = 3``. Lengths carry the unit of the control points (mm throughout
FrameTwin).

References
----------
G. Farin, *Curves and Surfaces for CAGD*, 5th ed., 2002 (Bernstein form, de Casteljau, degree elevation).
FrameTwin paper, section V.B, Eq. 6-8 (least-squares refit with fixed ends).
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def bernstein(n: int, u: ArrayLike) -> Floats:
    """Bernstein polynomials ``B_0^n .. B_n^n`` at the parameters ``u``.

    Parameters
    ----------
    n
        Degree, 0 or more.
    u
        (...,) parameters; 0..1 on the curve, other values extrapolate.

    Returns
    -------
    (..., n + 1) values; they sum to 1 along the last axis.
    """
    if n < 0:
        raise ValueError(f"the degree of a Bezier curve must be 0 or more, not {n}")
    u = np.asarray(u, dtype=np.float64)[..., None]
    powers = np.arange(n + 1)
    binomials = np.array([comb(n, i) for i in powers], dtype=np.float64)
    return binomials * u**powers * (1.0 - u) ** powers[::-1]


def evaluate(control_points: ArrayLike, u: ArrayLike) -> Floats:
    """Points on the curves.

    Parameters
    ----------
    control_points
        (..., n + 1, D).
    u
        (S,) parameters, the same for every curve, or one number.

    Returns
    -------
    (..., S, D) points.
    """
    points = _control_points(control_points)
    basis = bernstein(points.shape[-2] - 1, np.atleast_1d(u))  # (S, n + 1)
    return basis @ points


def derivative(control_points: ArrayLike, u: ArrayLike, order: int = 1) -> Floats:
    """Derivatives with respect to the parameter.

    Parameters
    ----------
    control_points
        (..., n + 1, D).
    u
        (S,) parameters.
    order
        0 gives the points themselves; above the degree the result is zero.

    Returns
    -------
    (..., S, D) derivatives, in mm per unit of parameter to the power of ``order``.
    """
    if order < 0:
        raise ValueError(f"the order of a derivative must be 0 or more, not {order}")
    points = _control_points(control_points)
    u = np.atleast_1d(np.asarray(u, dtype=np.float64))
    for _ in range(order):
        n = points.shape[-2] - 1
        if n == 0:
            return np.zeros((*points.shape[:-2], u.size, points.shape[-1]))
        points = np.multiply(n, points[..., 1:, :] - points[..., :-1, :])
    return evaluate(points, u)


def elevate(control_points: ArrayLike, degree: int) -> Floats:
    """The same curves written with a higher degree.

    Parameters
    ----------
    control_points
        (..., n + 1, D).
    degree
        The wanted degree, at least n.

    Returns
    -------
    (..., degree + 1, D) control points.
    """
    points = _control_points(control_points)
    if degree < points.shape[-2] - 1:
        raise ValueError(f"a curve of degree {points.shape[-2] - 1} cannot be written with degree {degree}")
    for n in range(points.shape[-2], degree + 1):
        share = (np.arange(n + 1) / n)[:, None]  # (n + 1, 1) of the previous control point
        before = np.concatenate([points[..., :1, :], points], axis=-2)
        after = np.concatenate([points, points[..., -1:, :]], axis=-2)
        points = share * before + (1.0 - share) * after
    return points


def split(control_points: ArrayLike, u: float) -> tuple[Floats, Floats]:
    """Cut every curve at one parameter (de Casteljau).

    Parameters
    ----------
    control_points
        (..., n + 1, D).
    u
        Where to cut, 0..1.

    Returns
    -------
    The control points of the piece over 0..u and of the piece over u..1, each ``(..., n + 1, D)``.
    """
    points = _control_points(control_points)
    left, right = [points[..., 0, :]], [points[..., -1, :]]
    while points.shape[-2] > 1:
        points = (1.0 - u) * points[..., :-1, :] + u * points[..., 1:, :]
        left.append(points[..., 0, :])
        right.append(points[..., -1, :])
    return np.stack(left, axis=-2), np.stack(right[::-1], axis=-2)


def arc_length(control_points: ArrayLike, *, nodes: int = 12, panels: int = 4) -> Floats:
    """Length of the curves by Gauss-Legendre quadrature of the speed.

    Parameters
    ----------
    control_points
        (..., n + 1, D).
    nodes
        Quadrature points a panel.
    panels
        Equal pieces of 0..1. Straight struts of even speed are always exact. With the default, those
        whose speed changes by less than a factor of two are right to twelve digits, of three to nine.

    Returns
    -------
    (...) lengths in mm.
    """
    u, weights = _quadrature(nodes, panels)
    speed = np.linalg.norm(derivative(control_points, u), axis=-1)  # (..., S)
    return speed @ weights


@lru_cache(maxsize=32)
def refit_matrix(m: int, n: int = 3) -> Floats:
    """The constant matrix of the least-squares refit with fixed ends (paper, Eq. 6-8).

    With ``m + 1`` samples ``p_j`` at ``v_j = j / m``, ``refit_matrix(m, n) @ p`` are the control points of
    the curve of degree ``n`` that starts at ``p_0``, ends at ``p_m`` and has the least sum of squared
    distances to the other samples at equal parameters. Its columns hold the influence of one sample, so
    control points are linear in the deformation of the samples.

    Parameters
    ----------
    m
        Number of sample intervals; at least n, or the interior control points are not determined.
    n
        Degree of the curve, at least 1.

    Returns
    -------
    (n + 1, m + 1) matrix, read-only (it is shared between callers).

    Raises
    ------
    ValueError
        If ``n < 1`` or ``m < n``.
    """
    if n < 1 or m < n:
        raise ValueError(f"a refit needs a degree n of 1 or more and m >= n intervals, not n = {n}, m = {m}")
    matrix = _refit(np.arange(m + 1) / m, n)
    matrix.setflags(write=False)
    return matrix


def straight(a: ArrayLike, b: ArrayLike, n: int = 3) -> Floats:
    """Straight curves with evenly spaced control points (constant speed).

    Parameters
    ----------
    a, b
        (..., D) ends.
    n
        Degree, at least 1.

    Returns
    -------
    (..., n + 1, D) control points; the first and the last are ``a`` and ``b`` to the last bit.
    """
    if n < 1:
        raise ValueError(f"a straight Bezier curve needs a degree of 1 or more, not {n}")
    a, b = np.broadcast_arrays(np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64))
    share = (np.arange(n + 1) / n)[:, None]
    points = a[..., None, :] + share * (b - a)[..., None, :]
    points[..., -1, :] = b
    return points


def _control_points(control_points: ArrayLike) -> Floats:
    points = np.asarray(control_points, dtype=np.float64)
    if points.ndim < 2 or points.shape[-2] < 1:
        raise ValueError(f"control points need the shape (..., n + 1, D), not {points.shape}")
    return points


def _refit(parameters: Floats, n: int) -> Floats:
    """Refit matrix (n + 1, P) for samples at increasing parameters (P,) from 0 to 1."""
    matrix = np.zeros((n + 1, parameters.size))
    matrix[0, 0] = matrix[n, -1] = 1.0
    if n == 1:
        return matrix
    basis = bernstein(n, parameters)  # (P, n + 1)
    rest = np.eye(parameters.size)
    rest[:, 0] -= basis[:, 0]
    rest[:, -1] -= basis[:, n]
    # The pseudo-inverse (by QR) of the tall interior basis is S^-1 B^T of Eq. 8, its condition not squared.
    q, r = np.linalg.qr(basis[:, 1:n])
    matrix[1:n] = np.linalg.solve(r, q.T @ rest)
    return matrix


@lru_cache(maxsize=8)
def _quadrature(nodes: int, panels: int) -> tuple[Floats, Floats]:
    x, w = np.polynomial.legendre.leggauss(nodes)
    starts = np.arange(panels)[:, None] / panels
    u = (starts + (x + 1.0) / (2.0 * panels)).ravel()
    weights = np.tile(w / (2.0 * panels), panels)
    u.setflags(write=False)
    weights.setflags(write=False)
    return u, weights
