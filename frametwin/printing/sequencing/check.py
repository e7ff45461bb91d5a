"""Check a print sequence: what begins in the air, what is left out, and what the nozzle hits.

Nothing is taken from the planner: collisions are looked for at finely sampled poses of the nozzle (`tool_collisions`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe, lowest_vertices
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.tool_collisions import POSE_STEP, SampledStruts, ToolPoses, collision_depths
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.wording import listed, shortened

LEAST_DEPTH = 1e-6
"""Depth up to which the nozzle does not count as touching anything, in strut radii; in the plate, of the extent."""

ON_PLATE = 1.5
"""What begins on the plate begins no higher above it than this, in radii of its strut, or of most struts."""

BLOCK = 64
"""Struts between two reports of progress."""

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Fault:
    """Something that is wrong with an order, or with the waypoints of a batch.

    Attributes
    ----------
    kind
        ``"collision"``, ``"plate"``, ``"in the air"`` or ``"left out"``; of waypoints also those of
        `frametwin.printing.job.check`.
    strut
        The strut that is laid, or left out; ``None`` where the fault is not that of a single one.
    problem
        What is wrong, in words.
    others
        Printed struts that the nozzle hits, deepest first; the strut itself where its own beginning is hit.
    depth
        How deep in mm; 0 where nothing is hit.
    batch
        Whose waypoints are wrong; ``None`` for the order.
    waypoint
        The waypoint that is wrong, where it is a single one.
    """

    kind: str
    strut: int | None
    problem: str
    others: tuple[int, ...] = ()
    depth: float = 0.0
    batch: int | None = None
    waypoint: int | None = None

    def __str__(self) -> str:
        where = [] if self.batch is None else [f"batch {self.batch}"]
        where += [] if self.strut is None else [f"strut {self.strut}"]
        return f"{', '.join(where) or 'the order'}: {self.problem}"

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {**vars(self), "others": list(self.others)}


def check_sequence(
    frame: Wireframe, sequence: PrintSequence, nozzle: Nozzle | None = None, progress: ProgressCallback | None = None
) -> list[Fault]:
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
    air, missing = begun_in_the_air(frame, sequence), left_out(frame, sequence)
    return [*air, *missing, *collisions(frame, sequence, nozzle, progress)]


def begun_in_the_air(frame: Wireframe, sequence: PrintSequence, since: int = 0) -> list[Fault]:
    """Find struts that begin neither on the plate nor at the end of a strut that is there by then.

    Parameters
    ----------
    frame
        A design, or, with ``since``, a plan whose printed struts are those that stand.
    sequence
        What to check.
    since
        The first batch to look at.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    there = frame.grounded | frame.printed_vertices() if since else frame.grounded.copy()
    faults = []
    later = sequence.batch >= since
    ends = sequence.end_in(frame)[later]
    for strut, a, b in zip(sequence.struts[later].tolist(), sequence.start[later].tolist(), ends.tolist(), strict=True):
        if not there[a]:
            faults.append(Fault("in the air", strut, "begins in the air"))
        there[[a, b]] = True
    return faults


def left_out(frame: Wireframe, sequence: PrintSequence) -> list[Fault]:
    """Find struts that are never laid."""
    missing = np.setdiff1d(np.arange(frame.strut_count), sequence.struts)
    return [Fault("left out", int(strut), "is left out of the order") for strut in missing]


