"""Unprinted struts moved to meet the printed ones (paper, Sec. III.B)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

SAMPLES = 10
"""Intervals of the curve parameter at which the field moves a strut."""


def blend(
    frame: Wireframe,
    twin_vertices: np.ndarray,
    twin_control_points: np.ndarray,
    displacement: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Curves of the whole frame: printed struts as the twin has them, the others blended towards them.

    A strut with both ends on printed struts moves with the field; with one end there, it moves by the share u of the
    field that grows from 0 at its free end to 1 at the printed one; with none, it stays as planned. The field meets
    the twin's joints nearly; what is left is spread along the strut in the same proportion, so that every shared
    joint closes exactly.

    Parameters
    ----------
    frame
        The plan.
    twin_vertices
        (V, 3) mm; only those of printed struts are read.
    twin_control_points
        (E, 4, 3) mm; only those of printed struts are read.
    displacement
        The field: (N, 3) mm to (N, 3) mm.

    Returns
    -------
    (V, 3) vertices and (E, 4, 3) control points in mm.
    """
    held = frame.printed_vertices()
    vertices = np.where(held[:, None], twin_vertices, frame.vertices)
    control_points = np.array(np.where(frame.printed[:, None, None], twin_control_points, frame.control_points))
    moving = np.flatnonzero(~frame.printed & held[frame.edges].any(axis=1))
    if len(moving):
        control_points[moving] = _moved(frame, vertices, held, moving, displacement)
    for side, corner in ((0, 0), (1, 3)):
        control_points[:, corner] = vertices[frame.edges[:, side]]
    return vertices, control_points


def _moved(
    frame: Wireframe,
    vertices: np.ndarray,
    held: np.ndarray,
    struts: np.ndarray,
    displacement: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    u = np.linspace(0.0, 1.0, SAMPLES + 1)
    points = bezier.evaluate(frame.control_points[struts], u)  # (S, m + 1, 3)
    field = displacement(points.reshape(-1, 3)).reshape(points.shape)
    start, end = (held[frame.edges[struts, side]][:, None] for side in (0, 1))
    share = np.where(start & end, 1.0, np.where(end, u, 1.0 - u))  # (S, m + 1)
    gap = [vertices[frame.edges[struts, side]] - points[:, k] - field[:, k] for side, k in ((0, 0), (1, -1))]
    rest = np.where(start, 1.0 - u, 0.0)[..., None] * gap[0][:, None]
    rest = rest + np.where(end, u, 0.0)[..., None] * gap[1][:, None]
    # The refit of what changed, not of the moved points: where nothing changes, the same bits come out.
    change = np.einsum("cj,sjx->scx", bezier.refit_matrix(SAMPLES), share[..., None] * field + rest)
    return frame.control_points[struts] + change
