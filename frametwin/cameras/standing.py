"""Where an object stands on the table: its place and its turn about the vertical."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


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
