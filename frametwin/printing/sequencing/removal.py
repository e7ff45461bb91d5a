"""The search for an order, backwards: struts are taken away from the finished frame, and laid in the opposite order.

A strut may go when all that remains still has a way to the plate and the tool can reach it past what remains. The fewer
struts remain, the freer the tool, so a strut that can be reached stays within reach and the search seldom runs into a
dead end, where building upwards often does (regression planning: Y. Huang, C. R. Garrett, I. Ting, S. Parascho,
C. T. Mueller, "Robotic additive construction of bar structures", Construction Robotics 5, 2021).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.stability import end_stiffness, flexibility

ATTRACTION = 3.0
"""How many median strut lengths further up a strut must be to go before one that hangs on a joint of flexibility 1."""

AVERSION = 0.3
"""What loosening a joint by a flexibility of 1 costs, in median strut lengths."""


ROOM = 0.5
"""Worth of free directions all around the chosen one, in shares of the largest tilt."""


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
    count = _remove(fields, tolerate, remaining, hits, (order, start, axis))
    return Removal(order[:count][::-1], start[:count][::-1], axis[:count][::-1], remaining, hits)


@nb.njit(cache=True, error_model="numpy")
def bridges(edges: np.ndarray, grounded: np.ndarray, present: np.ndarray, bridge: np.ndarray) -> None:
    """Mark in ``bridge`` (E,) the present struts without which something would lose its way to the plate.

    The plate is one vertex. Depth-first search with low points (R. Tarjan, Information Processing Letters 2(6), 1974).
    """
    count = len(grounded)
    bridge[:] = False
    plate = count
    node = np.empty((len(edges), 2), dtype=np.int64)
    first = np.zeros(count + 2, dtype=np.int64)
    for e in range(len(edges)):
        for side in range(2):
            node[e, side] = plate if grounded[edges[e, side]] else edges[e, side]
            if present[e]:
                first[node[e, side] + 1] += 1
    first = np.cumsum(first)
    fill = first.copy()
    incident = np.empty(first[-1], dtype=np.int64)
    for e in range(len(edges)):
        if present[e]:
            for side in range(2):
                incident[fill[node[e, side]]] = e
                fill[node[e, side]] += 1
    found, low = np.full(count + 1, -1, dtype=np.int64), np.zeros(count + 1, dtype=np.int64)
    at, via = first[:-1].copy(), np.full(count + 1, -1, dtype=np.int64)
    stack = np.empty(count + 1, dtype=np.int64)
    stack[0], top, clock = plate, 1, 1
    found[plate] = low[plate] = 0
    while top > 0:
        vertex = stack[top - 1]
        if at[vertex] < first[vertex + 1]:
            e = incident[at[vertex]]
            at[vertex] += 1
            other = node[e, 1] if node[e, 0] == vertex else node[e, 0]
            if e == via[vertex] or other == vertex:
                continue
            if found[other] >= 0:
                low[vertex] = min(low[vertex], found[other])
            else:
                found[other] = low[other] = clock
                clock += 1
                via[other] = e
                stack[top] = other
                top += 1
        else:
            top -= 1
            if top > 0:
                parent = stack[top - 1]
                low[parent] = min(low[parent], low[vertex])
                if low[vertex] > found[parent]:
                    bridge[via[vertex]] = True


@nb.njit(cache=True, error_model="numpy")
def _appeal(edges, grounded, held, stiffness, height, i):  # type: ignore[no-untyped-def]
    """How good it is to take strut i away next: high up, on a loose joint, without loosening others."""
    looseness, change = 0.0, 0.0
    for vertex in edges[i]:
        if not grounded[vertex]:
            before = flexibility(held[vertex])
            looseness = max(looseness, before)
            change += flexibility(held[vertex] - stiffness[i]) - before
    return height[i] + ATTRACTION * min(2.0, looseness) - AVERSION * change


@nb.njit(cache=True, error_model="numpy")
def _best_axis(allowed, cost, hits, near, i, side, most):  # type: ignore[no-untyped-def]
    """The way of holding the tool with the fewest hits, up to ``most``; among those the cheapest.

    Neighbouring directions that are as good count as a merit: there is room to tilt the tool.
    """
    count, least = allowed.shape[1], most + 1
    for d in range(count):
        if allowed[i, d, side]:
            least = min(least, hits[i, d])
    best, best_cost = -1, np.inf
    if least > most:
        return best, least, best_cost
    for d in range(count):
        if allowed[i, d, side] and hits[i, d] == least:
            free, around = 0, 0
            for e in range(count):
                if near[d, e]:
                    around += 1
                    free += allowed[i, e, side] and hits[i, e] <= least
            value = cost[i, d, side] - ROOM * free / max(1, around)
            if value < best_cost:
                best, best_cost = d, value
    return best, least, best_cost


@nb.njit(cache=True, error_model="numpy")
def _count_hits(bits, present, hits):  # type: ignore[no-untyped-def]
    for i in range(bits.shape[0]):
        for d in range(bits.shape[1]):
            for j in range(bits.shape[0]):
                if present[j] and (bits[i, d, j // 64] >> np.uint64(j % 64)) & np.uint64(1):
                    hits[i, d] += 1


@nb.njit(cache=True, error_model="numpy")
def _choose(task, degree, bridge, remaining, hits, appeal, tolerate):  # type: ignore[no-untyped-def]
    """The strut to take away next, the end it begins at and the tool's axis; -1 if there is none."""
    edges, grounded, _, allowed, cost, near, _, _, stage = task
    best, side, axis = -1, -1, -1
    fewest, highest = np.int64(len(edges)) if tolerate else np.int64(0), -np.inf
    last = stage[remaining].max()
    for i in range(len(edges)):
        if not remaining[i] or stage[i] < last:
            continue
        a, b = edges[i]
        free_end = (degree[a] == 1 and not grounded[a], degree[b] == 1 and not grounded[b])
        if (free_end[0] and free_end[1]) or (bridge[i] and not (free_end[0] or free_end[1])):
            continue
        if fewest == 0 and best >= 0 and appeal[i] <= highest:
            continue
        chosen, least, cheapest = (-1, -1), fewest + 1, np.inf
        for s in range(2):
            if not free_end[s]:
                d, count, value = _best_axis(allowed, cost, hits, near, i, s, fewest)
                if d >= 0 and (count < least or (count == least and value < cheapest)):
                    chosen, least, cheapest = (s, d), count, value
        if chosen[1] >= 0 and (best < 0 or least < fewest or appeal[i] > highest):
            best, side, axis, fewest, highest = i, chosen[0], chosen[1], least, appeal[i]
    return best, side, axis


