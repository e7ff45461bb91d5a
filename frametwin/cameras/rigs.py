"""Camera rigs around a frame: every camera looks at it squarely and stands as near as seeing all of it allows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.cameras import Camera, look_at
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

Floats = NDArray[np.float64]

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def ring_rig(
    target: Wireframe | ArrayLike,
    count: int = 8,
    *,
    size: tuple[int, int] = (1200, 1600),
    elevation_deg: float | Sequence[float] = (20.0, 45.0),
    fov_deg: float = 40.0,
    margin: float = 0.08,
    start_deg: float = 0.0,
) -> tuple[Camera, ...]:
    """Cameras evenly spaced around the frame.

    Parameters
    ----------
    target
        The frame, or its bounding box (2, 3) in mm. Of a frame, the radius of its struts is allowed for.
    count
        Number of cameras.
    size
        Height and width of the pictures in pixels.
    elevation_deg
        Angle above the horizon; several are taken in turn. Two different ones, as by default,
        tell horizontal struts apart that a flat ring sees behind each other.
    fov_deg
        Vertical field of view.
    margin
        Free share of the picture on each side of the box.
    start_deg
        Azimuth of the first camera, from world x towards world y.

    Returns
    -------
    Cameras ``camera_00``, ``camera_01`` ..., each at the place from which the frame (or the box) fills its picture up
    to the margin, in the middle.

    Raises
    ------
    InputError
        For settings out of range.
    """
    elevations = np.atleast_1d(np.asarray(elevation_deg, dtype=np.float64))
    _check(count, size, elevations, fov_deg, margin)
    azimuth = np.radians(start_deg) + 2.0 * np.pi * np.arange(count) / count
    elevation = np.radians(elevations[np.arange(count) % elevations.size])
    return _rig(target, azimuth, elevation, size, fov_deg, margin)


def dome_rig(
    target: Wireframe | ArrayLike,
    count: int = 24,
    *,
    size: tuple[int, int] = (1200, 1600),
    elevation_deg: tuple[float, float] = (10.0, 70.0),
    fov_deg: float = 40.0,
    margin: float = 0.08,
    start_deg: float = 0.0,
) -> tuple[Camera, ...]:
    """Cameras spread evenly over a band of the upper hemisphere, on a Fibonacci spiral from low to high.

    Parameters
    ----------
    elevation_deg
        Lowest and highest angle above the horizon.
    target, count, size, fov_deg, margin, start_deg
        As for :func:`ring_rig`.

    Returns
    -------
    Cameras as from :func:`ring_rig`.

    Raises
    ------
    InputError
        For settings out of range.
    """
    bounds = np.asarray(elevation_deg, dtype=np.float64)
    _check(count, size, bounds, fov_deg, margin)
    if bounds.shape != (2,) or bounds[0] > bounds[1]:
        raise InputError.at("rig", "elevation_deg", "it is not a lowest and a highest angle", "give two, as 10 and 70")
    low, high = np.sin(np.radians(bounds))
    turn = np.arange(count)
    elevation = np.arcsin(low + (high - low) * (turn + 0.5) / count)  # equal areas of the band
    return _rig(target, np.radians(start_deg) + GOLDEN_ANGLE * turn, elevation, size, fov_deg, margin)


RIGS: dict[str, Callable[..., tuple[Camera, ...]]] = {"ring": ring_rig, "dome": dome_rig}
"""Rigs by name."""


def box_around(*frames: Wireframe) -> Floats:
    """Box (2, 3) in mm that holds all struts of all frames with their radius, printed or not."""
    low, high = zip(*((f.bounds[0] - f.radius.max(), f.bounds[1] + f.radius.max()) for f in frames), strict=True)
    return np.stack([np.min(low, axis=0), np.max(high, axis=0)])


def stepped_back(cameras: Sequence[Camera], target: Wireframe | ArrayLike, factor: float) -> tuple[Camera, ...]:
    """Cameras that stand further away from what they look at, in the same direction and with the same lens.

    Parameters
    ----------
    cameras
        As from :func:`ring_rig`.
    target
        The frame, or its bounding box (2, 3) in mm; its middle is what distances are measured to.
    factor
        Of the distance; 1 changes nothing.

    Raises
    ------
    InputError
        If the factor is not above 0.
    """
    if not (np.isfinite(factor) and factor > 0.0):
        raise InputError.at("rig", "distance", f"is {factor:g} times as far", "give a factor above 0, as 1.5")
    points, _ = _outline(target)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    moved = []
    for camera in cameras:
        pose = camera.camera_to_world.copy()
        pose[:3, 3] -= (factor - 1.0) * float((middle - camera.centre) @ camera.forward) * camera.forward
        moved.append(replace(camera, camera_to_world=pose))
    return tuple(moved)


def _rig(
    target: Wireframe | ArrayLike,
    azimuth: Floats,
    elevation: Floats,
    size: tuple[int, int],
    fov_deg: float,
    margin: float,
) -> tuple[Camera, ...]:
    points, radius = _outline(target)
    height, width = size
    focal = 0.5 * height / np.tan(np.radians(fov_deg) / 2.0)
    slope = (0.5 - margin) * np.array([width, height]) / focal  # of the sides of the cone that keeps the margin
    outward = np.column_stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    poses = []
    for direction in outward:
        pose = look_at(direction, np.zeros(3))
        local = points @ pose[:3, :3]  # (P, 3) in the camera's axes
        # A point is inside when |x - cx| <= slope (z - cz): the outermost points of both sides give the place.
        reach = radius * np.sqrt(1.0 + slope**2)
        high = (local[:, :2] - slope * local[:, 2:]).max(axis=0) + reach
        low = (local[:, :2] + slope * local[:, 2:]).min(axis=0) - reach
        depth = float(np.max((high - low) / (2.0 * slope)))
        pose[:3, 3] = pose[:3, :3] @ np.array([*(high + low) / 2.0, -depth])
        poses.append(pose)
    digits = max(2, len(str(len(poses) - 1)))
    return tuple(
        Camera(
            name=f"camera_{index:0{digits}d}",
            width=width,
            height=height,
            fl_x=focal,
            fl_y=focal,
            cx=width / 2.0,
            cy=height / 2.0,
            camera_to_world=pose,
        )
        for index, pose in enumerate(poses)
    )


def _outline(target: Wireframe | ArrayLike) -> tuple[Floats, float]:
    """Points (P, 3) whose hull holds the target, and the radius of what is about them."""
    if isinstance(target, Wireframe):
        return target.control_points.reshape(-1, 3), float(np.max(target.radius))
    bounds = np.asarray(target, dtype=np.float64)
    if bounds.shape != (2, 3) or not np.all(np.isfinite(bounds)) or np.any(bounds[0] > bounds[1]):
        raise InputError.at("rig", "bounds", "it is not a box", "give the lowest and the highest corner, (2, 3)")
    if np.all(bounds[0] == bounds[1]):
        raise InputError.at("rig", "bounds", "the box is a single point", "give the box of the whole frame")
    return np.array(list(product(*bounds.T))), 0.0


def _check(count: int, size: tuple[int, int], elevations: Floats, fov_deg: float, margin: float) -> None:
    rules = (
        ("count", count >= 1, "there must be at least one camera", "give 1 or more, 8 are usual"),
        ("size", min(size) >= 1, "the picture has no pixels", "give height and width, as 1200 and 1600"),
        (
            "elevation_deg",
            bool(elevations.size and np.all(np.abs(elevations) <= 90.0)),
            "an angle is not in -90..90",
            "give degrees above the horizon",
        ),
        (
            "fov_deg",
            0.0 < fov_deg < 180.0,
            "the field of view is not in 0..180",
            "give degrees, 40 are usual",
        ),
        (
            "margin",
            0.0 <= margin < 0.5,
            "the margin is not in 0..0.5",
            "give a share of the picture, as 0.08",
        ),
    )
    for field, fine, problem, remedy in rules:
        if not fine:
            raise InputError.at("rig", field, problem, remedy)
