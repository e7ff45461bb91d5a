"""The directions that the tool's axis may take: rings about the vertical."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

SPACING = np.radians(15.0)
"""Between neighbouring directions."""


def tool_directions(max_tilt: float, spacing: float = SPACING) -> np.ndarray:
    """Spread directions of the tool's axis over a cap about the vertical.

    Parameters
    ----------
    max_tilt : float, rad
        Largest angle from the vertical.
    spacing : float, rad
        Angle between neighbours, about.

    Returns
    -------
    (D, 3) array
        Unit vectors from the tip upwards, the vertical one first.
    """
    rings = [np.array([[0.0, 0.0, 1.0]])]
    count = int(np.floor(max_tilt / spacing + 1e-9))
    tilts = [spacing * (k + 1) for k in range(count)]
    if max_tilt - count * spacing > 0.3 * spacing:
        tilts.append(max_tilt)
    for k, tilt in enumerate(tilts):
        around = max(4, round(2.0 * np.pi * np.sin(tilt) / spacing))
        angle = 2.0 * np.pi * (np.arange(around) + 0.5 * (k % 2)) / around
        height = np.full(around, np.cos(tilt))
        rings.append(np.stack([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), height], axis=1))
    return np.concatenate(rings)


def neighbours(directions: np.ndarray, spacing: float = SPACING) -> np.ndarray:
    """Find directions that are next to each other.

    Parameters
    ----------
    directions : (D, 3) array
        Unit vectors.
    spacing : float, rad
        As they were spread with.

    Returns
    -------
    (D, D) bool array
        ``False`` on the diagonal.
    """
    reach = 2.0 * np.sin(0.5 * 1.3 * spacing)
    near = np.zeros((len(directions),) * 2, dtype=bool)
    for i, found in enumerate(cKDTree(directions).query_ball_point(directions, reach)):
        near[i, found] = True
    np.fill_diagonal(near, False)
    return near
