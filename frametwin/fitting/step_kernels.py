"""Compiled loops of a Gauss-Newton step, strut by strut: what the terms of a curve say of its ends, and what is left
for them when its own freedoms are eliminated. Threads share the struts.

Loops along rows end where an array does, though rows have twelve numbers: the compiler does not put into vector
registers what it knows to be short and not to be free of overlaps.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

HELPER: Any = {"cache": True, "fastmath": {"reassoc", "contract", "nsz"}, "error_model": "numpy", "_nrt": False}
"""Options of functions that make no array, so that references to arrays need not be counted in them. Sums may be taken
in vector registers."""

OUTER = 12
"""Freedoms of a strut's two ends, and coordinates of its four control points."""

INNER = 6
"""Coordinates of the two inner ones, which begin at `FIRST`."""

FIRST = 3

U = np.uint64  # an index without a sign is not looked at for counting from the end


@nb.njit(inline="always")
def _mixture(weights, a, rows, first, b):
    """Entry b of the sum of six rows from ``first`` on, each as many times as row a of weights has it there: all in one
    expression, so that loops over b run in vector registers and do not write sums to memory in between."""
    u, v, w = first, first + U(1), first + U(2)
    x, y, z = first + U(3), first + U(4), first + U(5)
    one = weights[a, u] * rows[u, b] + weights[a, v] * rows[v, b] + weights[a, w] * rows[w, b]
    two = weights[a, x] * rows[x, b] + weights[a, y] * rows[y, b] + weights[a, z] * rows[z, b]
    return one + two


@nb.njit(**HELPER)
def _to_ends(follow, hessian, gradient, e, own, turned, half, outer, slope):
    """The hessian (12, 12) and the gradient (12,) of a strut's control points as those of its ends, into outer and
    slope. What follows, transposed, is left in ``turned``, and the hessian times what follows in ``half``."""
    for a in range(U(OUTER)):
        slope[a] = 0.0
        for b in range(U(follow.shape[2])):
            own[a, b] = hessian[e, a, b]
            turned[b, a] = follow[e, a, b]
            outer[a, b] = follow[e, a, b]
    for a in range(U(OUTER)):
        for b in range(U(follow.shape[2])):
            half[a, b] = _mixture(own, a, outer, U(0), b) + _mixture(own, a, outer, U(INNER), b)
    for a in range(U(OUTER)):
        for b in range(U(follow.shape[2])):
            outer[a, b] = _mixture(turned, a, half, U(0), b) + _mixture(turned, a, half, U(INNER), b)
        for b in range(U(follow.shape[2])):
            slope[a] += turned[a, b] * gradient[e, b]


@nb.njit(parallel=True, cache=True, error_model="numpy")
def by_ends(follow, hessian, gradient, outer, slope):
    """Terms by the freedoms of each strut's ends, its curve following.

    follow (E, 12, 12), hessian (E, 12, 12) and gradient (E, 12) by the control points; out: outer (E, 12, 12) and slope
    (E, 12).
    """
    for e in nb.prange(len(follow)):
        own, turned, half = np.empty((OUTER, OUTER)), np.empty((OUTER, OUTER)), np.empty((OUTER, OUTER))
        matrix, vector = np.empty((OUTER, OUTER)), np.empty(OUTER)
        _to_ends(follow, hessian, gradient, e, own, turned, half, matrix, vector)
        outer[e] = matrix
        slope[e] = vector


@nb.njit(**HELPER)
def _hold(follow, stiffness, spin_stiffness, away, pull, weight, e, outer, slope):
    """Add the elastic energy of a strut to the terms of its ends."""
    for a in range(U(OUTER)):
        total = 0.0
        for b in range(U(follow.shape[2])):
            stiff = stiffness[e, a, b] + spin_stiffness[e, a, b]
            outer[a, b] += weight * stiff
            total += stiff * away[b]
        slope[a] += pull * total


@nb.njit(**HELPER)
def _hold_inner(hessian, gradient, stiffness, bent, pull, weight, e, held, slope):
    """Matrix (6, 6) and slope (6,) of a strut's inner points, elastic energy included, into held and slope."""
    for a in range(U(INNER)):
        total = 0.0
        for b in range(U(INNER)):
            held[a, b] = hessian[e, U(FIRST) + a, U(FIRST) + b] + weight * stiffness[e, a, b]
            total += stiffness[e, a, b] * bent[e, b]
        slope[a] = gradient[e, U(FIRST) + a] + pull * total


