"""Which points of the struts a camera sees: rays from its centre against every strut's solid, exactly.

The solid of a strut is the sphere of its radius swept along its curve, in straight pieces so fine that they leave the
curve by a hundredth of the radius. Pieces and rays meet in the cells of a grid over the view.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, sqrt

import numba as nb
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier
from frametwin.geometry.flattening import chords_needed
from frametwin.geometry.radii import radii_at
from frametwin.geometry.wireframe import Wireframe

CHORD = 0.01
"""How far a straight piece may leave the curve, as a share of the strut's radius."""

LONGEST = 8.0
"""Length of a piece in radii, at most: what is long and slanting lies in many cells for nothing."""

MOST_PIECES = 64
TAPERED_PIECES = 8
MOST_CELLS = 256


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight pieces of the struts, strut by strut.

    Attributes
    ----------
    starts, ends : (P, 3) mm.
    radii : (P, 2) mm at both ends.
    first : (E + 1,) the first piece of each strut; struts that are not there have none.
    """

    starts: np.ndarray
    ends: np.ndarray
    radii: np.ndarray
    first: np.ndarray


def strut_pieces(frame: Wireframe, present: np.ndarray, thickness: np.ndarray) -> Pieces:
    """Cut the printed struts into straight pieces.

    Parameters
    ----------
    frame
        Curves in mm; its own radius does not count.
    present
        (E, 2) interval of the curve parameter at which each strut is there.
    thickness
        (E, K) radius in mm at even parameters, K >= 2, linear in between.
    """
    there = np.flatnonzero(frame.printed & (present[:, 1] > present[:, 0]))
    curves, span, radii = frame.control_points[there], present[there], thickness[there]
    tapered = np.ptp(radii, axis=1) > 0.0
    count = _piece_counts(curves, span, radii, tapered)
    starts, ends, widths, owners = [], [], [], []
    for number in np.unique(count):
        for taper in (False, True):
            group = np.flatnonzero((count == number) & (tapered == taper))
            low, high = span[group, :1], span[group, 1:]
            u = low + np.linspace(0.0, 1.0, number + 1) * (high - low)
            if taper:  # a piece ends wherever the radius bends; pieces of no length do no harm
                kinks = np.linspace(0.0, 1.0, radii.shape[1])[1:-1]
                u = np.sort(np.concatenate([u, np.clip(np.tile(kinks, (len(u), 1)), low, high)], axis=1))
            basis = bezier.bernstein(3, u)  # (G, n + 1, 4)
            points = basis @ curves[group]
            radius = radii_at(radii[group], u)
            starts.append(points[:, :-1].reshape(-1, 3))
            ends.append(points[:, 1:].reshape(-1, 3))
            widths.append(np.stack([radius[:, :-1], radius[:, 1:]], axis=-1).reshape(-1, 2))
            owners.append(np.repeat(there[group], u.shape[1] - 1))
    if not len(there):
        return Pieces(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(frame.strut_count + 1, np.int64))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    first = np.searchsorted(owner[order], np.arange(frame.strut_count + 1))
    return Pieces(np.concatenate(starts)[order], np.concatenate(ends)[order], np.concatenate(widths)[order], first)


def _piece_counts(curves: np.ndarray, span: np.ndarray, radii: np.ndarray, tapered: np.ndarray) -> np.ndarray:
    """(E,) number of pieces of each strut, a power of two."""
    part = span[:, 1] - span[:, 0]
    thinnest = radii.min(axis=1)
    bent = part * chords_needed(curves, CHORD * thinnest)
    long = part * bezier.arc_length(curves) / (LONGEST * thinnest)
    needed = np.maximum(np.maximum(bent, long), np.where(tapered, TAPERED_PIECES, 1))
    return np.minimum(2 ** np.ceil(np.log2(needed)).astype(np.int64), MOST_PIECES)


def seen(
    points: np.ndarray, tangents: np.ndarray, radius: np.ndarray, wanted: np.ndarray, pieces: Pieces, camera: Camera
) -> np.ndarray:
    """Which points of the centrelines a camera sees; see `frametwin.simulation.curve_truth` for what that means.

    Parameters
    ----------
    points, tangents
        (E, S, 3) mm and unit.
    radius
        (E, S) mm, above 0.
    wanted
        (E, S) bool: in front of the camera, on what is printed, and inside of the picture; the others are not seen.
    pieces
        See `strut_pieces`.
    camera
        Its lens distortion does not count: rays in space are straight.
    """
    rotation, shift = camera.world_to_camera[:3, :3], camera.world_to_camera[:3, 3]
    starts, ends = (np.ascontiguousarray(corner @ rotation.T + shift) for corner in (pieces.starts, pieces.ends))
    where = np.argwhere(wanted)  # (M, 2)
    local = points[wanted] @ rotation.T + shift
    if not len(where):
        return np.zeros(wanted.shape, dtype=bool)
    plane = local[:, :2] / local[:, 2:]
    cells = int(np.clip(np.sqrt(len(starts)), 1, MOST_CELLS))
    low = plane.min(axis=0)
    cell = np.maximum(np.ptp(plane, axis=0), 1e-9) / cells
    begin, members = _sort_into_cells(starts, ends, pieces.radii, low, cell, cells)
    found = np.zeros(wanted.shape, dtype=bool)
    found[wanted] = _seen(
        local,
        tangents[wanted] @ rotation.T,
        radius[wanted],
        where[:, 0],
        starts,
        ends,
        pieces.radii,
        pieces.first,
        (low, cell, cells, begin, members),
    )
    return found


@nb.njit(cache=True)
def _bounds(x, z, r):
    """Lowest and highest x / z of a sphere in front of the camera."""
    root = r * sqrt(max(x * x + z * z - r * r, 0.0))
    below = z * z - r * r
    return (x * z - root) / below, (x * z + root) / below


@nb.njit(cache=True)
def _cell_range(a, b, ra, rb, axis, low, cell, cells):
    """First and last row or column of cells that the outline of a piece reaches; none if the last is the lesser."""
    if a[2] + ra <= 0.0 and b[2] + rb <= 0.0:
        return 0, -1  # behind the camera
    if a[2] <= ra or b[2] <= rb:
        return 0, cells - 1  # beside it: anywhere
    a0, a1 = _bounds(a[axis], a[2], ra)
    b0, b1 = _bounds(b[axis], b[2], rb)
    first = floor((min(a0, b0) - low[axis]) / cell[axis] - 1e-9)
    last = floor((max(a1, b1) - low[axis]) / cell[axis] + 1e-9)
    return int(min(max(first, 0.0), cells)), int(min(max(last, -1.0), cells - 1.0))


@nb.njit(cache=True)
def _sort_into_cells(starts, ends, radii, low, cell, cells):
    """For each cell the pieces whose outline may reach it: ``members[begin[c]:begin[c + 1]]``."""
    begin = np.zeros(cells * cells + 1, dtype=np.int64)
    members = np.empty(0, dtype=np.int64)
    filled = np.zeros(cells * cells, dtype=np.int64)
    for filling in (False, True):
        if filling:
            for c in range(cells * cells):
                begin[c + 1] += begin[c]
            members = np.empty(begin[-1], dtype=np.int64)
        for k in range(len(starts)):
            a, b, ra, rb = starts[k], ends[k], radii[k, 0], radii[k, 1]
            left, right = _cell_range(a, b, ra, rb, 0, low, cell, cells)
            top, bottom = _cell_range(a, b, ra, rb, 1, low, cell, cells)
            for row in range(top, bottom + 1):
                for column in range(left, right + 1):
                    c = row * cells + column
                    if filling:
                        members[begin[c] + filled[c]] = k
                        filled[c] += 1
                    else:
                        begin[c + 1] += 1
    return begin, members


@nb.njit(cache=True)
def _passage(d, a, b, ra, rb):
    """Where a ray along the unit vector d from the origin enters and leaves a sphere swept along a..b; inf if nowhere.

    A point t d is inside of the sphere at the share s of the way where f(t, s) = |t d - a - s m|^2 - (ra + s q)^2 is
    not above 0. The least and the greatest such t lie on the sphere of an end, or where f is 0 and least over s.
    """
    mx, my, mz, q = b[0] - a[0], b[1] - a[1], b[2] - a[2], rb - ra
    da = d[0] * a[0] + d[1] * a[1] + d[2] * a[2]
    db = d[0] * b[0] + d[1] * b[1] + d[2] * b[2]
    dm = d[0] * mx + d[1] * my + d[2] * mz
    mm = mx * mx + my * my + mz * mz
    aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    enter, leave = inf, -inf
    for along, square, r in ((da, aa, ra), (db, bb, rb)):
        under = along * along - square + r * r
        if under >= 0.0:
            enter, leave = min(enter, along - sqrt(under)), max(leave, along + sqrt(under))
    w = mm - q * q
    if w <= 1e-12 * (mm + q * q):
        return enter, leave  # one end's sphere holds the other
    k = ra * q - (a[0] * mx + a[1] * my + a[2] * mz)
    # With s = (t dm + k) / w the condition f = 0 is first t^2 - 2 middle t + last = 0.
    first, middle, last = 1.0 - dm * dm / w, da + dm * k / w, aa - ra * ra - k * k / w
    under = middle * middle - first * last
    if under < 0.0 or abs(first) < 1e-14:
        return enter, leave
    for sign in (-1.0, 1.0):
        t = (middle + sign * sqrt(under)) / first
        if 0.0 <= t * dm + k <= w:
            enter, leave = min(enter, t), max(leave, t)
    return enter, leave


@nb.njit(cache=True)
def _own_surface(d, distance, strut, starts, ends, radii, first):
    """Where the ray enters the stretch of the strut's own solid that holds the point at this distance."""
    surface = distance
    growing = True
    while growing:
        growing = False
        for k in range(first[strut], first[strut + 1]):
            enter, leave = _passage(d, starts[k], ends[k], radii[k, 0], radii[k, 1])
            if enter < surface and leave >= surface - 1e-9 * distance:
                surface = enter
                growing = True
    return surface


