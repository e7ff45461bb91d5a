"""Prints with struts that are bent as no cubic can be."""

from __future__ import annotations

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

CORNERS = np.linspace(0.0, 1.0, 5)


def bowed(curve: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The quartic (5, 3) that is off a cubic (4, 3) by 16 s^2 (1 - s)^2 times ``by``: clamped, and off by it midway."""
    quartic = bezier.elevate(curve, 4)
    quartic[2] += 16.0 / 6.0 * by
    return quartic


def with_pieces(frame: Wireframe, quartics: dict[int, np.ndarray]) -> Wireframe:
    """The frame with some struts along other curves, each as four cubics with the places and slopes of its curve."""
    kept = np.setdiff1d(np.arange(frame.strut_count), list(quartics))
    vertices, edges, curves = list(frame.vertices), frame.edges[kept].tolist(), list(frame.control_points[kept])
    radius = frame.radius[kept].tolist()
    for strut, quartic in quartics.items():
        points, slopes = bezier.evaluate(quartic, CORNERS), bezier.derivative(quartic, CORNERS) / 12.0
        start, end = frame.edges[strut]
        joints = [start, *(len(vertices) + np.arange(3)), end]
        vertices += list(points[1:4])
        for i in range(4):
            edges.append(joints[i : i + 2])
            curves.append(np.stack([points[i], points[i] + slopes[i], points[i + 1] - slopes[i + 1], points[i + 1]]))
            radius.append(frame.radius[strut])
    return Wireframe.create(vertices, np.array(edges), radius=radius, control_points=np.array(curves))
