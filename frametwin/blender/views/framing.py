"""How a 3D view has to look for something to be seen whole in the part of it that no sidebar or header covers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

MARGIN = 1.2
"""How much larger than what is to be seen the part of the view is that it gets."""

BORDER = 4
"""Pixels that stay free around the picture of a camera."""

SENSOR = 36.0
"""Mm; with the lens of a view this is half of what its longer side sees, as Blender has it."""

LEAST_ZOOM, MOST_ZOOM = -30.0, 600.0


@dataclass(frozen=True)
class Room:
    """A view and the part of it that is free, in pixels from its lower left corner.

    Attributes
    ----------
    width, height
        Of the view.
    left, right, low, high
        Of the free part.
    """

    width: float
    height: float
    left: float
    right: float
    low: float
    high: float

    @classmethod
    def of(cls, regions: Iterable[Any], width: float | None = None) -> Room:
        """The room of a 3D view with these regions, which lie over each other if the user's preferences say so.

        Parameters
        ----------
        regions
            Of the area.
        width
            Of the view, where it has been divided a moment ago and its regions do not know yet.
        """
        regions = list(regions)
        view = next(region for region in regions if region.type == "WINDOW")
        taken = dict.fromkeys(("LEFT", "RIGHT", "TOP", "BOTTOM"), 0.0)
        for region in regions:
            over = view.x <= region.x < view.x + view.width and view.y <= region.y < view.y + view.height
            if region.type != "WINDOW" and over and min(region.width, region.height) > 1 and region.alignment in taken:
                taken[region.alignment] += region.width if region.alignment in ("LEFT", "RIGHT") else region.height
        wide, high = view.width if width is None else width, view.height
        room = cls(
            wide, high, taken["LEFT"], wide - taken["RIGHT"], taken["BOTTOM"], high - taken["TOP"]
        )  # fmt: skip
        enough = room.right - room.left > 0.2 * wide and room.high - room.low > 0.2 * high
        return room if enough else cls(wide, high, 0.0, wide, 0.0, high)

    @property
    def aside(self) -> tuple[float, float]:
        """How far the middle of the free part is to the right of that of the view, and above it."""
        return 0.5 * (self.left + self.right - self.width), 0.5 * (self.low + self.high - self.height)


def camera_view(room: Room, size: tuple[float, float], sensor_fit: str = "AUTO") -> tuple[float, tuple[float, float]]:
    """``view_camera_zoom`` and ``view_camera_offset`` with which a camera's whole picture fills the free part.

    Parameters
    ----------
    room
        Of the view.
    size
        Width and height of the picture.
    sensor_fit
        Of the camera.
    """
    width, height = size
    if sensor_fit == "HORIZONTAL" or (sensor_fit == "AUTO" and width >= height):
        sides = (1.0, height / width)
    else:
        sides = (width / height, 1.0)
    fit = {"AUTO": max(room.width, room.height), "HORIZONTAL": room.width, "VERTICAL": room.height}[sensor_fit]
    factor = min(
        (room.right - room.left - BORDER) / (sides[0] * fit), (room.high - room.low - BORDER) / (sides[1] * fit)
    )
    zoom = float(np.clip((np.sqrt(4.0 * factor) - np.sqrt(2.0)) * 50.0, LEAST_ZOOM, MOST_ZOOM))
    factor = (np.sqrt(2.0) + zoom / 50.0) ** 2 / 4.0
    right, up = room.aside
    return zoom, (float(-right / (2.0 * factor * room.width)), float(-up / (2.0 * factor * room.height)))


def free_view(
    room: Room, points: np.ndarray, axes: np.ndarray, lens: float, perspective: bool, margin: float = MARGIN
) -> tuple[np.ndarray, float]:
    """``view_location`` and ``view_distance`` with which points fill the free part of a view.

    Parameters
    ----------
    room
        Of the view.
    points
        (N, 3) in the world.
    axes
        (3, 3) columns: to the right, up, towards the eye.
    lens
        Of the view in mm.
    perspective
        Or a parallel one.
    margin
        How much more than the points is to be seen.
    """
    local = points @ axes
    middle = 0.5 * (local.min(axis=0) + local.max(axis=0))
    away = margin * (local - middle)
    across, near = away[:, :2], away[:, 2:] if perspective else np.zeros((len(away), 1))
    pixel = 2.0 * SENSOR / lens / max(room.width, room.height)  # what one sees at the distance 1
    half = 0.5 * np.array([room.width, room.height])
    low, high = pixel * ([room.left, room.low] - half), pixel * ([room.right, room.high] - half)
    # An eye at (e, distance) sees a point between the slopes if low (distance - near) <= across - e <= high (...).
    bottom, top = (across + low * near).min(axis=0), (across + high * near).max(axis=0)
    distance = max(float(((top - bottom) / (high - low)).max()), 2.0 * float(near.max()))
    eye = 0.5 * (top + bottom - (low + high) * distance)
    middle[:2] += eye
    return axes @ middle, distance
