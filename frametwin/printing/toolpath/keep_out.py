"""How the tool comes to a strut and leaves it: along its axis out of a box around the print, then safely above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.geometry.rotation_frames import rotation_minimising_frames
from frametwin.printing.sequencing.nozzle import Nozzle

_UP = np.array([0.0, 0.0, 1.0])
_FACES = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])


def tool_rotations(axes: np.ndarray) -> np.ndarray:
    """Turn axes of the tool into rotations, with a roll that varies as little as can be.

    The tool's z points against the axis, out of the nozzle. The roll about it is that of a rotation-minimising frame
    along the arc from the vertical to the axis: neighbouring axes have neighbouring rolls, whatever came before, and
    between two of these rotations the tool leans no further than at one of them (their quaternions have no part about
    the vertical, so none of the shortest way between them has).

    Parameters
    ----------
    axes : (N, 3) array
        Unit vectors from the tip upwards, none of them straight down.

    Returns
    -------
    (N, 3, 3) array
        Columns are x, y and z of the tool.
    """
    axes = np.asarray(axes, dtype=np.float64)
    curve = np.stack([np.zeros_like(axes), np.broadcast_to(_UP, axes.shape), _UP + axes], axis=1)
    frames = rotation_minimising_frames(curve, [1.0], start_normal=np.broadcast_to([1.0, 0.0, 0.0], axes.shape))
    x, z = frames.normal[:, 0], -axes
    y = np.cross(z, x)
    return np.stack([x, y / np.linalg.norm(y, axis=1)[:, None], z], axis=2)


@dataclass(frozen=True, eq=False)
class KeepOutBox:
    """A box around what stands, of which the tool keeps out on its ways between struts.

    Attributes
    ----------
    bounds : (2, 3) array, mm
        Corners of the box.
    nozzle
        The tool.
    clearance : float, mm
        What is kept between nozzle and box.
    max_tilt : float, rad
        Of the tool while it turns at the safe height.
    """

    bounds: np.ndarray
    nozzle: Nozzle
    clearance: float
    max_tilt: float

    @property
    def safe_height(self) -> float:
        """Height of the tip at which nothing of the nozzle comes near the box, however it leans."""
        tilts = np.linspace(0.0, self.max_tilt, 91)
        axes = np.stack([np.sin(tilts), np.zeros_like(tilts), np.cos(tilts)], axis=1)
        return float(self.bounds[1, 2]) + self.clearance - min(0.0, float(self.nozzle.lowest(_UP, axes).min()))

    def stand_off(self, point: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Find the nearest point back along the axis from which the tool can go straight up.

        There all of the nozzle lies beyond one face of the box: one of its sides, or its top.

        Parameters
        ----------
        point : (3,) array, mm
            Where the tip is.
        axis : (3,) array
            Unit vector from the tip upwards.

        Returns
        -------
        (3,) array, mm
        """
        limits = np.concatenate([self.bounds[1, :2], -self.bounds[0, :2], self.bounds[1, 2:]])[[0, 2, 1, 3, 4]]
        along = _FACES @ axis
        reach = np.array([self.nozzle.lowest(face, axis) for face in _FACES])
        missing = limits + self.clearance - _FACES @ point - reach
        way = np.where(along > 1e-6, np.maximum(0.0, missing) / np.maximum(along, 1e-6), np.inf)
        return point + max(self.clearance, float(way.min())) * axis

    def hover(self, point: np.ndarray) -> np.ndarray:
        """(3,) array, mm: the point at the safe height above ``point``, or the point itself where that is higher."""
        return np.array([point[0], point[1], max(float(point[2]), self.safe_height)])
