"""Surface normals of round struts as a camera sees them, without a renderer.

Across a strut the normal turns from one rim through the side that faces the camera to the other rim, by the arc sine
of the offset from the centreline in radii. Pixels a little outside have the normal of the nearest rim, so that a
picture in which the struts lie a little elsewhere finds normals too.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

CHORDS = 12
"""Straight pieces of a strut."""


@nb.njit(cache=True, nogil=True)
def _turn(pixels, depth, radius, across, facing, reach, beyond, nearest, normals):
    """Into normals (H, W, 3), nearest and beyond (H, W): pieces between points (E, n, ..) of each strut.

    A strut that covers a pixel goes before one that does not, of two that cover it the nearer one, of two that do not
    the one whose rim is nearer, in radii.
    """
    height, width = nearest.shape
    for strut in range(pixels.shape[0]):
        for k in range(pixels.shape[1] - 1):
            ra, rb = radius[strut, k], radius[strut, k + 1]
            za, zb = depth[strut, k], depth[strut, k + 1]
            if za <= 0.0 or zb <= 0.0:
                continue
            ax, ay = pixels[strut, k, 0], pixels[strut, k, 1]
            bx, by = pixels[strut, k + 1, 0], pixels[strut, k + 1, 1]
            room = max(ra, rb) + reach
            if max(ax, bx) < -room or min(ax, bx) > width + room or max(ay, by) < -room or min(ay, by) > height + room:
                continue
            ex, ey = bx - ax, by - ay
            length = np.sqrt(ex * ex + ey * ey)
            first, last = max(0, int(min(ay, by) - room)), min(height - 1, int(max(ay, by) + room))
            left, right = max(0, int(min(ax, bx) - room)), min(width - 1, int(max(ax, bx) + room))
            for row in range(first, last + 1):
                for column in range(left, right + 1):
                    px, py = column + 0.5 - ax, row + 0.5 - ay
                    t = 0.0
                    if length > 1e-6:
                        t = min(1.0, max(0.0, (px * ex + py * ey) / (length * length)))
                    qx, qy = px - t * ex, py - t * ey
                    r = ra + t * (rb - ra)
                    away = np.sqrt(qx * qx + qy * qy)
                    if away > r + reach:
                        continue
                    out = max(0.0, away / r - 1.0)
                    z = za + t * (zb - za)
                    if out > beyond[row, column] or (
                        out == beyond[row, column] and (out > 0.0 or z >= nearest[row, column])
                    ):
                        continue
                    beyond[row, column], nearest[row, column] = out, z
                    side = 0.0
                    if length > 1e-6:
                        side = min(1.0, max(-1.0, (ex * qy - ey * qx) / (length * r)))
                    ahead = np.sqrt(1.0 - side * side)
                    for e in range(3):
                        normals[row, column, e] = side * (
                            (1.0 - t) * across[strut, k, e] + t * across[strut, k + 1, e]
                        ) + ahead * ((1.0 - t) * facing[strut, k, e] + t * facing[strut, k + 1, e])


def surface_normals(
    frame: Wireframe, camera: Camera, reach: float = 0.0, curves: np.ndarray | None = None
) -> np.ndarray:
    """Normals of a frame's printed struts at each pixel of a view.

    Parameters
    ----------
    frame
        The frame.
    camera
        Without lens distortion.
    reach : pixels
        How far beyond their outlines the struts' rims are carried on.
    curves
        (E, n + 1, 3) mm, where the struts are, such as `Twin.curves`; those of ``frame`` by default.

    Returns
    -------
    (H, W, 3) float32 array
        Unit vectors in the world, 0 where no strut is.
    """
    steps = np.linspace(0.0, 1.0, CHORDS + 1)
    curves = (frame.control_points if curves is None else curves)[frame.printed]
    points = np.einsum("jk,ekx->ejx", bezier.bernstein(curves.shape[1] - 1, steps), curves)
    normals = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
    if not len(points):
        return normals
    tangents = _unit(np.gradient(points, axis=1))
    sight = camera.centre - points
    facing = _unit(sight - (sight * tangents).sum(axis=-1, keepdims=True) * tangents)
    pixels, depth = camera.project(points.reshape(-1, 3))
    pixels, depth = pixels.reshape(*points.shape[:2], 2), depth.reshape(points.shape[:2])
    radius = frame.radius[frame.printed][:, None] * camera.fl_x / np.maximum(depth, 1e-9)
    beyond, nearest = (np.full((camera.height, camera.width), np.inf) for _ in range(2))
    _turn(pixels, depth, radius, np.cross(tangents, facing), facing, float(reach), beyond, nearest, normals)
    return np.asarray(_unit(normals), dtype=np.float32)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of length 1; those of length 0 stay."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))
