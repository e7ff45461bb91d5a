"""Tool orientations that serve for a strut, whatever is printed: past the plate and the strut's own beginning.

A tool orientation is the direction of the tool's axis; its roll about the axis does not matter, as the nozzle is a body
of revolution.
"""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.nozzle_kernels import spares_itself

DOWNWARDS = 0.5
"""What it costs to lay a strut straight downwards rather than upwards, in shares of the largest tilt."""

STEP = 0.5
"""Distance between the points of a strut that are looked at, in strut radii."""


def plate_height(frame: Wireframe) -> float:
    """Height of the build plate in mm: what lies lowest rests on it with its radius."""
    ends = frame.edges[frame.grounded[frame.edges].any(axis=1)]
    lowest = frame.vertices[frame.grounded, 2].min() if len(ends) else frame.bounds[0, 2]
    return float(min(lowest, frame.bounds[0, 2])) - float(np.median(frame.radius))


def allowed_orientations(
    frame: Wireframe, nozzle: Nozzle, axes: np.ndarray, struts: np.ndarray | None = None
) -> np.ndarray:
    """Find the tool orientations that spare the plate and the part of the strut that is laid already.

    Parameters
    ----------
    frame, nozzle
        The struts and the tool.
    axes : (D, 3) array
        Unit vectors, the orientations to try.
    struts : (N,) int64 array, optional
        Those that are looked at, all E by default.

    Returns
    -------
    (N, D, 2) bool array
        Strut, orientation, and the end at which the strut is begun: its first or its second.
    """
    struts = np.arange(frame.strut_count) if struts is None else struts
    curves, radius = frame.control_points[struts], frame.radius[struts]
    low = bezier.evaluate(curves, np.linspace(0.0, 1.0, 17))[..., 2].min(axis=1)  # (N,)
    drop = np.minimum(0.0, nozzle.lowest(np.array([0.0, 0.0, 1.0]), axes))  # (D,)
    above = low[:, None] + drop >= plate_height(frame) - 1e-9 * frame.extent
    counts = np.maximum(2, np.ceil(frame.lengths[struts] / (STEP * radius))).astype(np.int64)
    result = np.zeros((len(struts), len(axes), 2), dtype=bool)
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        points = bezier.evaluate(curves[chosen], np.linspace(0.0, 1.0, count + 1))
        gap = np.linalg.norm(np.diff(points, axis=1), axis=2).max(axis=1)
        margin = radius[chosen] + nozzle.clearance + 0.5 * gap  # points between the samples are that far at most
        for side in range(2):
            directed = np.ascontiguousarray(points[:, ::-1] if side else points)
            result[chosen, :, side] = spares_itself(directed, margin, axes, nozzle.profile, nozzle.bead)
    return result & above[:, :, None]


def orientation_costs(frame: Wireframe, axes: np.ndarray) -> np.ndarray:
    """Find what it costs to lay each strut with each tool orientation, from each end: the tool's tilt, and going down.

    Parameters
    ----------
    frame
        The struts.
    axes : (D, 3) array
        Unit vectors.

    Returns
    -------
    (E, D, 2) array
        In shares of the largest tilt; indices as of `allowed_orientations`.
    """
    tilt = np.arccos(np.clip(axes[:, 2], -1.0, 1.0))
    chord = frame.control_points[:, 3] - frame.control_points[:, 0]
    down = -chord[:, 2] / np.linalg.norm(chord, axis=1)
    down = np.stack([down, -down], axis=1)
    return tilt[None, :, None] / max(float(tilt.max()), 1e-9) + DOWNWARDS * np.maximum(0.0, down)[:, None, :]
