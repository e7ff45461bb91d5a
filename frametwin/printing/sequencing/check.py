"""Check a print sequence by looking at finely sampled poses of the nozzle, with nothing taken from the planner.

The tip is put at many points of each strut, and the distance from the nozzle's surface to many points of every printed
strut is compared with that strut's radius; points that are sure to be free are passed over. What lies between two
samples is missed by at most half their distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.wording import listed

POSE_STEP = 0.5
"""Distance between poses of the nozzle along a strut, in strut radii."""

POINT_STEP = 0.25
"""Distance between points of the printed struts, in strut radii."""

OVERLAP = 1.05
"""Struts within this many sums of radii of each other are joined by design, as those that share a joint are."""

NOTHING = 1e-6
"""Depth of contact that is none, in strut radii."""

BLOCK = 64


@dataclass(frozen=True)
class Finding:
    """Something that is wrong with a sequence.

    Attributes
    ----------
    kind
        ``"collision"``, ``"plate"``, ``"in the air"`` or ``"left out"``.
    strut
        The strut that is laid, or left out.
    others
        Printed struts that the nozzle hits, deepest first; the strut itself where its own beginning is hit.
    depth
        How deep in mm; 0 where nothing is hit.
    """

    kind: str
    strut: int
    others: tuple[int, ...] = ()
    depth: float = 0.0

    def __str__(self) -> str:
        if self.kind == "collision":
            return f"strut {self.strut}: the nozzle goes {self.depth:.3g} mm into {listed(self.others)}"
        if self.kind == "plate":
            return f"strut {self.strut}: the nozzle goes {self.depth:.3g} mm into the plate"
        return f"strut {self.strut}: {'begins in the air' if self.kind == 'in the air' else 'is left out'}"


def check_sequence(
    frame: Wireframe, sequence: PrintSequence, nozzle: Nozzle | None = None, progress: ProgressCallback | None = None
) -> list[Finding]:
    """Find struts that begin in the air, are left out, or cannot be laid without a collision, in their order.

    Parameters
    ----------
    frame
        Where the struts are: the design, or a plan.
    sequence
        What to check.
    nozzle
        Default `Nozzle.fitting`.
    progress
        Called now and then; may cancel.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    nozzle = (Nozzle.fitting(frame) if nozzle is None else nozzle).long_enough(frame)
    return [*begun_in_the_air(frame, sequence), *collisions(frame, sequence, nozzle, progress=progress)]


def begun_in_the_air(frame: Wireframe, sequence: PrintSequence) -> list[Finding]:
    """Struts that begin neither on the plate nor at the end of an earlier strut, and struts that never come.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    end = sequence.end_in(frame)
    there = frame.grounded.copy()
    findings = []
    for strut, a, b in zip(sequence.struts.tolist(), sequence.start.tolist(), end.tolist(), strict=True):
        if not there[a]:
            findings.append(Finding("in the air", strut))
        there[[a, b]] = True
    missing = np.setdiff1d(np.arange(frame.strut_count), sequence.struts)
    return [*findings, *(Finding("left out", int(strut)) for strut in missing)]


def collisions(
    frame: Wireframe,
    sequence: PrintSequence,
    nozzle: Nozzle,
    since: int = 0,
    progress: ProgressCallback | None = None,
) -> list[Finding]:
    """Collisions with struts laid before, with the strut itself, and with the plate, from batch ``since`` on.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    curves, struts = sequence.directed_curves(frame), sequence.struts
    joined = np.eye(len(struts), dtype=bool)
    first, step, points = _sampled(curves, frame.radius[struts])
    _mark_joined(frame.edges[struts], frame.radius[struts], first, step, points, joined)
    poses = np.ceil(frame.lengths[struts] / (POSE_STEP * frame.radius[struts])).astype(np.int64)
    scene = (first, step, points, frame.radius[struts], joined)
    tool = np.array([nozzle.bead, nozzle.clearance]), nozzle.profile
    findings = []
    begin = int(np.argmax(sequence.batch >= since)) if (sequence.batch >= since).any() else len(struts)
    for low in range(begin, len(struts), BLOCK):
        report(progress, Progress("checking for collisions", low, len(struts)))
        some = np.arange(low, min(len(struts), low + BLOCK))
        depth = np.zeros((len(some), len(struts)))
        _depths(some, curves, poses, sequence.axis, scene, tool, depth)
        for n, row in zip(some.tolist(), depth, strict=True):
            deep = np.flatnonzero(row > NOTHING * frame.radius[struts])
            if len(deep):
                deep = deep[np.argsort(-row[deep], kind="stable")]
                others = tuple(int(strut) for strut in struts[deep])
                findings.append(Finding("collision", int(struts[n]), others, float(row[deep[0]])))
    return findings + _into_the_plate(frame, sequence, nozzle, begin)


