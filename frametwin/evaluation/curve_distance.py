"""Exact distances from points to a set of Bezier curves of one degree.

The curves are cut into short chords. A k-d tree on the chords' middles proposes candidates; as the middle of the
nearest chord is no further than its distance plus half its length, candidates are asked for until that bound
says that no other chord can be nearer. Newton steps on the curve then take the place of the chord.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from frametwin.geometry import bezier
from frametwin.geometry.flattening import chord_error

CHORDS = 24
"""Chords of a strut of median length; longer ones take more, so that all chords are about as long."""

FEWEST, MOST = 8, 4096
"""Chords of a strut, at the least and at the most."""

NEWTON_STEPS = 6
FIRST = 8
"""Candidates that are asked for at first."""

PAIRS = 1 << 19
"""Pairs of point and candidate that are looked at in one go, which bounds the memory."""


def counts_by_length(control_points: np.ndarray, per_median: int) -> np.ndarray:
    """(E,) pieces for each curve such that all pieces are about as long, ``per_median`` for a median one."""
    lengths = bezier.arc_length(control_points)
    pieces = np.ceil(per_median * lengths / np.median(lengths))
    return np.clip(pieces, FEWEST, MOST).astype(np.int64)


def ragged(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row numbers and positions within the row, for rows of different lengths laid end to end."""
    rows = np.repeat(np.arange(len(counts)), counts)
    return rows, np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)


def points_at(control_points: np.ndarray, strut: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(N, 3) points at parameters (N,) of the curves (N,)."""
    return np.einsum("nb,nbx->nx", bezier.bernstein(control_points.shape[1] - 1, u), control_points[strut])


@dataclass(frozen=True, eq=False)
class CurveSet:
    """Curves, ready to be asked for the nearest point.

    Attributes
    ----------
    control_points
        (E, n + 1, 3) mm.
    interval
        (E, 2) part of each curve that belongs to the set.
    strut, start, step
        (C,) curve of each chord, the parameter where it begins, and its length in the parameter.
    a, b
        (C, 3) ends of the chords.
    sagitta
        (C,) mm, a bound on how far the curve leaves the chord.
    tree
        Of the chords' middles.
    """

    control_points: np.ndarray
    interval: np.ndarray
    strut: np.ndarray
    start: np.ndarray
    step: np.ndarray
    a: np.ndarray
    b: np.ndarray
    sagitta: np.ndarray
    tree: cKDTree

    @classmethod
    def build(cls, control_points: np.ndarray, interval: np.ndarray | None = None) -> CurveSet:
        """Prepare a set.

        Parameters
        ----------
        control_points
            (E, n + 1, 3) mm.
        interval
            (E, 2) part of the parameter that belongs to the set; all of it by default. Curves with an empty
            one are left out.

        Raises
        ------
        ValueError
            If no curve is left.
        """
        curves = np.asarray(control_points, dtype=np.float64)
        span = np.tile([0.0, 1.0], (len(curves), 1)) if interval is None else np.asarray(interval)
        counts = np.where(span[:, 1] > span[:, 0], counts_by_length(curves, CHORDS), 0)
        if not counts.any():
            raise ValueError("a set of curves needs at least one curve that is there")
        strut, k = ragged(counts)
        step = np.repeat((span[:, 1] - span[:, 0]) / np.maximum(counts, 1), counts)
        start = span[strut, 0] + k * step
        a, b = points_at(curves, strut, start), points_at(curves, strut, start + step)
        sagitta = chord_error(curves[strut], 1.0 / step)
        return cls(curves, span, strut, start, step, a, b, sagitta, cKDTree(0.5 * (a + b)))

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(N,) distances in mm from points (N, 3) to the nearest point of any curve."""
        found = np.full(len(points), np.inf)
        # The middle of the chord below the nearest point is no further than this beyond the distance.
        reach = 0.5 * float(np.linalg.norm(self.b - self.a, axis=1).max()) + float(self.sagitta.max())
        waiting, wanted = np.arange(len(points)), min(FIRST, len(self.a))
        while len(waiting):
            unsure = []
            for rows in np.array_split(waiting, -(-len(waiting) * wanted // PAIRS)):
                middle, chord = self.tree.query(points[rows], k=wanted, workers=-1)
                middle, chord = middle.reshape(-1, wanted), chord.reshape(-1, wanted)
                distance, share = self._to_chords(points[rows], chord)
                highest = (distance + self.sagitta[chord]).min(axis=1)
                sure = (middle[:, -1] - reach > highest) | (wanted == len(self.a))
                near = (distance - self.sagitta[chord] <= highest[:, None]) & sure[:, None]
                row = np.nonzero(near)[0]
                u = self.start[chord[near]] + share[near] * self.step[chord[near]]
                np.minimum.at(found, rows[row], self._refined(points[rows[row]], chord[near], u))
                unsure.append(rows[~sure])
            waiting, wanted = np.concatenate(unsure), min(3 * wanted, len(self.a))
        return found

    def _to_chords(self, points: np.ndarray, chord: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (N, K) to chords (N, K), and where along them the nearest point is, 0..1."""
        a = self.a[chord]  # (N, K, 3)
        along = self.b[chord] - a
        across = points[:, None] - a
        squared = np.einsum("nkx,nkx->nk", along, along)
        share = np.einsum("nkx,nkx->nk", across, along) / np.maximum(squared, 1e-300)
        share = np.clip(share, 0.0, 1.0)
        return np.linalg.norm(across - share[..., None] * along, axis=2), share

    def _refined(self, points: np.ndarray, chord: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Distances (N,) to the curves themselves, by Newton's method from the parameters (N,) on chords."""
        strut = self.strut[chord]
        own = self.control_points[strut]  # (N, n + 1, 3)
        n = own.shape[1] - 1
        # The nearest point may lie beyond the end of a chord, but not beyond the chords next to it.
        low = np.maximum(self.start[chord] - self.step[chord], self.interval[strut, 0])
        high = np.minimum(self.start[chord] + 2.0 * self.step[chord], self.interval[strut, 1])
        first, second = n * np.diff(own, axis=1), n * (n - 1.0) * np.diff(own, 2, axis=1)
        best = np.full(len(points), np.inf)
        for _ in range(NEWTON_STEPS + 1):
            gap = np.einsum("nb,nbx->nx", bezier.bernstein(n, u), own) - points
            best = np.minimum(best, np.linalg.norm(gap, axis=1))
            speed = np.einsum("nb,nbx->nx", bezier.bernstein(n - 1, u), first)
            bend = np.einsum("nb,nbx->nx", bezier.bernstein(n - 2, u), second)
            slope = np.einsum("nx,nx->n", gap, speed)
            curvature = np.einsum("nx,nx->n", speed, speed) + np.einsum("nx,nx->n", gap, bend)
            convex = curvature > 0.0
            u = np.clip(u - np.where(convex, slope / np.where(convex, curvature, 1.0), 0.0), low, high)
        return best
