"""Which struts the nozzle would hit while it lays another one, for every way of holding it.

While a straight piece of strut is laid with the tool's axis fixed, the vector from the tip to a point of another
straight piece is affine in the two parameters, and the distance from it to a part of the nozzle changes by no more than
it does. So one value in the middle of a cell of parameters bounds all of the cell: cells are halved till they are known
to be free, to lie within the bead, or to hold a collision. What is undecided at the finest cells counts as a collision.
Curved struts are cut into chords, and the bound on what lies between chord and curve is added to the rods' radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.flattening import chord_error, chords_needed
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.progress import Progress, ProgressCallback, report

FINEST = 0.05
"""Smallest cells of the search, in strut radii: by so much too careful the answer may be."""

FLATNESS = 0.1
"""How far curves may leave their chords, in strut radii."""

JOINED = 1.05
"""Struts nearer to each other than this many sums of their radii run into each other: the design joins them."""

BLOCK = 64
"""Struts between two reports of progress."""

DEPTH = 64


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
    _mark_joined(frame.edges, frame.radius, rods.arrays, JOINED, joined)
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
        _fill(begin, end, rods.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, wanted, joined, bits)
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
    _hit_some(struts, rods.arrays, np.ascontiguousarray(axes), nozzle.profile, settings, before, joined, hits)
    return hits


def hit_struts(bits: np.ndarray, count: int) -> np.ndarray:
    """(..., count) bool from the words (..., W) of `collision_bits`."""
    words = np.ascontiguousarray(bits).astype("<u8").view(np.uint8)
    return np.unpackbits(words, axis=-1, bitorder="little")[..., :count].astype(bool)


@nb.njit(cache=True, error_model="numpy")
def part_distance(rho: float, height: float, part: np.ndarray) -> float:
    """As `Nozzle.distance`, for one part and one point."""
    low, high, lower, upper = part[0], part[1], part[2], part[3]
    side_rho, side_height = upper - lower, high - low
    size2 = side_rho * side_rho + side_height * side_height
    x, y = rho - lower, height - low
    beyond = (x * side_height - y * side_rho) / np.sqrt(size2)
    inside = max(max(-y, height - high), beyond)
    if inside <= 0.0:
        return inside
    along = min(1.0, max(0.0, (x * side_rho + y * side_height) / size2))
    least = (x - along * side_rho) ** 2 + (y - along * side_height) ** 2
    least = min(least, max(0.0, x) ** 2 + y * y)
    return np.sqrt(min(least, max(0.0, rho - upper) ** 2 + (height - high) ** 2))


@nb.njit(cache=True, error_model="numpy")
def _piece_hits(
    offset: np.ndarray,
    laid: np.ndarray,
    other: np.ndarray,
    axis: np.ndarray,
    part: np.ndarray,
    radius: float,
    bead: float,
    finest: float,
) -> bool:
    """True if the part comes nearer than ``radius`` to a point outside of the bead: offset - u laid + v other."""
    laid_length, other_length = np.sqrt((laid**2).sum()), np.sqrt((other**2).sum())
    stack = np.empty((DEPTH, 4))
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0.5, 0.5, 0.5, 0.5  # middle and half the width, u and v
    top = 1
    while top > 0:
        top -= 1
        u, v, half_u, half_v = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        height, square = 0.0, 0.0
        for x in range(3):
            w = offset[x] - u * laid[x] + v * other[x]
            height += w * axis[x]
            square += w * w
        size = half_u * laid_length + half_v * other_length
        distance = part_distance(np.sqrt(max(0.0, square - height * height)), height, part)
        from_tip = np.sqrt(square)
        if distance - size >= radius or from_tip + size <= bead:
            continue
        if (distance < radius and from_tip > bead) or size <= finest or top > DEPTH - 3:
            return True
        if half_u * laid_length >= half_v * other_length:
            half_u *= 0.5
            stack[top, 0], stack[top + 1, 0] = u - half_u, u + half_u
            stack[top, 1], stack[top + 1, 1] = v, v
        else:
            half_v *= 0.5
            stack[top, 0], stack[top + 1, 0] = u, u
            stack[top, 1], stack[top + 1, 1] = v - half_v, v + half_v
        stack[top : top + 2, 2], stack[top : top + 2, 3] = half_u, half_v
        top += 2
    return False


@nb.njit(cache=True, error_model="numpy")
def _strut_hits(i: int, j: int, rods: tuple, axis: np.ndarray, profile: np.ndarray, room: np.ndarray) -> bool:
    """True if the nozzle hits strut j while it lays strut i; ``room``: bead, clearance and finest cell."""
    start, end, first, thickness, slack, centre, reach = rods
    radius = thickness[j] + slack[i] + room[1]
    between = centre[j] - centre[i]
    height = (between * axis).sum()
    rho = np.sqrt(max(0.0, (between**2).sum() - height * height))
    for k in range(profile.shape[0]):
        if part_distance(rho, height, profile[k]) >= reach[i] + reach[j] + radius:
            continue
        for p in range(first[i], first[i + 1]):
            for q in range(first[j], first[j + 1]):
                laid, other, offset = end[p] - start[p], end[q] - start[q], start[q] - start[p]
                if _piece_hits(offset, laid, other, axis, profile[k], radius, room[0], room[2]):
                    return True
    return False


@nb.njit(cache=True, parallel=True, error_model="numpy")
def _fill(begin, end, rods, axes, profile, settings, wanted, joined, bits):  # type: ignore[no-untyped-def]
    for i in nb.prange(begin, end):
        with_bead = settings.copy()
        without = settings.copy()
        without[0] = 0.0
        for d in range(axes.shape[0]):
            if wanted[i, d]:
                for j in range(joined.shape[0]):
                    room = with_bead if joined[i, j] else without
                    if j != i and _strut_hits(i, j, rods, axes[d], profile, room):
                        bits[i, d, j // 64] |= np.uint64(1) << np.uint64(j % 64)


@nb.njit(cache=True, parallel=True, error_model="numpy")
def _hit_some(struts, rods, axes, profile, settings, before, joined, hits):  # type: ignore[no-untyped-def]
    for n in nb.prange(len(struts)):
        with_bead = settings.copy()
        without = settings.copy()
        without[0] = 0.0
        for d in range(axes.shape[1]):
            for j in range(before.shape[1]):
                if before[n, j] and j != struts[n]:
                    room = with_bead if joined[n, j] else without
                    hits[n, d, j] = _strut_hits(struts[n], j, rods, axes[n, d], profile, room)


@nb.njit(cache=True, error_model="numpy")
def _segment_distance(p: np.ndarray, d: np.ndarray, q: np.ndarray, e: np.ndarray) -> float:
    """Distance of the segments p + s d and q + t e, s, t in 0..1 (Ericson, Real-Time Collision Detection, 5.1.9)."""
    r = p - q
    a, c, f, b, g = (d * d).sum(), (e * e).sum(), (e * r).sum(), (d * e).sum(), (d * r).sum()
    denominator = a * c - b * b
    s = min(1.0, max(0.0, (b * f - g * c) / denominator)) if denominator > 1e-12 * a * c else 0.0
    t = (b * s + f) / c
    if t < 0.0 or t > 1.0:
        t = min(1.0, max(0.0, t))
        s = min(1.0, max(0.0, (b * t - g) / a))
    return np.sqrt(((r + s * d - t * e) ** 2).sum())


@nb.njit(cache=True, parallel=True, error_model="numpy")
def _mark_joined(edges, radius, rods, factor, joined):  # type: ignore[no-untyped-def]
    start, end, first, thickness, slack, centre, reach = rods
    for i in nb.prange(joined.shape[0]):
        for j in range(joined.shape[0]):
            if i == j:
                continue
            if (edges[i] == edges[j, 0]).any() or (edges[i] == edges[j, 1]).any():
                joined[i, j] = True
                continue
            limit = factor * (radius[i] + radius[j]) + slack[i] + slack[j]
            if np.sqrt(((centre[i] - centre[j]) ** 2).sum()) > reach[i] + reach[j] + limit:
                continue
            for p in range(first[i], first[i + 1]):
                for q in range(first[j], first[j + 1]):
                    gap = _segment_distance(start[p], end[p] - start[p], start[q], end[q] - start[q])
                    if gap < limit:
                        joined[i, j] = True
