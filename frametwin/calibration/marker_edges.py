"""Corners of single markers as the crossings of their straight edges, each edge measured along its length.

A corner of a square is rounded off by blur, and corner operators follow the rounding; its edges are not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.edges import edge_profiles

Floats = NDArray[np.float64]

STATIONS = 24
"""Places along an edge at which it is measured."""

ALONG = (0.12, 0.88)
"""The part of an edge that the blur of its ends does not reach."""

SAMPLES = 33
"""Across the edge at each station."""

ROUNDS = 3


def edge_corners(grey: NDArray[np.uint8], ring: Floats, modules: int) -> Floats | None:
    """Measure the corners of a black marker on white.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    ring : (4, 2) array
        The corners to about a pixel, clockwise from the marker's top left; pixel centres are whole numbers.
    modules
        How many the marker has along an edge, its black border counted.

    Returns
    -------
    (4, 2) array
        The corners; None where an edge cannot be seen.
    """
    corners = np.array(ring, dtype=np.float64)
    for _ in range(ROUNDS):
        lines = [_edge(grey, corners[i], corners[(i + 1) % 4], modules) for i in range(4)]
        if any(line is None for line in lines):
            return None
        moved = np.array([_crossing(lines[i - 1], lines[i]) for i in range(4)])
        if not np.isfinite(moved).all() or np.linalg.norm(moved - ring, axis=1).max() > _reach(ring, modules):
            return None
        corners = moved
    return corners


def _reach(ring: Floats, modules: int) -> float:
    """Pixels on each side of an edge in which nothing else lies: two thirds of a module."""
    return float(0.67 * np.linalg.norm(ring - np.roll(ring, -1, axis=0), axis=1).min() / modules)


def _edge(grey: NDArray[np.uint8], begin: Floats, end: Floats, modules: int) -> Floats | None:
    """The line a x + b y = c through an edge, with white on its left when one walks clockwise; (3,) a, b, c."""
    along = end - begin
    length = float(np.linalg.norm(along))
    if length < 2.0 * modules:
        return None
    outward = np.array([along[1], -along[0]]) / length  # rows grow downwards: clockwise on the sheet is so here too
    reach = 0.67 * length / modules
    across = np.linspace(-reach, reach, SAMPLES)
    middles = begin + np.linspace(*ALONG, STATIONS)[:, None] * along
    places = middles[:, None] + across[:, None] * outward
    seen = edge_profiles(grey, places, reach)
    good = np.isfinite(seen.positions) & (seen.contrast > 0.0)
    if good.sum() < STATIONS // 2:
        return None
    points = middles[good] + seen.positions[good, None] * outward
    return _robust_line(points)


def _robust_line(points: Floats) -> Floats:
    """Total least squares, twice: the second time without what lies far off."""
    chosen = np.ones(len(points), dtype=bool)
    for _ in range(2):
        middle = points[chosen].mean(axis=0)
        _, _, axes = np.linalg.svd(points[chosen] - middle)
        normal = axes[1]
        off = np.abs((points - middle) @ normal)
        chosen = off <= max(0.05, 2.5 * float(np.median(off)))
    return np.array([*normal, normal @ middle])


def _crossing(first: Floats | None, second: Floats | None) -> Floats:
    assert first is not None and second is not None
    matrix = np.array([first[:2], second[:2]])
    if abs(np.linalg.det(matrix)) < 1e-3:
        return np.full(2, np.nan)
    return np.linalg.solve(matrix, np.array([first[2], second[2]]))
