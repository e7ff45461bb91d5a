"""Compiled loops of the search for an order: compliance of joints, struts that others need to stand, what goes next.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

import numba as nb
import numpy as np

LARGEST_COMPLIANCE = 100.0
"""Greatest compliance that a joint is given; one at which nothing ends counts as none, and has 0."""

ATTRACTION = 3.0
"""How many median strut lengths further up a strut must be to go before one whose joint has a compliance of 1."""

AVERSION = 0.3
"""What raising the compliance of a joint by 1 costs, in median strut lengths."""

FREEDOM = 0.5
"""Worth of having all directions around the chosen one free, in shares of the largest tilt."""


@nb.njit(cache=True, error_model="numpy")
def joint_compliance(k: np.ndarray) -> float:
    """Find the greatest displacement of a joint under a unit force.

    Parameters
    ----------
    k : (3, 3) array
        Stiffness of the joint, the sum of `end_stiffness` over its struts.

    Returns
    -------
    The inverse of the least eigenvalue, `LARGEST_COMPLIANCE` at most; 0 where no strut ends.
    """
    q = (k[0, 0] + k[1, 1] + k[2, 2]) / 3.0
    if q <= 1e-12:
        return 0.0
    off = k[0, 1] ** 2 + k[0, 2] ** 2 + k[1, 2] ** 2
    a, b, c = k[0, 0] - q, k[1, 1] - q, k[2, 2] - q
    p = np.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)
    if p <= 1e-9 * q:
        return min(LARGEST_COMPLIANCE, 1.0 / q)
    d = a * (b * c - k[1, 2] ** 2) - k[0, 1] * (k[0, 1] * c - k[1, 2] * k[0, 2])
    d += k[0, 2] * (k[0, 1] * k[1, 2] - b * k[0, 2])
    angle = np.arccos(min(1.0, max(-1.0, d / (2.0 * p**3)))) / 3.0
    least = q + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)  # of the three eigenvalues (Smith, CACM 4(4), 1961)
    return min(LARGEST_COMPLIANCE, 1.0 / max(least, 1.0 / LARGEST_COMPLIANCE))


@nb.njit(cache=True, error_model="numpy")
def summed_compliance(edges: np.ndarray, grounded: np.ndarray, stiffness: np.ndarray, struts: np.ndarray) -> np.ndarray:
    """(N,) sum of the compliances of all joints off the plate, after each of the struts (N,) was laid."""
    support = np.zeros((len(grounded), 3, 3))
    result = np.zeros(len(struts))
    total = 0.0
    for n in range(len(struts)):
        for vertex in edges[struts[n]]:
            if not grounded[vertex]:
                total -= joint_compliance(support[vertex])
                support[vertex] += stiffness[struts[n]]
                total += joint_compliance(support[vertex])
        result[n] = total
    return result


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
def _priority(edges, grounded, support, stiffness, height, i):
    """How good it is to take strut i away next: high up, on a compliant joint, without making others compliant."""
    compliance, change = 0.0, 0.0
    for vertex in edges[i]:
        if not grounded[vertex]:
            before = joint_compliance(support[vertex])
            compliance = max(compliance, before)
            change += joint_compliance(support[vertex] - stiffness[i]) - before
    return height[i] + ATTRACTION * min(2.0, compliance) - AVERSION * change


@nb.njit(cache=True, error_model="numpy")
def _best_axis(allowed, cost, hits, near, i, side, most):
    """The direction of the tool with the fewest hits, up to ``most``; among those the cheapest.

    Neighbouring directions that are as good make one cheaper: there is freedom to tilt the tool.
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
            value = cost[i, d, side] - FREEDOM * free / max(1, around)
            if value < best_cost:
                best, best_cost = d, value
    return best, least, best_cost


@nb.njit(cache=True, error_model="numpy")
def _count_hits(bits, present, hits):
    """Add up in ``hits`` (E, D) how many of the present struts each strut's tool would hit."""
    for i in range(bits.shape[0]):
        for d in range(bits.shape[1]):
            for j in range(bits.shape[0]):
                if present[j] and (bits[i, d, j // 64] >> np.uint64(j % 64)) & np.uint64(1):
                    hits[i, d] += 1


@nb.njit(cache=True, error_model="numpy")
def _choose(space, degree, bridge, remaining, hits, priority, tolerate):
    """The strut to take away next, the end at which it begins and the tool's direction; -1 if there is none."""
    edges, grounded, _, allowed, cost, near, _, _, stage = space
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
        if fewest == 0 and best >= 0 and priority[i] <= highest:
            continue
        chosen, least, cheapest = (-1, -1), fewest + 1, np.inf
        for s in range(2):
            if not free_end[s]:
                d, count, value = _best_axis(allowed, cost, hits, near, i, s, fewest)
                if d >= 0 and (count < least or (count == least and value < cheapest)):
                    chosen, least, cheapest = (s, d), count, value
        if chosen[1] >= 0 and (best < 0 or least < fewest or priority[i] > highest):
            best, side, axis, fewest, highest = i, chosen[0], chosen[1], least, priority[i]
    return best, side, axis


@nb.njit(cache=True, error_model="numpy")
def remove(space, tolerate, remaining, hits, result):
    """Take struts away till none can go, and return how many went; see `removal.remove_all`.

    ``remaining`` (E,) and ``hits`` (E, D) are brought up to date, ``result`` are the struts in the order in which they
    went, their starting ends and directions.
    """
    edges, grounded, bits, _, _, _, height, stiffness, _ = space
    order, start, axis = result
    degree, support = np.zeros(len(grounded), dtype=np.int64), np.zeros((len(grounded), 3, 3))
    priority, bridge = np.zeros(len(edges)), np.zeros(len(edges), dtype=np.bool_)
    for i in range(len(edges)):
        if remaining[i]:
            for vertex in edges[i]:
                degree[vertex] += 1
                support[vertex] += stiffness[i]
    for i in range(len(edges)):
        priority[i] = _priority(edges, grounded, support, stiffness, height, i)
    _count_hits(bits, remaining, hits)
    for count in range(len(edges)):
        bridges(edges, grounded, remaining, bridge)
        strut, side, direction = _choose(space, degree, bridge, remaining, hits, priority, tolerate)
        if strut < 0:
            return count
        order[count], start[count], axis[count] = strut, side, direction
        remaining[strut] = False
        for vertex in edges[strut]:
            degree[vertex] -= 1
            support[vertex] -= stiffness[strut]
            if degree[vertex] == 0:
                support[vertex] = 0.0
        word, bit = strut // 64, np.uint64(strut % 64)
        for i in range(len(edges)):
            if remaining[i]:
                for d in range(bits.shape[1]):
                    hits[i, d] -= np.int64((bits[i, d, word] >> bit) & np.uint64(1))
                shared = (edges[i] == edges[strut, 0]).any() or (edges[i] == edges[strut, 1]).any()
                if shared:
                    priority[i] = _priority(edges, grounded, support, stiffness, height, i)
    return len(edges)
