"""The part of every picture that a fit has to look at: where something is white, and where the plan is."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry.wireframe import Wireframe

MARGIN, LEAST_MARGIN = 0.05, 24
"""What is kept around it: a share of its longer side, and pixels at least. Black beyond tells nothing of a print that
is neither planned nor seen there."""

WORKERS = 4
"""Pictures that are looked at together."""

WORTH = 0.8
"""Share of a picture above which it stays whole."""

LARGE, COARSE = 4_000_000, 8
"""Pixels above which a picture is looked at in blocks, and the side of these: going through all takes long."""


def cropped(
    frame: Wireframe, cameras: Sequence[Camera], masks: Sequence[np.ndarray]
) -> tuple[list[Camera], list[np.ndarray]]:
    """Cameras and masks (H, W) without rows and columns at the sides in which nothing is white and nothing planned.

    Parameters
    ----------
    frame
        The plan of what is printed.
    cameras, masks
        Without lens distortion, and 0..1.
    """
    with ThreadPoolExecutor(WORKERS) as pool:  # most of it is done by OpenCV
        pairs = list(pool.map(partial(_cropped, frame), cameras, masks))
    return [camera for camera, _ in pairs], [mask for _, mask in pairs]


def _cropped(frame: Wireframe, camera: Camera, mask: np.ndarray) -> tuple[Camera, np.ndarray]:
    planned, depth = camera.project(frame.control_points.reshape(-1, 3))
    seen = _white(mask)
    if seen is None or not (depth > 0.0).all():
        return camera, mask
    low, high = np.minimum(seen[0], planned.min(axis=0)), np.maximum(seen[1], planned.max(axis=0))
    margin = max(LEAST_MARGIN, MARGIN * float((high - low).max()))
    left, top = np.maximum(0, np.floor(low - margin)).astype(int)
    right, bottom = np.minimum([camera.width, camera.height], np.ceil(high + margin)).astype(int)
    if (right - left) * (bottom - top) > WORTH * mask.size:
        return camera, mask
    width, height = int(right - left), int(bottom - top)
    part = replace(camera, width=width, height=height, cx=camera.cx - left, cy=camera.cy - top)
    return part, mask[top:bottom, left:right]


def _white(mask: np.ndarray) -> np.ndarray | None:
    """(2, 2) first column and row of a picture in which something is white, and those after the last; ``None`` if there
    are none. Of large pictures they are told to `COARSE` pixels, on the safe side."""
    size = np.array(mask.shape[::-1])
    coarse = np.maximum(1, size // COARSE) if mask.size > LARGE else size
    small = mask if mask.size <= LARGE else cv2.resize(mask, tuple(coarse.tolist()), interpolation=cv2.INTER_AREA)
    rows, columns = (cv2.reduce(small, axis, cv2.REDUCE_MAX).ravel() for axis in (1, 0))
    white = [np.flatnonzero(line) for line in (columns, rows)]
    if not all(len(line) for line in white):
        return None
    return np.array([[line[0], line[-1] + 1] for line in white], dtype=np.float64).T * (size / coarse)
