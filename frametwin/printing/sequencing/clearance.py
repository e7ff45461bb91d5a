"""Which struts the nozzle would hit while it lays another one, for every way of holding it.

While a straight piece of strut is laid with the tool's axis fixed, the vector from the tip to a point of another
straight piece is affine in the two parameters, and the distance from it to a part of the nozzle changes by no more than
it does. So one value in the middle of a cell of parameters bounds all of the cell: cells are halved till they are known
to be free, to lie within the bead, or to hold a collision. What is undecided at the finest cells counts as a collision.
Curved struts are cut into chords, and the bound on what lies between chord and curve is added to the rods' radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.flattening import chord_error, chords_needed
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.nozzle_kernels import fill_bits, fill_hits, mark_joined
from frametwin.progress import Progress, ProgressCallback, report

FINEST = 0.05
"""Smallest cells of the search, in strut radii: by so much too careful the answer may be."""

FLATNESS = 0.1
"""How far curves may leave their chords, in strut radii."""

JOINED = 1.05
"""Struts nearer to each other than this many sums of their radii run into each other: the design joins them."""

BLOCK = 64
"""Struts between two reports of progress."""


@dataclass(frozen=True, eq=False)
class Rods:
    """The struts of a frame as chains of straight pieces.

    Attributes
    ----------
    start, end
        (P, 3) ends of the pieces, mm, in the order of the struts and along them.
    first
        (E + 1,) the pieces of strut k are ``first[k]`` to ``first[k + 1]``.
    thickness
        (E,) radius, and how far the curve may leave its pieces.
    slack
        (E,) the latter alone.
    centre, reach
        (E, 3) and (E,): a ball about each strut's centreline, with the slack.
    """

    start: np.ndarray
    end: np.ndarray
    first: np.ndarray
    thickness: np.ndarray
    slack: np.ndarray
    centre: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, control_points: np.ndarray, radius: np.ndarray) -> Rods:
        """Cut curves (E, 4, 3) of ``radius`` (E,)."""
        counts = np.maximum(1, np.ceil(chords_needed(control_points, FLATNESS * radius))).astype(np.int64)
        first = np.concatenate([[0], np.cumsum(counts)])
        start, end = np.empty((first[-1], 3)), np.empty((first[-1], 3))
        for count in np.unique(counts):
            struts = np.flatnonzero(counts == count)
            points = bezier.evaluate(control_points[struts], np.linspace(0.0, 1.0, count + 1))  # (n, count + 1, 3)
            at = first[struts][:, None] + np.arange(count)
            start[at], end[at] = points[:, :-1], points[:, 1:]
        slack = chord_error(control_points, counts)
        centre = 0.5 * (control_points.min(axis=1) + control_points.max(axis=1))
        reach = np.linalg.norm(control_points - centre[:, None], axis=2).max(axis=1)
        return cls(start, end, first, radius + slack, slack, centre, reach + slack)

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """As the compiled loops take them."""
        return self.start, self.end, self.first, self.thickness, self.slack, self.centre, self.reach


def joined_struts(frame: Wireframe, rods: Rods | None = None) -> np.ndarray:
    """(E, E) bool: two struts share a joint, or run into each other as designed; never a strut and itself."""
    rods = Rods.of(frame.control_points, frame.radius) if rods is None else rods
    joined = np.zeros((frame.strut_count,) * 2, dtype=bool)
    mark_joined(frame.edges, frame.radius, rods.arrays, JOINED, joined)
    return joined


def collision_bits(
    frame: Wireframe,
    nozzle: Nozzle,
    axes: np.ndarray,
    wanted: np.ndarray,
    joined: np.ndarray,
    progress: ProgressCallback | None = None,
) -> np.ndarray:
    """Find the struts that the nozzle would hit, were they printed.

    Parameters
    ----------
    frame
        The struts, at the places at which they are or will be.
    nozzle
        The tool.
    axes
        (D, 3) unit vectors, the ways of holding it.
    wanted
        (E, D) bool: which strut is to be looked at with which axis.
    joined
        (E, E) bool, see `joined_struts`: the nozzle may touch these within its bead.
    progress
        Called about every `BLOCK` struts.

    Returns
    -------
    (E, D, W) uint64; bit ``j % 64`` of word ``j // 64`` tells that strut j is hit. Rows not wanted are zero.
    """
    rods = Rods.of(frame.control_points, frame.radius)
    bits = np.zeros((frame.strut_count, len(axes), (frame.strut_count + 63) // 64), dtype=np.uint64)
    settings = np.array([nozzle.bead, nozzle.clearance, FINEST * float(np.median(frame.radius))])
    for begin in range(0, frame.strut_count, BLOCK):
        report(progress, Progress("looking for collisions", begin, frame.strut_count))
        end = min(frame.strut_count, begin + BLOCK)
        fill_bits(begin, end, rods.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, wanted, joined, bits)
    return bits


def struts_hit(
    frame: Wireframe, nozzle: Nozzle, struts: np.ndarray, axes: np.ndarray, before: np.ndarray, joined: np.ndarray
) -> np.ndarray:
    """Find what is hit while some struts are laid, with axes of their own.

    Parameters
    ----------
    frame, nozzle
        Where the struts are, and the tool.
    struts
        (N,) the struts to lay.
    axes
        (N, D, 3) ways of holding the tool for each.
    before
        (N, E) bool: what is there when it is laid.
    joined
        (N, E) bool: what it is joined to, see `joined_struts`.

    Returns
    -------
    (N, D, E) bool.
    """
    rods = Rods.of(frame.control_points, frame.radius)
    hits = np.zeros((len(struts), axes.shape[1], frame.strut_count), dtype=bool)
    settings = np.array([nozzle.bead, nozzle.clearance, FINEST * float(np.median(frame.radius))])
    fill_hits(struts, rods.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, before, joined, hits)
    return hits


def hit_struts(bits: np.ndarray, count: int) -> np.ndarray:
    """(..., count) bool from the words (..., W) of `collision_bits`."""
    words = np.ascontiguousarray(bits).astype("<u8").view(np.uint8)
    return np.unpackbits(words, axis=-1, bitorder="little")[..., :count].astype(bool)
