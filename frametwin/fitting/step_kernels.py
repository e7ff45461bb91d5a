"""Compiled loops of the fit's Gauss-Newton steps: small dense systems, one for each strut, in threads.

Each strut has twelve control coordinates, of which the six in its middle are its own, and follows the six freedoms of
both its ends. numpy goes through such matrices one by one, in one thread, and reads and writes all of them for every
product; here a strut's stay in the registers until all is done with them.

Sums over all struts are taken over parts of them that do not depend on the number of threads, so that neither does what
comes out. Helpers and constants are in this file too, and nowhere else: see `frametwin.raster.rod_kernels`.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

FAST: Any = {"cache": True, "fastmath": {"reassoc", "contract", "arcp", "nsz"}, "error_model": "numpy"}
HELPER: Any = {**FAST, "_nrt": False}

U = np.uint64  # an index without a sign is not looked at for counting from the end


@nb.njit(**HELPER)
def _follow(hessian, follow, e, turned, half, blocks):
    """half (12, 12) = F^T H and blocks[e] = F^T H F of strut e, and ``turned`` (12, 12) = F^T.

    All sums run along rows, and nothing is written within them: so they are taken in vector registers.
    """
    for a in range(U(12)):
        for j in range(U(12)):
            turned[j, a] = follow[e, a, j]
    for j in range(U(12)):
        for a in range(U(12)):
            total = 0.0
            for b in range(U(12)):
                total += hessian[e, a, b] * turned[j, b]
            half[j, a] = total
    for a in range(U(12)):
        for j in range(U(12)):
            total = 0.0
            for b in range(U(12)):
                total += half[a, b] * turned[j, b]
            blocks[e, a, j] = total


@nb.njit(**HELPER)
def _solve_own(inner, right, many):
    """The solutions of a positive definite system (6, 6) for ``many`` right sides, in their place."""
    for k in range(6):
        pivot = 1.0 / inner[k, k]
        for i in range(k + 1, 6):
            factor = inner[i, k] * pivot
            for j in range(k + 1, i + 1):
                inner[i, j] -= factor * inner[j, k]
            for m in range(U(many)):
                right[i, m] -= factor * right[k, m]
    for back in range(6):
        k = 5 - back
        pivot = 1.0 / inner[k, k]
        for m in range(U(many)):
            right[k, m] *= pivot
        for i in range(k):
            for m in range(U(many)):
                right[i, m] -= inner[k, i] * right[k, m]


@nb.njit(parallel=True, **FAST)
def follow_joints(hessian, gradient, follow, blocks, slopes):
    """blocks (E, 12, 12) = F^T H F and slopes (E, 12) = F^T g, out, of struts that follow their joints alone."""
    for e in nb.prange(hessian.shape[0]):
        turned, half = np.empty((12, 12)), np.empty((12, 12))
        _follow(hessian, follow, U(e), turned, half, blocks)
        for j in range(U(12)):
            slope = 0.0
            for b in range(U(12)):
                slope += turned[j, b] * gradient[e, b]
            slopes[e, j] = slope


@nb.njit(parallel=True, **FAST)
def eliminate(hessian, gradient, follow, stiffness, inner_stiffness, away, bent, weights, blocks, slopes, follows, own):
    """The struts' own freedoms eliminated from pictures and elastic energy.

    hessian (E, 12, 12) and gradient (E, 12) by the control points, follow (E, 12, 12), stiffness (E, 12, 12) over the
    joints' freedoms and inner_stiffness (E, 6, 6), how far both are from their anchor (E, 12) and (E, 6), and of the
    elastic energy the weights (2,) in the matrix and in the slope. Out: blocks (E, 12, 12) and slopes (E, 12) over the
    joints' freedoms, follows (E, 6, 12) how the own ones follow those, with the sign turned, and own (E, 6) their step
    where these rest, likewise.
    """
    for e in nb.prange(hessian.shape[0]):
        turned, half = np.empty((12, 12)), np.empty((12, 12))
        inner, right, slopes_of = np.empty((6, 6)), np.empty((6, 13)), np.empty(6)
        _follow(hessian, follow, U(e), turned, half, blocks)
        _own_system(hessian, gradient, inner_stiffness, bent, weights, U(e), half, inner, right)
        for i in range(U(6)):
            slopes_of[i] = right[i, U(12)]
        _solve_own(inner, right, 13)
        for a in range(U(12)):
            slope = 0.0
            for b in range(U(12)):
                slope += turned[a, b] * gradient[e, b] + weights[1] * stiffness[e, a, b] * away[e, b]
            for i in range(U(6)):
                follows[e, i, a] = right[i, a]
                slope -= right[i, a] * slopes_of[i]
            slopes[e, a] = slope
            for j in range(U(12)):
                less = weights[0] * stiffness[e, a, j]
                for i in range(U(6)):
                    less -= half[a, U(3) + i] * right[i, j]
                blocks[e, a, j] += less
        for i in range(U(6)):
            own[e, i] = right[i, U(12)]


@nb.njit(**HELPER)
def _own_system(hessian, gradient, inner_stiffness, bent, weights, e, half, inner, right):
    """The matrix (6, 6) of a strut's own freedoms and its right sides: how the joints' pull at them, and the slope."""
    for i in range(U(6)):
        slope = gradient[e, U(3) + i]
        for j in range(U(6)):
            inner[i, j] = hessian[e, U(3) + i, U(3) + j] + weights[0] * inner_stiffness[e, i, j]
            slope += weights[1] * inner_stiffness[e, i, j] * bent[e, j]
        for j in range(U(12)):
            right[i, j] = half[j, U(3) + i]
        right[i, U(12)] = slope


@nb.njit(parallel=True, **FAST)
def eliminate_with_cameras(
    hessian, gradient, follow, stiffness, inner_stiffness, away, bent, weights, cameras, solved, blocks, sides, sums
):
    """As `eliminate`, with what couples the struts to the cameras, cameras (E, 12, C).

    Out: solved (E, 6, 13 + C), the solutions of the own freedoms for the joints', for the slope and for the cameras;
    blocks (E, 12, 12) and sides (E, 12, 1 + C), the slope and the coupling to the cameras of the joints' freedoms; and
    sums (S, C, 1 + C), whose sum over the parts is what the cameras' slope, and their matrix, have to be less by.
    """
    count, size, parts = hessian.shape[0], cameras.shape[2], sums.shape[0]
    for part in nb.prange(parts):
        turned, half, inner = np.empty((12, 12)), np.empty((12, 12)), np.empty((6, 6))
        for e in range(part * count // parts, (part + 1) * count // parts):
            block, side, right = blocks[e], sides[e], solved[e]
            _follow(hessian, follow, U(e), turned, half, blocks)
            _own_system(hessian, gradient, inner_stiffness, bent, weights, U(e), half, inner, right)
            for i in range(U(6)):
                for c in range(U(size)):
                    right[i, U(13) + c] = cameras[e, U(3) + i, c]
            _solve_own(inner, right, 13 + size)
            for a in range(U(12)):
                for c in range(U(size + 1)):
                    side[a, c] = 0.0
            for b in range(U(12)):
                for a in range(U(12)):
                    weight = follow[e, b, a]
                    block[b, a] += weights[0] * stiffness[e, b, a]
                    side[a, U(0)] += weight * gradient[e, b] + weights[1] * stiffness[e, b, a] * away[e, b]
                    for c in range(U(size)):
                        side[a, U(1) + c] += weight * cameras[e, b, c]
            for i in range(U(6)):
                for a in range(U(12)):
                    weight = half[a, U(3) + i]
                    for j in range(U(12)):
                        block[a, j] -= weight * right[i, j]
                    for c in range(U(size + 1)):
                        side[a, c] -= weight * right[i, U(12) + c]
                for c in range(U(size)):
                    weight = cameras[e, U(3) + i, c]
                    for d in range(U(size + 1)):
                        sums[part, c, d] += weight * right[i, U(12) + d]


@nb.njit(parallel=True, **FAST)
def in_motions(starts, rows, entries, motions, product):
    """product (6V, M) float32 = the symmetric matrix of blocks (see `frametwin.mechanics.blocks`) times motions (6V, M)
    float32."""
    size = motions.shape[1]
    for v in nb.prange(len(starts) - 1):
        first, high, sums = starts[v], starts[v + 1] - starts[v], np.empty(size)
        for i in range(6):
            for m in range(U(size)):
                sums[m] = 0.0
            for n in range(high):
                for j in range(6):
                    weight = entries[36 * first + 6 * high * i + 6 * n + j]
                    other = U(6 * rows[first + n] + j)
                    for m in range(U(size)):
                        sums[m] += weight * motions[other, m]
            row = U(6 * v + i)
            for m in range(U(size)):
                product[row, m] = sums[m]


@nb.njit(parallel=True, **FAST)
def displace(follow, edges, joints, inner, control_points, moved):
    """moved (E, 4, 3) = control points (E, 4, 3) after the joints' freedoms (V, 6) and the struts' own (E, 6)."""
    for e in nb.prange(follow.shape[0]):
        for a in range(U(12)):
            shift = 0.0
            for end in range(2):
                for j in range(U(6)):
                    shift += follow[e, a, U(6 * end) + j] * joints[U(edges[e, end]), j]
            if 3 <= a < 9:
                shift += inner[e, a - U(3)]
            moved[e, a // U(3), a % U(3)] = control_points[e, a // U(3), a % U(3)] + shift
