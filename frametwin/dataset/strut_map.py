"""Which strut every pixel of a view sees, and how much of it the print covers, painted from samples along the struts.

This works through any lens, and in processes that were forked off one in which compiled code runs in parallel, as the
workers of torch's loaders are. Where a dataset has the pass of strut indices, that is exact; this is for those without.
"""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.cameras import Camera

_SHIFT = 4
"""Binary digits of a pixel's fraction that OpenCV is told."""

_FAR = 1e5
"""Coordinates in px beyond which nothing is drawn."""

_FINER_MAP, _FINER_SHARE = 3, 4
"""How many times larger pictures are painted."""

_RIM = 0.5
"""In px of what is painted: OpenCV also fills pixels that an outline touches, so outlines are drawn inside by this."""


def strut_map(points: np.ndarray, radius: np.ndarray, present: np.ndarray, camera: Camera) -> np.ndarray:
    """Which strut the middle of each pixel sees.

    Parameters
    ----------
    points : (E, S, 3) array, mm
        Samples along the struts.
    radius : (E, S) array, mm
        There.
    present : (E, S) bool array
        Whether the strut is there; pieces between two samples that are there are painted.
    camera : Camera
        With its lens.

    Returns
    -------
    (H, W) int32 array
        The strut, -1 where there is none. Outlines are right to a part of a pixel.
    """
    drawn = np.full((_FINER_MAP * camera.height, _FINER_MAP * camera.width), -1, dtype=np.int32)
    _paint(drawn, points, radius, present, camera, np.arange(len(points)))
    middles = slice(_FINER_MAP // 2, None, _FINER_MAP)
    return np.ascontiguousarray(drawn[middles, middles])


def covered_share(points: np.ndarray, radius: np.ndarray, present: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) float32 share 0 to 1 of each pixel that struts cover; parameters as for `strut_map`."""
    drawn = np.zeros((_FINER_SHARE * camera.height, _FINER_SHARE * camera.width), dtype=np.uint8)
    _paint(drawn, points, radius, present, camera, np.ones(len(points)))
    blocks = drawn.reshape(camera.height, _FINER_SHARE, camera.width, _FINER_SHARE)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def _paint(
    drawn: np.ndarray,
    points: np.ndarray,
    radius: np.ndarray,
    present: np.ndarray,
    camera: Camera,
    values: np.ndarray,
) -> None:
    """Paint struts into a picture with their (E,) values, from the furthest piece to the nearest."""
    camera = camera.resized(drawn.shape[1], drawn.shape[0])
    points = np.asarray(points, dtype=np.float64)
    sides = _sides(points, np.asarray(radius, dtype=np.float64), camera)
    middle, depth = camera.project(points)
    across = camera.project(points + sides)[0] - middle
    reach = np.linalg.norm(across, axis=-1)
    across = across * (np.maximum(reach - _RIM, 0.0) / np.where(reach > 0.0, reach, 1.0))[..., None]
    left, right = middle + across, middle - across
    fine = present & (depth > 0.0) & (np.abs(np.concatenate([left, right], axis=-1)) < _FAR).all(axis=-1)
    struts, pieces = np.nonzero(fine[:, :-1] & fine[:, 1:])
    ends = [left[struts, pieces], left[struts, pieces + 1], right[struts, pieces + 1], right[struts, pieces]]
    quads, centres = _fixed(np.stack(ends, axis=1)), _fixed(np.where(fine[..., None], middle, 0.0))
    caps = np.rint(np.where(fine, np.maximum(reach - _RIM, 0.0), 0.0) * 2**_SHIFT).astype(int)
    padded = np.pad(fine, ((0, 0), (1, 1)))
    is_end = fine & ~(padded[:, :-2] & padded[:, 2:])  # round there, as the sphere that is swept along the curve
    for k in np.argsort(-(depth[struts, pieces] + depth[struts, pieces + 1]), kind="stable"):
        e, s = struts[k], pieces[k]
        value = (float(values[e]),)
        cv2.fillConvexPoly(drawn, quads[k], value, cv2.LINE_8, _SHIFT)
        for end in (s, s + 1):
            if is_end[e, end]:
                x, y = centres[e, end].tolist()
                cv2.circle(drawn, (x, y), int(caps[e, end]), value, -1, cv2.LINE_8, _SHIFT)


def _fixed(pixels: np.ndarray) -> np.ndarray:
    """Where OpenCV, whose pixel centres lie at whole numbers, draws pixels (..., 2)."""
    return np.rint((pixels - 0.5) * 2**_SHIFT).astype(np.int32)


def _sides(points: np.ndarray, radius: np.ndarray, camera: Camera) -> np.ndarray:
    """(E, S, 3) mm from each sample to the side of the strut, square to the strut and to the ray."""
    rays = points - camera.centre
    along = np.gradient(points, axis=1)
    side = np.cross(along, rays)
    length = np.linalg.norm(side, axis=-1, keepdims=True)
    spare = np.cross(camera.camera_to_world[:3, 1], rays)  # where the strut runs along the ray, any will do
    spare /= np.linalg.norm(spare, axis=-1, keepdims=True)
    least = 1e-9 * np.linalg.norm(along, axis=-1, keepdims=True) * np.linalg.norm(rays, axis=-1, keepdims=True)
    return radius[..., None] * np.where(length > least, side / np.where(length > 0.0, length, 1.0), spare)
