"""Poses of objects: by their place and their turn about the vertical, and as files give them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import checked_array
from frametwin.errors import InputError


def standing_at(values: Sequence[float]) -> NDArray[np.float64]:
    """The pose of an object from its place and its turn.

    Parameters
    ----------
    values
        X, y, z in mm and, if given, the turn about z in degrees.

    Returns
    -------
    (4, 4) array, mm
        From the object's axes to the robot's.
    """
    pose = np.eye(4)
    angle = np.radians(values[3]) if len(values) > 3 else 0.0
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[:3, 3] = values[:3]
    return pose


def rigid_pose(value: Any, path: Path, place: str, remedy: str) -> NDArray[np.float64]:
    """The pose (4, 4) that stands at a place of a file.

    Raises
    ------
    InputError
        If it is not rigid, with the remedy.
    """
    pose: NDArray[np.float64] = checked_array(value, "f", (4, 4), str(path), place)
    rotation = pose[:3, :3]
    rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6 and np.linalg.det(rotation) > 0.0
    if not rigid or not np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0]):
        raise InputError.at(path, place, "is not a rigid pose", remedy)
    return pose
