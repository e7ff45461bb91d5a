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
class Task:
    """What the search works on.

    Attributes
    ----------
    edges
        (E, 2) joints.
    grounded
        (V,) bool.
    bits
        (E, D, W) see `frametwin.printing.sequencing.clearance.collision_bits`.
    allowed
        (E, D, 2) bool: strut, axis, begun at its first or its second end.
    cost
        (E, D, 2) of choosing them.
    near
        (D, D) bool: neighbouring directions.
    height
        (E,) way of the struts' further ends from the plate along the frame, in median lengths.
    stiffness
        (E, 3, 3) see `end_stiffness`.
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
    def of(cls, frame: Wireframe, bits: np.ndarray, allowed: np.ndarray, cost: np.ndarray, near: np.ndarray) -> Task:
        """The task of a frame."""
        way = way_from_plate(frame)[frame.edges]
        height = (way.max(axis=1) + 0.01 * way.min(axis=1)) / float(np.median(frame.lengths))
        return cls(frame.edges, frame.grounded, bits, allowed, cost, near, height, end_stiffness(frame))


def last_sides(task: Task, present: np.ndarray, stage: np.ndarray | None = None) -> np.ndarray:
    """(E, 2) bool: of the struts ``present``, this one may be laid last, begun at its first or its second end."""
    ends, count = task.edges, len(task.grounded)
    degree = np.bincount(ends[present].ravel(), minlength=count)
    free = (degree[ends] == 1) & ~task.grounded[ends]  # (E, 2)
    bridge = np.zeros(len(ends), dtype=bool)
    bridges(ends, task.grounded, present, bridge)
    may = present & ~free.all(axis=1) & (~bridge | free.any(axis=1))
    if stage is not None and present.any():
        may &= stage == stage[present].max()
    result: np.ndarray = may[:, None] & ~free
    return result


def way_from_plate(frame: Wireframe) -> np.ndarray:
    """(V,) length of the shortest way along struts from the plate to each joint, mm; infinite where there is none.

    Built up in this order, arches grow from both feet and hanging parts after what they hang on; by mere height a thin
    chord spans the gap before anything braces it.
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
    struts, start, axis
        (N,) in the order of laying: strut, which of its ends it begins at (0 or 1), number of the direction.
    remaining
        (E,) bool: struts that could not be taken away.
    hits
        (E, D) how many of the remaining struts each strut's tool would hit.
    """

    struts: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    remaining: np.ndarray
    hits: np.ndarray


def remove_all(
    task: Task, stage: np.ndarray | None = None, tolerate: bool = False, noise: np.ndarray | None = None
) -> Removal:
    """Take the struts away one by one until none is left or none can go.

    Parameters
    ----------
    task
        What to work on.
    stage
        (E,) a strut goes only when all of higher stages are gone; default no matter.
    tolerate
        Where no strut can be reached freely, take the one whose tool hits the fewest others.
    noise
        (E,) added to the struts' heights: another order, where the first got stuck.
    """
    height = task.height if noise is None else task.height + noise
    order, start, axis = (np.full(len(task.edges), -1, dtype=np.int64) for _ in range(3))
    stage = np.zeros(len(task.edges), dtype=np.int64) if stage is None else stage
    remaining, hits = np.ones(len(task.edges), dtype=bool), np.zeros(task.bits.shape[:2], dtype=np.int64)
    fields = (task.edges, task.grounded, task.bits, task.allowed, task.cost, task.near, height, task.stiffness, stage)
    count = remove(fields, tolerate, remaining, hits, (order, start, axis))
    return Removal(order[:count][::-1], start[:count][::-1], axis[:count][::-1], remaining, hits)
