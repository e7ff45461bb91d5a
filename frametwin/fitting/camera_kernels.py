"""Compiled loops of cameras that may move: what the terms of struts and joints in every view say of the view's camera.

Freedoms of a camera are those of `frametwin.fitting.camera_freedoms`, in its order.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

F = 10
"""Freedoms of a camera."""

HELPER: Any = {"cache": True, "fastmath": {"reassoc", "contract", "nsz"}, "error_model": "numpy", "_nrt": False}
"""Options of functions that make no array, so that references to arrays need not be counted in them. Sums may be taken
in vector registers."""


@nb.njit(**HELPER)
def _motion(px, py, pz, packed, v, scale, seen, result, column):
    """How a point must move to look as it does when camera ``v`` changes: three columns of ``result`` (F, ...).

    ``seen`` (F, 3) is room for the motion along the camera's own axes.
    """
    x = packed[v, 0] * px + packed[v, 1] * py + packed[v, 2] * pz + packed[v, 9]
    y = packed[v, 3] * px + packed[v, 4] * py + packed[v, 5] * pz + packed[v, 10]
    z = packed[v, 6] * px + packed[v, 7] * py + packed[v, 8] * pz + packed[v, 11]
    radial = (x * x + y * y) / max(z * z, 1e-12)
    seen[0, 0], seen[0, 1], seen[0, 2] = 0.0, -z, y
    seen[1, 0], seen[1, 1], seen[1, 2] = z, 0.0, -x
    seen[2, 0], seen[2, 1], seen[2, 2] = -y, x, 0.0
    seen[6, 0], seen[6, 1], seen[6, 2] = x, y, 0.0
    seen[7, 0], seen[7, 1], seen[7, 2] = scale * z / packed[v, 12], 0.0, 0.0
    seen[8, 0], seen[8, 1], seen[8, 2] = 0.0, scale * z / packed[v, 13], 0.0
    seen[9, 0], seen[9, 1], seen[9, 2] = x * radial, y * radial, 0.0
    for a in range(3):
        for f in range(F):
            result[f, column + a] = (
                packed[v, a] * seen[f, 0] + packed[v, 3 + a] * seen[f, 1] + packed[v, 6 + a] * seen[f, 2]
            )
        for f in range(3, 6):  # shifts are along the world's axes
            result[f, column + a] = -1.0 if f - 3 == a else 0.0


@nb.njit(cache=True, error_model="numpy")
def motions(points, packed, scales, result):
    """How points (P, 3) must move to look as they do when each of N cameras changes: result (N, P, 3, F)."""
    seen, motion = np.zeros((F, 3)), np.empty((F, 3))
    for v in range(len(packed)):
        for i in range(len(points)):
            _motion(points[i, 0], points[i, 1], points[i, 2], packed, v, scales[v], seen, motion, 0)
            result[v, i] = motion.T


@nb.njit(**HELPER)
def _add(hessian, gradient, item, v, size, motion, coupled, matrix, slope, coupling):
    """Add what an item's symmetric hessian (size, size) and gradient in view ``v`` say to the upper triangle of the
    camera's matrix and to its slope, and set the item's coupling to the camera.

    ``motion`` (F, size) is how the item must move with the camera, ``coupled`` (F, size) room.
    """
    for f in range(F):
        for a in range(size):
            total = 0.0
            for b in range(size):
                total += hessian[item, v, a, b] * motion[f, b]
            coupled[f, a] = total
        total = 0.0
        for a in range(size):
            total += motion[f, a] * gradient[item, v, a]
        slope[v, f] += total
    for f in range(F):
        for g in range(f, F):
            total = 0.0
            for a in range(size):
                total += motion[f, a] * coupled[g, a]
            matrix[v, f, g] += total
    for a in range(size):
        for f in range(F):
            coupling[item, a, v, f] = coupled[f, a]


@nb.njit(parallel=True, cache=True, error_model="numpy")
def camera_terms(
    curves,
    points,
    hessian,
    gradient,
    joint_hessian,
    joint_gradient,
    packed,
    scales,
    matrix,
    slope,
    struts,
    joints,
):
    """Terms of N cameras from those of every strut and joint in every view.

    curves (E, 4, 3) and points (V, 3) mm; hessian (E, N, 12, 12), gradient (E, N, 12), joint_hessian (V, N, 3, 3) and
    joint_gradient (V, N, 3) of the loss; packed (N, 17) and scales (N,) of the cameras. Out: matrix (N, F, F) and slope
    (N, F) of the cameras, struts (E, 12, N, F) and joints (V, 3, N, F) how these are coupled to them.
    """
    for v in nb.prange(len(packed)):
        seen, motion, coupled = np.zeros((F, 3)), np.empty((F, 12)), np.empty((F, 12))
        for f in range(F):
            slope[v, f] = 0.0
            for g in range(F):
                matrix[v, f, g] = 0.0
        for e in range(len(curves)):
            for k in range(4):
                x, y, z = curves[e, k, 0], curves[e, k, 1], curves[e, k, 2]
                _motion(x, y, z, packed, v, scales[v], seen, motion, 3 * k)
            _add(hessian, gradient, e, v, 12, motion, coupled, matrix, slope, struts)
        for i in range(len(points)):
            _motion(points[i, 0], points[i, 1], points[i, 2], packed, v, scales[v], seen, motion, 0)
            _add(joint_hessian, joint_gradient, i, v, 3, motion, coupled, matrix, slope, joints)
        for f in range(F):
            for g in range(f):
                matrix[v, f, g] = matrix[v, g, f]


@nb.njit(cache=True, error_model="numpy")
def add_rows(rows, parts, total):
    """Add rows of parts (E, 12, M) to those of a total (R, M) that have the numbers ``rows`` (E, 12)."""
    for e in range(len(rows)):
        for a in range(12):
            row = rows[e, a]
            for m in range(total.shape[1]):
                total[row, m] += parts[e, a, m]