@nb.njit(cache=True, error_model="numpy")
def _remove(task, tolerate, remaining, hits, result):  # type: ignore[no-untyped-def]
    edges, grounded, bits, _, _, _, height, stiffness, _ = task
    order, start, axis = result
    degree, held = np.zeros(len(grounded), dtype=np.int64), np.zeros((len(grounded), 3, 3))
    appeal, bridge = np.zeros(len(edges)), np.zeros(len(edges), dtype=np.bool_)
    for i in range(len(edges)):
        if remaining[i]:
            for vertex in edges[i]:
                degree[vertex] += 1
                held[vertex] += stiffness[i]
    for i in range(len(edges)):
        appeal[i] = _appeal(edges, grounded, held, stiffness, height, i)
    _count_hits(bits, remaining, hits)
    for count in range(len(edges)):
        bridges(edges, grounded, remaining, bridge)
        strut, side, direction = _choose(task, degree, bridge, remaining, hits, appeal, tolerate)
        if strut < 0:
            return count
        order[count], start[count], axis[count] = strut, side, direction
        remaining[strut] = False
        for vertex in edges[strut]:
            degree[vertex] -= 1
            held[vertex] -= stiffness[strut]
            if degree[vertex] == 0:
                held[vertex] = 0.0
        word, bit = strut // 64, np.uint64(strut % 64)
        for i in range(len(edges)):
            if remaining[i]:
                for d in range(bits.shape[1]):
                    hits[i, d] -= np.int64((bits[i, d, word] >> bit) & np.uint64(1))
                shared = (edges[i] == edges[strut, 0]).any() or (edges[i] == edges[strut, 1]).any()
                if shared:
                    appeal[i] = _appeal(edges, grounded, held, stiffness, height, i)
    return len(edges)
