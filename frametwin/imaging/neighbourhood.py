"""Where in a picture a print can be at all, and how much of the picture it should cover."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

REACH = 0.1
"""How far a strut may be from its plan, as a share of the frame's longest side."""

_CHORDS = 8
_REDUCTION = 4  # the distance is measured in a picture reduced by this
_SHIFT = 4  # bits of the fraction of a pixel with which lines are placed


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """The plan as one view should show it.

    Attributes
    ----------
    near : (H, W) bool, where the print can be.
    pixels_per_mm : at the middle of the frame.
    expected : pixels that the plan would cover.
    """

    near: np.ndarray
    pixels_per_mm: float
    expected: int

    @classmethod
    def of(cls, frame: Wireframe, camera: Camera, reach: float = REACH) -> Neighbourhood:
        """What a view of a frame's printed struts should show; the camera's lens distortion is taken into account."""
        curves = frame.control_points[frame.printed]
        points = np.einsum("jk,ekx->ejx", bezier.bernstein(3, np.linspace(0.0, 1.0, _CHORDS + 1)), curves)
        pixels, depth = camera.project(points.reshape(-1, 3))
        density = float(camera.fl_y / np.median(depth[depth > 0.0]))
        ahead = (depth > 0.0).reshape(points.shape[:2]).all(axis=1)
        lines = pixels.reshape(*points.shape[:2], 2)[ahead]
        room = 4.0 * max(camera.width, camera.height)
        lines = np.clip(lines, -room, room) / _REDUCTION
        size = (-(-camera.height // _REDUCTION), -(-camera.width // _REDUCTION))
        drawn = np.zeros(size, dtype=np.uint8)
        placed = np.rint(lines * 2.0**_SHIFT).astype(np.int32)
        cv2.polylines(drawn, list(placed), False, (255.0,), 1, cv2.LINE_8, _SHIFT)
        distance = cv2.distanceTransform(255 - drawn, cv2.DIST_L2, 5) * _REDUCTION
        width = float(np.median(frame.radius[frame.printed])) * density
        whole = np.zeros((camera.height, camera.width), dtype=np.uint8)
        fine = np.rint(lines * _REDUCTION * 2.0**_SHIFT).astype(np.int32)
        cv2.polylines(whole, list(fine), False, (255.0,), max(1, round(2.0 * width)), cv2.LINE_8, _SHIFT)
        near = cv2.resize(distance, (camera.width, camera.height), interpolation=cv2.INTER_LINEAR)
        return cls(near <= reach * frame.extent * density + width, density, int(np.count_nonzero(whole)))
