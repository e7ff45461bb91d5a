"""Compiled loops of the nozzle beside chords: distances, cells of parameters, tables of hits.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

import numba as nb
import numpy as np

DEPTH = 64
"""Cells that wait to be looked at; each halving leaves one more."""


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
def _strut_hits(i: int, j: int, chords: tuple, axis: np.ndarray, profile: np.ndarray, margin: np.ndarray) -> bool:
    """True if the nozzle hits strut j while it lays strut i; ``margin``: bead, clearance and finest cell."""
    start, end, first, thickness, slack, centre, reach = chords
    radius = thickness[j] + slack[i] + margin[1]
    between = centre[j] - centre[i]
    height = (between * axis).sum()
    rho = np.sqrt(max(0.0, (between**2).sum() - height * height))
    for k in range(profile.shape[0]):
        if part_distance(rho, height, profile[k]) >= reach[i] + reach[j] + radius:
            continue
        for p in range(first[i], first[i + 1]):
            for q in range(first[j], first[j + 1]):
                laid, other, offset = end[p] - start[p], end[q] - start[q], start[q] - start[p]
                if _piece_hits(offset, laid, other, axis, profile[k], radius, margin[0], margin[2]):
                    return True
    return False


@nb.njit(cache=True, parallel=True, error_model="numpy")
def fill_bits(begin, end, chords, axes, profile, settings, wanted, joined, bits):  # type: ignore[no-untyped-def]
    """Set in ``bits`` what is hit while each strut from ``begin`` to ``end`` is laid; see `clearance.collision_bits`.

    ``settings`` are bead, clearance and finest cell, in mm.
    """
    for i in nb.prange(begin, end):
        with_bead = settings.copy()
        without = settings.copy()
        without[0] = 0.0
        for d in range(axes.shape[0]):
            if wanted[i, d]:
                for j in range(joined.shape[0]):
                    margin = with_bead if joined[i, j] else without
                    if j != i and _strut_hits(i, j, chords, axes[d], profile, margin):
                        bits[i, d, j // 64] |= np.uint64(1) << np.uint64(j % 64)


@nb.njit(cache=True, parallel=True, error_model="numpy")
def fill_hits(struts, chords, axes, profile, settings, before, joined, hits):  # type: ignore[no-untyped-def]
    """Set in ``hits`` what is hit while some struts are laid; see `clearance.struts_hit`."""
    for n in nb.prange(len(struts)):
        with_bead = settings.copy()
        without = settings.copy()
        without[0] = 0.0
        for d in range(axes.shape[1]):
            for j in range(before.shape[1]):
                if before[n, j] and j != struts[n]:
                    margin = with_bead if joined[n, j] else without
                    hits[n, d, j] = _strut_hits(struts[n], j, chords, axes[n, d], profile, margin)


@nb.njit(cache=True, error_model="numpy")
def spares_itself(points, margin, axes, profile, bead):  # type: ignore[no-untyped-def]
    """Find tool orientations (n, D) that hit no point of a strut (n, S, 3) further than the bead behind the tip.

    ``margin`` (n,) is the distance that points keep from the nozzle, ``axes`` (D, 3) and ``profile`` are the tool's.
    """
    result = np.ones((len(points), len(axes)), dtype=np.bool_)
    for n in range(len(points)):
        for d in range(len(axes)):
            for tip in range(1, points.shape[1]):
                for behind in range(tip):
                    square, height = 0.0, 0.0
                    for x in range(3):
                        w = points[n, behind, x] - points[n, tip, x]
                        square += w * w
                        height += w * axes[d, x]
                    if square <= bead * bead:
                        break
                    rho = np.sqrt(max(0.0, square - height * height))
                    for k in range(len(profile)):
                        if part_distance(rho, height, profile[k]) < margin[n]:
                            result[n, d] = False
                            break
                if not result[n, d]:
                    break
    return result


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
def mark_joined(edges, radius, chords, factor, struts, joined):  # type: ignore[no-untyped-def]
    """Set in ``joined`` (n, E) which others share a joint with some struts (n,), or come within ``factor`` sums of
    radii; see `joined_struts`."""
    start, end, first, thickness, slack, centre, reach = chords
    for n in nb.prange(joined.shape[0]):
        i = struts[n]
        for j in range(joined.shape[1]):
            if i == j:
                continue
            if (edges[i] == edges[j, 0]).any() or (edges[i] == edges[j, 1]).any():
                joined[n, j] = True
                continue
            limit = factor * (radius[i] + radius[j]) + slack[i] + slack[j]
            if np.sqrt(((centre[i] - centre[j]) ** 2).sum()) > reach[i] + reach[j] + limit:
                continue
            for p in range(first[i], first[i + 1]):
                for q in range(first[j], first[j + 1]):
                    gap = _segment_distance(start[p], end[p] - start[p], start[q], end[q] - start[q])
                    if gap < limit:
                        joined[n, j] = True