def collisions(
    frame: Wireframe, sequence: PrintSequence, nozzle: Nozzle, progress: ProgressCallback | None = None
) -> list[Fault]:
    """Find collisions with struts laid before, with the strut itself, and with the plate.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    curves, order = sequence.directed_curves(frame), sequence.struts
    struts = SampledStruts.build(curves, frame.radius[order], frame.edges[order])
    counts = np.ceil(frame.lengths[order] / (POSE_STEP * frame.radius[order])).astype(np.int64)
    faults = []
    for low in range(0, len(order), BLOCK):
        report(progress, Progress("checking the order for collisions", low, len(order)))
        places = np.arange(low, min(len(order), low + BLOCK))
        poses = _poses_on_struts(places, curves, sequence.axis, counts)
        depths = collision_depths(struts, poses, nozzle)
        for place, depth in zip(places.tolist(), depths, strict=True):
            fault = collision_fault(int(order[place]), order, depth, frame.radius[order])
            faults += [] if fault is None else [fault]
    return [*faults, *_into_the_plate(frame, sequence, nozzle)]


def collision_fault(
    strut: int, order: np.ndarray, depth: np.ndarray, radius: np.ndarray, batch: int | None = None
) -> Fault | None:
    """Say what the nozzle hits while it lays a strut; ``None`` where that is nothing.

    Parameters
    ----------
    strut
        That is laid.
    order : (N,) int64 array
        The struts that may be hit.
    depth, radius : (N,) array, mm
        How deep the nozzle goes into each, and how thick they are.
    batch
        Of the strut, where its waypoints are looked at.
    """
    deep = np.flatnonzero(depth > LEAST_DEPTH * radius)
    if not len(deep):
        return None
    deep = deep[np.argsort(-depth[deep], kind="stable")]
    others, most = tuple(int(other) for other in order[deep]), float(depth[deep[0]])
    return Fault("collision", strut, f"the nozzle goes {most:.3g} mm into {listed(others)}", others, most, batch)


def plate_height(design: Wireframe) -> float:
    """Height of the plate in mm: what lies lowest rests on it with its radius."""
    return float(design.bounds[0, 2]) - float(np.median(design.radius))


def on_plate(design: Wireframe, height: ArrayLike, radius: ArrayLike) -> np.ndarray:
    """Tell whether struts of a radius (N,) that begin at a height (N,), both in mm, begin on the plate: (N,) bool."""
    usual = float(np.median(design.radius))
    result: np.ndarray = np.asarray(height) - plate_height(design) <= ON_PLATE * np.maximum(radius, usual)
    return result


MOST_SLENDER = 5000.0
"""Length of a strut in its radii beyond which it is no bead that a nozzle lays: a hair is as slender over a quarter of
a metre."""


def require_feet_on_plate(design: Wireframe) -> None:
    """Refuse a design with grounded joints that are in the air: what begins there has nothing to hold on to.

    Joints that count as grounded where nothing is said are never refused.

    Raises
    ------
    InputError
        The sentence names the joints and the height of the highest.
    """
    radius = np.zeros(design.vertex_count)
    np.maximum.at(radius, design.edges, design.radius[:, None])
    feet = design.grounded & (radius > 0.0) & ~lowest_vertices(design.vertices, design.edges)
    high = np.flatnonzero(feet & ~on_plate(design, design.vertices[:, 2], radius))
    if len(high):
        above = float(design.vertices[high, 2].max()) - float(design.bounds[0, 2])
        joints = f"{'joint' if len(high) == 1 else 'joints'} {shortened(high.tolist(), 8)}"
        problem = (
            f"{joints}, said to stand on the plate, {'is' if len(high) == 1 else 'are'} up to {above:.3g} mm above it"
        )
        remedy = "mark only what stands on the plate, on which the lowest of the frame lies"
        raise InputError.at(design.name, "grounded", problem, remedy)


def require_single_struts(design: Wireframe) -> None:
    """Refuse a design with a strut that lies in another one, from joints at the same places: it cannot be laid twice.

    Raises
    ------
    InputError
        The sentence names both struts.
    """
    middle = bezier.evaluate(design.control_points, np.full(1, 0.5)).reshape(-1, 3)
    pairs = cKDTree(middle).query_pairs(float(design.radius.max()), output_type="ndarray")
    one, other = (design.vertices[design.edges[pairs[:, k]]] for k in (0, 1))  # (P, 2, 3)
    ways = [np.linalg.norm(one - ends, axis=2).max(axis=1) for ends in (other, other[:, ::-1])]
    away = np.maximum(np.minimum(*ways), np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1))
    within = np.flatnonzero(away < design.radius[pairs].min(axis=1))
    if len(within):
        first, second = min(pairs[within].tolist())
        problem = f"strut {second} lies in strut {first}, between joints at the same places"
        raise InputError.at(design.name, "edges", problem, "let them share their joints, and remove one of the two")


def require_printable_radius(design: Wireframe) -> None:
    """Refuse a design with struts as thin as no bead is, for their length: its radii are in another unit.

    The tool would be looked at every fraction of a radius, without end.

    Raises
    ------
    InputError
        The sentence names the strut.
    """
    slender = design.lengths / design.radius
    strut = int(np.argmax(slender))
    if slender[strut] > MOST_SLENDER:
        problem = f"of strut {strut} is {design.radius[strut]:.3g} mm, a {slender[strut]:.0f}th of its length"
        raise InputError.at(design.name, "radius", problem, "give the radius in the unit of the joints")


def _poses_on_struts(places: np.ndarray, curves: np.ndarray, axes: np.ndarray, counts: np.ndarray) -> ToolPoses:
    """Evenly spaced poses along whole struts, each with its axis."""
    shares = [np.arange(count + 1) / count for count in counts[places]]
    return ToolPoses(
        place=places,
        first=np.concatenate([[0], np.cumsum([len(share) for share in shares])]),
        tip=np.concatenate([bezier.evaluate(curves[n], share) for n, share in zip(places, shares, strict=True)]),
        axis=np.repeat(axes[places], [len(share) for share in shares], axis=0),
        laid=np.concatenate(shares),
    )


def _into_the_plate(frame: Wireframe, sequence: PrintSequence, nozzle: Nozzle) -> list[Fault]:
    low = bezier.evaluate(sequence.directed_curves(frame), np.linspace(0.0, 1.0, 33))[..., 2].min(axis=1)
    depth = plate_height(frame) - low - np.minimum(0.0, nozzle.lowest(UP, sequence.axis))
    bad = np.flatnonzero(depth > LEAST_DEPTH * frame.extent)
    return [plate_fault(int(sequence.struts[n]), float(depth[n])) for n in bad]


def plate_fault(strut: int, depth: float, batch: int | None = None) -> Fault:
    """Say how many mm deep the nozzle goes into the plate."""
    return Fault("plate", strut, f"the nozzle goes {depth:.3g} mm into the plate", (), depth, batch)