@nb.njit(cache=True)
def _hides_itself(point, tangent, r, strut, starts, ends, radii, first, d):
    """Whether another place of the strut stands before the side of it that faces the camera here; d is for use."""
    distance = sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
    along = (point[0] * tangent[0] + point[1] * tangent[1] + point[2] * tangent[2]) / distance
    sine = sqrt(max(1.0 - along * along, 0.0))
    for e in range(3):
        ray = point[e] / distance
        across = (ray - along * tangent[e]) / sine if sine > 1e-9 else ray
        d[e] = point[e] - r * across  # the surface point that faces the camera
    away = sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
    for e in range(3):
        d[e] /= away
    for k in range(first[strut], first[strut + 1]):
        enter, _ = _passage(d, starts[k], ends[k], radii[k, 0], radii[k, 1])
        if 0.0 < enter < away - r:
            return True
    return False


@nb.njit(cache=True)
def _seen(points, tangents, radius, struts, starts, ends, radii, first, grid):
    """(M,) bool for points (M, 3) with tangents and radius on the given struts, all seen from the origin."""
    low, cell, cells, begin, members = grid
    found = np.zeros(len(points), dtype=np.bool_)
    d = np.empty(3)
    for i in range(len(points)):
        point, r, strut = points[i], radius[i], struts[i]
        if _hides_itself(point, tangents[i], r, strut, starts, ends, radii, first, d):
            continue
        distance = sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
        for e in range(3):
            d[e] = point[e] / distance
        column = min(int((point[0] / point[2] - low[0]) / cell[0]), cells - 1)
        row = min(int((point[1] / point[2] - low[1]) / cell[1]), cells - 1)
        surface = inf  # not known yet; it lies at least a radius before the point
        hidden = False
        for m in range(begin[row * cells + column], begin[row * cells + column + 1]):
            k = members[m]
            if first[strut] <= k < first[strut + 1]:
                continue
            enter, _ = _passage(d, starts[k], ends[k], radii[k, 0], radii[k, 1])
            if enter <= 0.0 or enter >= distance - 2.0 * r:
                continue
            if surface == inf:
                surface = _own_surface(d, distance, strut, starts, ends, radii, first)
            if enter < surface - r:
                hidden = True
                break
        found[i] = not hidden
    return found