def _sampled(curves: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the points of each curve begin, the largest distance between two of them, and all points."""
    counts = np.maximum(8, np.ceil(bezier.arc_length(curves) / (POINT_STEP * radius))).astype(np.int64) + 1
    first = np.concatenate([[0], np.cumsum(counts)])
    pieces = [bezier.evaluate(c, np.linspace(0.0, 1.0, n)) for c, n in zip(curves, counts.tolist(), strict=True)]
    step = np.array([np.linalg.norm(np.diff(piece, axis=0), axis=1).max() for piece in pieces])
    return first, step, np.concatenate(pieces)


def _into_the_plate(frame: Wireframe, sequence: PrintSequence, nozzle: Nozzle, begin: int) -> list[Finding]:
    """The plate lies a radius below the lowest strut."""
    low = bezier.evaluate(sequence.directed_curves(frame)[begin:], np.linspace(0.0, 1.0, 33))[..., 2].min(axis=1)
    up = np.array([0.0, 0.0, 1.0])
    below = np.minimum(0.0, nozzle.lowest(up, sequence.axis[begin:])) + low
    depth = float(frame.bounds[0, 2]) - float(np.median(frame.radius)) - below
    bad = np.flatnonzero(depth > 1e-6 * frame.extent)
    return [Finding("plate", int(sequence.struts[begin + n]), (), float(depth[n])) for n in bad]


@nb.njit(cache=True, parallel=True)
def _mark_joined(edges, radius, first, step, points, joined):  # type: ignore[no-untyped-def]
    for i in nb.prange(len(edges)):
        for j in range(len(edges)):
            for end in edges[j]:
                joined[i, j] |= end == edges[i, 0] or end == edges[i, 1]
            limit = OVERLAP * (radius[i] + radius[j])
            p = first[i]
            while p < first[i + 1] and not joined[i, j]:
                nearest = np.inf
                q = first[j]
                while q < first[j + 1]:
                    gap = np.sqrt(((points[p] - points[q]) ** 2).sum())
                    nearest = min(nearest, gap)
                    q += 1 + max(0, int((gap - max(limit, nearest)) / step[j]))
                joined[i, j] = nearest < limit
                p += 1 + max(0, int((nearest - limit) / step[i]))


@nb.njit(cache=True)
def _outside(rho: float, height: float, low: float, high: float, lower: float, upper: float) -> float:
    """Distance from a frustum; inside, the depth below its mantle or its ends, as a negative number."""
    if height < low:
        across = max(0.0, rho - lower)
        return np.sqrt(across**2 + (low - height) ** 2)
    slope = np.arctan2(upper - lower, high - low)
    along = (rho - lower) * np.sin(slope) + (height - low) * np.cos(slope)
    out = (rho - lower) * np.cos(slope) - (height - low) * np.sin(slope)
    length = (high - low) / np.cos(slope)
    if out <= 0.0:
        return max(out, max(low - height, height - high)) if height <= high else height - high
    if along < 0.0:
        return np.sqrt(out**2 + along**2)
    return np.sqrt(out**2 + max(0.0, along - length) ** 2)


@nb.njit(cache=True, parallel=True)
def _depths(some, curves, poses, axes, scene, tool, depth):  # type: ignore[no-untyped-def]
    first, step, points, radius, joined = scene
    (bead, clearance), profile = tool
    for k in nb.prange(len(some)):
        n = some[k]
        axis = axes[n]
        for pose in range(poses[n] + 1):
            u = pose / poses[n]
            c = curves[n]
            tip = (1 - u) ** 3 * c[0] + 3 * u * (1 - u) ** 2 * c[1] + 3 * u**2 * (1 - u) * c[2] + u**3 * c[3]
            for j in range(n + 1):
                last = first[j + 1]
                if j == n:  # only what lies behind the tip
                    last = first[j] + np.int64(u * (first[j + 1] - first[j] - 1)) + 1
                p = first[j]
                while p < last:
                    x, y, z = points[p, 0] - tip[0], points[p, 1] - tip[1], points[p, 2] - tip[2]
                    height = x * axis[0] + y * axis[1] + z * axis[2]
                    square = x * x + y * y + z * z
                    rho = np.sqrt(max(0.0, square - height * height))
                    gap = np.inf
                    for part in range(2):
                        low, high, lower, upper = profile[part]
                        gap = min(gap, _outside(rho, height, low, high, lower, upper))
                    air = gap - radius[j] - clearance
                    if air < 0.0 and not (joined[n, j] and square <= bead * bead):
                        depth[k, j] = max(depth[k, j], -air)
                    p += 1 + max(0, int(air / step[j]))  # the next points cannot be nearer than that
