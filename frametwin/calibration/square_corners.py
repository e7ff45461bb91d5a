"""Corners where four squares meet, as the crossings of the squares' edges, each edge measured along its length.

The pattern about such a corner stays the same in a half turn. What moves one arm of an edge towards the black (the
camera's tone curve, ink that spreads, a marker nearby) moves the opposite arm the other way, so it is told apart from
the place of the corner. A few pixels of blur do no harm, nor does a board that is seen steeply.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.edges import edge_profiles

Floats = NDArray[np.float64]

STATIONS = 20
"""Places along each arm at which the edge is measured."""

SAMPLES = 25
"""Across the edge at each station."""

CLEAR = 1.5
"""Pixels from the other edge in which its blur is felt."""

REACH = (1.5, 4.0)
"""Least and largest reach in px to both sides of an edge."""

LEAST_REACH = 2.0
"""The same where there is room."""

BLURS = 3.0
"""Of the blur of an edge, how many standard deviations the reach is: further out there is noise alone."""

FREE_SHARE = 0.85
"""Of what is free on both sides of an edge."""

LEAST_FREE = 0.8
"""Pixels on both sides of an edge without which nothing is measured: the board is too far away, or seen too steeply."""

ARM = (3.0, 30.0)
"""Least and largest length in px of an arm that is measured."""

ARM_SHARE = 0.5
"""How far an arm goes, in squares."""

SHARES = (0.4, 0.7, 1.0, 1.0)
"""Of the arms' length, round by round: their direction is only known from far corners at first, which lenses bend."""

FAR_OFF, FEW = 3.0, 6
"""Residuals, in medians, of stations that are left out; and how many of an arm have to be left."""

LARGEST_SHIFT = 2.0
"""Pixels from the start within which the corner has to lie."""


def square_corner(grey: NDArray[np.uint8], start: Floats, axes: Floats, square: float, free: float) -> Floats | None:
    """Measure a corner at which the edges of four squares meet.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    start : (2,) array
        The corner to about a pixel; pixel centres are whole numbers.
    axes : (2, 2) array, px/mm
        Columns: how the board's x and y look there.
    square
        Edge of a square, mm.
    free
        How far from the edges nothing else lies, mm.

    Returns
    -------
    (2,) array
        The corner; None where its edges cannot be seen.
    """
    scales = np.linalg.norm(axes, axis=0)
    directions = (axes / np.maximum(scales, 1e-12)).T
    sine = abs(_cross(directions[0], directions[1]))
    space = free * sine * scales[::-1]
    first = CLEAR / max(sine, 1e-12)
    last = np.minimum(ARM_SHARE * square * scales, first + ARM[1])
    if space.min() < LEAST_FREE or last.min() < first + ARM[0]:
        return None
    widest = np.clip(FREE_SHARE * space, *REACH)
    least = np.minimum(LEAST_REACH, widest)
    reach, place = widest, np.array(start, dtype=np.float64)
    for share in SHARES:
        normals = np.array([_normal(directions[i], directions[1 - i]) for i in range(2)])
        found = []
        for i in range(2):
            ends = (first, first + share * (last[i] - first))
            line = _crossed_edge(grey, place, directions[i], directions[1 - i], ends, reach[i])
            if line is None:
                return None
            found.append(line)
        offsets, slopes, blurs = np.array(found).T
        place = place + np.linalg.solve(normals, offsets)
        directions = directions + slopes[:, None] * normals
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        reach = np.clip(BLURS * blurs, least, widest)
        if np.linalg.norm(place - start) > LARGEST_SHIFT or abs(_cross(*directions)) < 0.5 * sine:
            return None
    return place


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _normal(along: Floats, other: Floats) -> Floats:
    """At right angles to an edge, on the side to which the other edge goes."""
    normal = np.array([-along[1], along[0]])
    return normal if normal @ other > 0.0 else -normal


def _crossed_edge(
    grey: NDArray[np.uint8], place: Floats, along: Floats, other: Floats, ends: tuple[float, float], reach: float
) -> tuple[float, float, float] | None:
    """How far across an edge lies from a place in px, its slope and its blur; another edge crosses it at the place."""
    arm = np.linspace(*ends, STATIONS)
    stations = np.concatenate([-arm[::-1], arm])
    across = np.linspace(-reach, reach, SAMPLES)
    slanted = other / (other @ _normal(along, other))  # keeps its distance from the other edge
    seen = edge_profiles(grey, place + stations[:, None, None] * along + across[:, None] * slanted, reach)
    good, side = np.isfinite(seen.positions), np.sign(stations)
    bright = [_typical(seen.contrast[good & (side == sign)]) for sign in (-1, 1)]
    if bright[0] * bright[1] >= 0.0:  # no corner of four squares: both arms have their white on the same side
        return None
    good &= seen.contrast * side * bright[1] > 0.0
    design = np.stack([np.ones_like(stations), stations, stations**2, side], axis=1)
    design = design / np.array([1.0, ends[1], ends[1] ** 2, 1.0])
    fitted = np.zeros(4)
    for _ in range(3):
        if min((good & (side == sign)).sum() for sign in (-1, 1)) < FEW:
            return None
        fitted = np.linalg.lstsq(design[good], seen.positions[good], rcond=None)[0]
        off = np.abs(np.nan_to_num(seen.positions, nan=np.inf) - design @ fitted)
        good &= off <= max(0.1, FAR_OFF * float(np.median(off[good])))
    return float(fitted[0]), float(fitted[1]) / ends[1], float(np.median(seen.blur[good]))


def _typical(values: Floats) -> float:
    return float(np.median(values)) if len(values) else 0.0
