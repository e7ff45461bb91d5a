"""Frames small enough to compute by hand."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe


def interface_vertices(frame: Wireframe) -> np.ndarray:
    """(V,) bool: printed and unprinted struts meet there."""
    degree = np.bincount(frame.edges.ravel(), minlength=frame.vertex_count)
    printed = np.bincount(frame.edges[frame.printed].ravel(), minlength=frame.vertex_count)
    return (printed > 0) & (printed < degree)


def tower(levels: int = 2, curved: bool = False) -> Wireframe:
    """A square tower with one diagonal on each side, 20 mm wide, levels of 20 mm."""
    corners = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    vertices = [[x, y, 20.0 * level] for level in range(levels + 1) for x, y in corners]
    edges = []
    for level in range(levels):
        low, high = 4 * level, 4 * level + 4
        for i in range(4):
            edges += [[low + i, high + i], [high + i, high + (i + 1) % 4], [low + i, high + (i + 1) % 4]]
    frame = Wireframe.create(vertices, edges, radius=1.0, name="tower")
    if not curved:
        return frame
    curves = frame.control_points.copy()
    curves[:, 1:3] += np.random.default_rng(5).normal(scale=1.0, size=(len(edges), 2, 3))
    return frame.replace(control_points=curves)
