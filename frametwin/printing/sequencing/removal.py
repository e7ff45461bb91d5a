"""The search for an order, backwards: struts are taken away from the finished frame, and laid in the opposite order.

A strut may go when all that remains still has a way to the plate and the tool can reach it past what remains. The fewer
struts remain, the freer the tool, so a strut that can be reached stays within reach and the search seldom runs into a
dead end, where building upwards often does (regression planning: Y. Huang, C. R. Garrett, I. Ting, S. Parascho,
C. T. Mueller, "Robotic additive construction of bar structures", Construction Robotics 5, 2021).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.removal_kernels import bridges, remove
from frametwin.printing.sequencing.stability import end_stiffness


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """What the search for an order chooses from: struts, tool orientations, and what each pair of them would hit.

    Attributes
    ----------
    edges : (E, 2) int64 array
        Joints of each strut.
    grounded : (V,) bool array
        The joint is on the plate.
    bits : (E, D, W) uint64 array
        See `frametwin.printing.sequencing.clearance.collision_bits`.
    allowed : (E, D, 2) bool array
        Strut, tool orientation, and the end at which the strut is begun; see `allowed_orientations`.
    cost : (E, D, 2) array
        Of choosing them; see `orientation_costs`.
    near : (D, D) bool array
        Orientations that are next to each other.
    height : (E,) array
        Path along the frame from the plate to the strut's further end, in median strut lengths.
    stiffness : (E, 3, 3) array
        See `end_stiffness`.
    """

    edges: np.ndarray
    grounded: np.ndarray
    bits: np.ndarray
    allowed: np.ndarray
    cost: np.ndarray
    near: np.ndarray
    height: np.ndarray
    stiffness: np.ndarray

    @classmethod
    def of(
        cls, frame: Wireframe, bits: np.ndarray, allowed: np.ndarray, cost: np.ndarray, near: np.ndarray
    ) -> SearchSpace:
        """Take joints, heights and stiffness from a frame; the rest as in the attributes."""
        way = path_length_from_plate(frame)[frame.edges]
        height = (way.max(axis=1) + 0.01 * way.min(axis=1)) / float(np.median(frame.lengths))
        return cls(frame.edges, frame.grounded, bits, allowed, cost, near, height, end_stiffness(frame))


def removable_from(space: SearchSpace, present: np.ndarray, stage: np.ndarray | None = None) -> np.ndarray:
    """Find the struts that may be laid last: none of the others needs them to stand.

    Parameters
    ----------
    space
        What is chosen from.
    present : (E,) bool array
        The struts among which to choose.
    stage : (E,) int64 array, optional
        Only struts of the highest stage that is present may be last.

    Returns
    -------
    (E, 2) bool array
        The strut may be last, begun at its first or its second end.
    """
    ends, count = space.edges, len(space.grounded)
    degree = np.bincount(ends[present].ravel(), minlength=count)
    free = (degree[ends] == 1) & ~space.grounded[ends]  # (E, 2)
    bridge = np.zeros(len(ends), dtype=bool)
    bridges(ends, space.grounded, present, bridge)
    may = present & ~free.all(axis=1) & (~bridge | free.any(axis=1))
    if stage is not None and present.any():
        may &= stage == stage[present].max()
    result: np.ndarray = may[:, None] & ~free
    return result


def path_length_from_plate(frame: Wireframe) -> np.ndarray:
    """Find the length of the shortest path along struts from the plate to each joint.

    Built up in this order, arches grow from both feet and hanging parts after what they hang on; by mere height a thin
    chord spans the gap before anything braces it.

    Returns
    -------
    (V,) array, mm
        Infinite where there is no path.
    """
    ends = (frame.edges[:, 0], frame.edges[:, 1])
    graph = csr_matrix((frame.lengths, ends), shape=(frame.vertex_count,) * 2)
    feet = np.flatnonzero(frame.grounded)
    result: np.ndarray = dijkstra(graph, directed=False, indices=feet, min_only=True)
    return result


@dataclass(frozen=True, eq=False)
class Removal:
    """How far the search came.

    Attributes
    ----------
    struts, start, axis : (N,) int64 array
        In the order of laying: strut, the end at which it begins (0 or 1), number of the tool orientation.
    remaining : (E,) bool array
        Struts that could not be taken away.
    hits : (E, D) int64 array
        How many of the remaining struts each strut's tool would hit.
    """

    struts: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    remaining: np.ndarray
    hits: np.ndarray


def remove_all(
    space: SearchSpace, stage: np.ndarray | None = None, tolerate: bool = False, perturbation: np.ndarray | None = None
) -> Removal:
    """Take the struts away one by one until none is left or none can go.

    Parameters
    ----------
    space
        What is chosen from.
    stage : (E,) int64 array, optional
        A strut goes only when all of higher stages are gone.
    tolerate
        Where no strut can be reached freely, take the one whose tool hits the fewest others.
    perturbation : (E,) array, optional
        Added to the struts' heights: gives another order, where the first got stuck.
    """
    height = space.height if perturbation is None else space.height + perturbation
    order, start, axis = (np.full(len(space.edges), -1, dtype=np.int64) for _ in range(3))
    stage = np.zeros(len(space.edges), dtype=np.int64) if stage is None else stage
    remaining, hits = np.ones(len(space.edges), dtype=bool), np.zeros(space.bits.shape[:2], dtype=np.int64)
    fields = (
        space.edges,
        space.grounded,
        space.bits,
        space.allowed,
        space.cost,
        space.near,
        height,
        space.stiffness,
        stage,
    )
    count = remove(fields, tolerate, remaining, hits, (order, start, axis))
    return Removal(order[:count][::-1], start[:count][::-1], axis[:count][::-1], remaining, hits)
