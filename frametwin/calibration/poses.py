"""Where a board is before a camera, from one picture."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from frametwin.calibration.detection import Sighting
from frametwin.cameras.lens_models import project, rays

Floats = NDArray[np.float64]


def board_poses(model: str, lens: Floats, sighting: Sighting) -> list[tuple[float, Floats]]:
    """Poses of a board that fit a picture, the best first.

    Parameters
    ----------
    model, lens
        Of the camera.
    sighting
        The corners.

    Returns
    -------
    list of (rms, pose)
        Root mean square distance in px and the (4, 4) pose from the board's axes to the camera's. A flat board that is
        small in the picture has two; none is left where the lens cannot be inverted.
    """
    directions = rays(model, lens, sighting.pixels)
    good = np.isfinite(directions).all(axis=1) & (directions[:, 2] > 0.05)
    if good.sum() < 4:
        return []
    points = np.ascontiguousarray(sighting.points[good])
    plane = np.ascontiguousarray(directions[good, :2] / directions[good, 2:])
    flat = float(np.ptp(points[:, 2])) < 1e-9
    kind = cv2.SOLVEPNP_IPPE if flat else cv2.SOLVEPNP_SQPNP
    if flat:
        points = points - (0.0, 0.0, points[0, 2])
    camera: Any = np.eye(3)
    none: Any = None  # OpenCV's hints do not know that there may be no distortion
    try:
        count, turns, places, _ = cv2.solvePnPGeneric(points, plane, camera, none, flags=kind)
    except cv2.error:
        return []
    found = []
    for turn, place in zip(turns[:count], places[:count], strict=True):
        turn, place = cv2.solvePnPRefineLM(points, plane, camera, none, turn.copy(), place.copy())
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec(turn.ravel()).as_matrix()
        pose[:3, 3] = place.ravel()
        if flat:
            pose[:3, 3] -= pose[:3, 2] * sighting.points[good][0, 2]
        error = rms_of(model, lens, pose, sighting)
        if np.isfinite(error):
            found.append((error, pose))
    return sorted(found, key=lambda item: item[0])


def rms_of(model: str, lens: Floats, pose: Floats, sighting: Sighting) -> float:
    """Root mean square distance in px of the corners from where a pose has them; infinite behind the camera."""
    local = sighting.points @ pose[:3, :3].T + pose[:3, 3]
    if (local[:, 2] <= 0.0).any():
        return float("inf")
    left = project(model, lens, local)[0] - sighting.pixels
    return float(np.sqrt((left**2).sum(axis=1).mean()))
