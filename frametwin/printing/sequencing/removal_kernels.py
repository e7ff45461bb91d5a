"""Compiled loops of the search for an order: how loose joints are, what the print needs to stand, what goes next.

Helpers and constants are in this file too, and nowhere else: numba keeps machine code until the file of the function
that is called changes, and would not notice an edit elsewhere (``tests/test_compiled_code.py`` sees to it).
"""

from __future__ import annotations

import numba as nb
import numpy as np

SOFTEST = 100.0
"""Greatest flexibility that a joint is given; one held by nothing at all counts as no joint."""

ATTRACTION = 3.0
"""How many median strut lengths further up a strut must be to go before one that hangs on a joint of flexibility 1."""

AVERSION = 0.3
"""What loosening a joint by a flexibility of 1 costs, in median strut lengths."""

ROOM = 0.5
"""Worth of free directions all around the chosen one, in shares of the largest tilt."""


@nb.njit(cache=True, error_model="numpy")
def flexibility(k: np.ndarray) -> float:
    """Greatest displacement of a joint under a unit force, from its stiffness (3, 3); 0 for one that holds nothing."""
    q = (k[0, 0] + k[1, 1] + k[2, 2]) / 3.0
    if q <= 1e-12:
        return 0.0
    off = k[0, 1] ** 2 + k[0, 2] ** 2 + k[1, 2] ** 2
    a, b, c = k[0, 0] - q, k[1, 1] - q, k[2, 2] - q
    p = np.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)
    if p <= 1e-9 * q:
        return min(SOFTEST, 1.0 / q)
    d = a * (b * c - k[1, 2] ** 2) - k[0, 1] * (k[0, 1] * c - k[1, 2] * k[0, 2])
    d += k[0, 2] * (k[0, 1] * k[1, 2] - b * k[0, 2])
    angle = np.arccos(min(1.0, max(-1.0, d / (2.0 * p**3)))) / 3.0
    least = q + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)  # of the three eigenvalues (Smith, CACM 4(4), 1961)
    return min(SOFTEST, 1.0 / max(least, 1.0 / SOFTEST))


@nb.njit(cache=True, error_model="numpy")
def summed_flexibility(edges: np.ndarray, grounded: np.ndarray, stiffness: np.ndarray, struts: np.ndarray):
    held = np.zeros((len(grounded), 3, 3))
    result = np.zeros(len(struts))
    total = 0.0
    for n in range(len(struts)):
        for vertex in edges[struts[n]]:
            if not grounded[vertex]:
                total -= flexibility(held[vertex])
                held[vertex] += stiffness[struts[n]]
                total += flexibility(held[vertex])
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
def _appeal(edges, grounded, held, stiffness, height, i):
    """How good it is to take strut i away next: high up, on a loose joint, without loosening others."""
    looseness, change = 0.0, 0.0
    for vertex in edges[i]:
        if not grounded[vertex]:
            before = flexibility(held[vertex])
            looseness = max(looseness, before)
            change += flexibility(held[vertex] - stiffness[i]) - before
    return height[i] + ATTRACTION * min(2.0, looseness) - AVERSION * change


@nb.njit(cache=True, error_model="numpy")
def _best_axis(allowed, cost, hits, near, i, side, most):
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
def _count_hits(bits, present, hits):
    for i in range(bits.shape[0]):
        for d in range(bits.shape[1]):
            for j in range(bits.shape[0]):
                if present[j] and (bits[i, d, j // 64] >> np.uint64(j % 64)) & np.uint64(1):
                    hits[i, d] += 1


@nb.njit(cache=True, error_model="numpy")
def _choose(task, degree, bridge, remaining, hits, appeal, tolerate):
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
def remove(task, tolerate, remaining, hits, result):
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
