"""What is in the pictures and is no print: an arm before the frame or beside it, white or dark."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier

THICK = 2.2
"""Radii of the smallest disc that fits into an intruder and into no strut."""

LEAST = 8.0
"""Side in radii of the smallest square that an intruder is as large as. Struts that cross by chance are smaller."""

AROUND = 3.0
"""Radii about what does not belong there, whose pixels do not count either."""

STILL = 2.0
"""Radii by which the print may have moved and not count as an intruder."""


def _disc(radius: float) -> np.ndarray:
    size = 2 * max(1, round(radius)) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))


def intruders(masks: Sequence[np.ndarray], drawn: Sequence[np.ndarray], radius: float) -> list[np.ndarray | None]:
    """White regions that are thicker than struts and are not where the print is.

    Parameters
    ----------
    masks, drawn : sequence of (H, W) array of float32, 0..1
        What is seen, and what the twin draws.
    radius : float, pixels
        Of the typical strut.

    Returns
    -------
    (H, W) bool for each view: the region with some room about it; ``None`` where there is none.
    """
    core, room, near = _disc(THICK * radius), _disc((THICK + AROUND) * radius), _disc(STILL * radius)
    found: list[np.ndarray | None] = []
    for mask, own in zip(masks, drawn, strict=True):
        thick = cv2.erode((mask > 0.5).astype(np.uint8), core, borderType=cv2.BORDER_CONSTANT, borderValue=(1.0,))
        if not thick.any():
            found.append(None)
            continue
        # Where many struts cross the print itself is thick.
        known = cv2.dilate(cv2.erode((own > 0.5).astype(np.uint8), core), near)
        thick[known > 0] = 0
        opened = cv2.dilate(thick, core)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
        large = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= (LEAST * radius) ** 2]
        if not large:
            found.append(None)
            continue
        region = (np.isin(labels, large) & (thick > 0)).astype(np.uint8)
        found.append(cv2.dilate(region, room) > 0)
    return found


def hidden_pixels(
    hidden: np.ndarray, points: np.ndarray, radius: np.ndarray, camera: Camera, shape: tuple[int, int]
) -> np.ndarray:
    """Pixels about pieces of strut that something dark hides from a view.

    Parameters
    ----------
    hidden : (E, P) bool array
        The pieces.
    points : (E, P+1, 3) array, mm
        Their ends.
    radius : (E,) array, mm
        Of the struts.
    camera : Camera
        Without distortion.
    shape : tuple of int
        Height and width of its picture.

    Returns
    -------
    (H, W) bool array
    """
    result = np.zeros(shape, dtype=np.uint8)
    struts, pieces = np.nonzero(hidden)
    pixels, depth = camera.project(np.stack([points[struts, pieces], points[struts, pieces + 1]], axis=1))  # (K, 2, 2)
    seen = (depth > 0.0).all(axis=1)
    ends = np.clip(np.round(pixels[seen]), -1e4, 1e4).astype(np.int64)
    width = 2.0 * (1.0 + AROUND) * radius[struts[seen]] * camera.fl_x / depth[seen].mean(axis=1)
    for (a, b), thickness in zip(ends.tolist(), np.maximum(1, np.round(width)).astype(np.int64).tolist(), strict=True):
        cv2.line(result, a, b, (1.0,), thickness)
    return result > 0


def polyline(control_points: np.ndarray, pieces: int) -> np.ndarray:
    """(E, P+1, 3) ends of pieces of equal parameter length."""
    return bezier.evaluate(control_points, np.linspace(0.0, 1.0, pieces + 1))
