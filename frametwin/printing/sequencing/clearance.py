"""Which struts the nozzle would hit while it lays another one, for every tool orientation.

While a straight piece of strut is laid with the tool's axis fixed, the vector from the tip to a point of another
straight piece is affine in the two parameters, and the distance from it to a part of the nozzle changes by no more than
it does. So one value in the middle of a cell of parameters bounds all of the cell: cells are halved till they are known
to be free, to lie within the bead, or to contain a collision. What is undecided at the finest cells counts as one.
Curved struts are cut into chords, and the bound on what lies between chord and curve is added to the radius.
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
class StrutChords:
    """The struts of a frame as chains of chords: straight pieces of rod.

    Attributes
    ----------
    start, end : (P, 3) array, mm
        Ends of the chords, in the order of the struts and along them.
    first : (E + 1,) int64 array
        The chords of strut k are ``first[k]`` to ``first[k + 1]``.
    thickness : (E,) array, mm
        Radius of each strut, and how far its curve may leave the chords.
    slack : (E,) array, mm
        The latter alone.
    centre, reach : (E, 3) and (E,) array, mm
        Centre and radius of a ball about each strut's centreline, with the slack.
    """

    start: np.ndarray
    end: np.ndarray
    first: np.ndarray
    thickness: np.ndarray
    slack: np.ndarray
    centre: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, control_points: np.ndarray, radius: np.ndarray) -> StrutChords:
        """Cut curves (E, 4, 3) of some radius (E,), all in mm."""
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


def joined_struts(frame: Wireframe, chords: StrutChords | None = None, struts: np.ndarray | None = None) -> np.ndarray:
    """Find pairs of struts that the design joins: they share a joint, or run into each other.

    Parameters
    ----------
    frame
        The design, or a plan.
    chords
        Of the frame, where they are known.
    struts : (N,) int64 array, optional
        Those whose partners are looked for, all E by default.

    Returns
    -------
    (N, E) bool array
        No strut is joined to itself.
    """
    chords = StrutChords.of(frame.control_points, frame.radius) if chords is None else chords
    struts = np.arange(frame.strut_count) if struts is None else struts
    joined = np.zeros((len(struts), frame.strut_count), dtype=bool)
    mark_joined(frame.edges, frame.radius, chords.arrays, JOINED, struts, joined)
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
    axes : (D, 3) array
        Unit vectors, its orientations.
    wanted : (E, D) bool array
        Which strut is to be looked at with which orientation.
    joined : (E, E) bool array
        See `joined_struts`: the nozzle may touch these within its bead.
    progress
        Called about every `BLOCK` struts.

    Returns
    -------
    (E, D, W) uint64 array
        Bit ``j % 64`` of word ``j // 64`` tells that strut j is hit. Rows that are not wanted are zero.
    """
    chords = StrutChords.of(frame.control_points, frame.radius)
    bits = np.zeros((frame.strut_count, len(axes), (frame.strut_count + 63) // 64), dtype=np.uint64)
    settings = np.array([nozzle.bead, nozzle.clearance, FINEST * float(np.median(frame.radius))])
    for begin in range(0, frame.strut_count, BLOCK):
        report(progress, Progress("looking for collisions", begin, frame.strut_count))
        end = min(frame.strut_count, begin + BLOCK)
        fill_bits(begin, end, chords.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, wanted, joined, bits)
    return bits


def struts_hit(
    frame: Wireframe, nozzle: Nozzle, struts: np.ndarray, axes: np.ndarray, before: np.ndarray, joined: np.ndarray
) -> np.ndarray:
    """Find what is hit while some struts are laid, each with tool orientations of its own.

    Parameters
    ----------
    frame, nozzle
        Where the struts are, and the tool.
    struts : (N,) int64 array
        The struts to lay.
    axes : (N, D, 3) array
        Unit vectors, orientations of the tool for each.
    before : (N, E) bool array
        What is there when it is laid.
    joined : (N, E) bool array
        What it is joined to, see `joined_struts`.

    Returns
    -------
    (N, D, E) bool array
    """
    chords = StrutChords.of(frame.control_points, frame.radius)
    hits = np.zeros((len(struts), axes.shape[1], frame.strut_count), dtype=bool)
    settings = np.array([nozzle.bead, nozzle.clearance, FINEST * float(np.median(frame.radius))])
    fill_hits(struts, chords.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, before, joined, hits)
    return hits


def unpacked_hits(bits: np.ndarray, count: int) -> np.ndarray:
    """Unpack the words (..., W) of `collision_bits` into a bool array (..., count), one value a strut."""
    words = np.ascontiguousarray(bits).astype("<u8").view(np.uint8)
    return np.unpackbits(words, axis=-1, bitorder="little")[..., :count].astype(bool)