@nb.njit(**HELPER)
def _invert(matrix, inverse):
    """The inverse of a positive definite matrix (6, 6), in whose place its factors L D L^T are left."""
    for b in range(U(INNER)):
        for c in range(b):
            weight = matrix[b, c] * matrix[c, c]
            for a in range(b, U(INNER)):
                matrix[a, b] -= weight * matrix[a, c]
        part = 1.0 / matrix[b, b]
        for a in range(b + U(1), U(INNER)):
            matrix[a, b] *= part
    for a in range(U(INNER)):
        for side in range(U(INNER)):
            inverse[a, side] = 1.0 if a == side else 0.0
        for c in range(a):
            weight = matrix[a, c]
            for side in range(U(INNER)):
                inverse[a, side] -= weight * inverse[c, side]
    for a in range(U(INNER)):
        part = 1.0 / matrix[a, a]
        for side in range(U(INNER)):
            inverse[a, side] *= part
    for back in range(U(INNER)):
        a = U(INNER - 1) - back
        for c in range(a + U(1), U(INNER)):
            weight = matrix[c, a]
            for side in range(U(INNER)):
                inverse[a, side] -= weight * inverse[c, side]


@nb.njit(**HELPER)
def _take_out(follow, half, inverse, inner_slope, turned, outer, slope, follows, goes):
    """Take what follows by itself out of the terms of a strut's ends, and tell how it follows them (6, 12) and goes
    (6,) besides. ``turned`` is room."""
    for a in range(U(INNER)):
        for b in range(U(follow.shape[2])):
            turned[b, a] = half[U(FIRST) + a, b]
            follows[a, b] = inverse[a, U(0)] * half[U(3), b] + inverse[a, U(1)] * half[U(4), b]
            follows[a, b] += inverse[a, U(2)] * half[U(5), b] + inverse[a, U(3)] * half[U(6), b]
            follows[a, b] += inverse[a, U(4)] * half[U(7), b] + inverse[a, U(5)] * half[U(8), b]
        goes[a] = 0.0
        for c in range(U(INNER)):
            goes[a] += inverse[a, c] * inner_slope[c]
    for a in range(U(OUTER)):
        for b in range(U(follow.shape[2])):
            outer[a, b] -= _mixture(turned, a, follows, U(0), b)
        for c in range(U(INNER)):
            slope[a] -= turned[a, c] * goes[c]


@nb.njit(parallel=True, cache=True, error_model="numpy")
def without_inner(
    follow,
    hessian,
    gradient,
    stiffness,
    spin_stiffness,
    inner_stiffness,
    freedoms,
    joints,
    bent,
    weights,
    outer,
    slope,
    inverse,
    follows,
    goes,
):
    """Eliminate the inner points of every strut from the terms of pictures and elastic energy.

    follow, hessian, stiffness and spin_stiffness (E, 12, 12), gradient (E, 12), inner_stiffness (E, 6, 6), freedoms
    (E, 12) of the ends; joints (6V,) and bent (E, 6) are how far the frame is away from where energy is measured, and
    weights (2,) those of the energy in the slope and in all. Out: outer (E, 12, 12) and slope (E, 12) by the ends;
    inverse (E, 6, 6) of what was eliminated, and with the sign turned how that follows the ends, (E, 6, 12), and how it
    goes besides, (E, 6).
    """
    for e in nb.prange(len(follow)):
        own, turned, half = np.empty((OUTER, OUTER)), np.empty((OUTER, OUTER)), np.empty((OUTER, OUTER))
        matrix, vector, away = np.empty((OUTER, OUTER)), np.empty(OUTER), np.empty(OUTER)
        inner, inner_slope, inverted = np.empty((INNER, INNER)), np.empty(INNER), np.empty((INNER, INNER))
        by_ends, by_slope = np.empty((INNER, OUTER)), np.empty(INNER)
        for a in range(OUTER):
            away[a] = joints[freedoms[e, a]]
        _to_ends(follow, hessian, gradient, e, own, turned, half, matrix, vector)
        _hold(follow, stiffness, spin_stiffness, away, weights[0], weights[1], e, matrix, vector)
        _hold_inner(hessian, gradient, inner_stiffness, bent, weights[0], weights[1], e, inner, inner_slope)
        _invert(inner, inverted)
        _take_out(follow, half, inverted, inner_slope, turned, matrix, vector, by_ends, by_slope)
        outer[e] = matrix
        slope[e] = vector
        inverse[e] = inverted
        follows[e] = by_ends
        goes[e] = by_slope
