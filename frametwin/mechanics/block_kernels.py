"""Compiled loops of sparse matrices of blocks of six by six, the joints of a frame, and of their factors L D L^T.

A frame's matrices have one and the same pattern all through a fit, and it is that of its struts. So the order in which
joints are eliminated is found once, on a graph that is 36 times as small as the matrix; and what is eliminated together
is worked on as one dense front, by loops that run in vector registers. Subtrees of fronts that have nothing to do with
each other are worked on by threads, always the same ones together and in one order, so that results do not depend on
how many threads there are.

References
----------
P. Amestoy, T. Davis, I. Duff, "An approximate minimum degree ordering algorithm", SIAM J. Matrix Anal. Appl. 17(4),
1996 (the quotient graph; degrees are exact here); J. Liu, "The multifrontal method for sparse matrix solution: theory
and practice", SIAM Review 34(1), 1992.

Helpers and constants are in this file too, and nowhere else: see `frametwin.raster.rod_kernels`.
"""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

ANY_ORDER = {"reassoc", "contract", "arcp", "nsz"}
"""Sums may be taken in vector registers; that pivots are no numbers is still to be seen, as it is not with all of
``fastmath``."""

HELPER: Any = {"cache": True, "fastmath": ANY_ORDER, "error_model": "numpy", "_nrt": False}
"""Options of functions that make no array: references to arrays need not be counted in them."""

B = 6
"""Rows of a block."""

TASKS = 2
"""Parts that threads share. With more of them, more is left for after them than is gained."""

OPENED = 40
"""Ways to divide the fronts that are tried, less one front at a time from the root down."""

CHILDREN, PARENT, SUBTREE, TASK, WAITING, FACTORS = 1, 2, 3, 4, 5, 6
"""Columns of what is known of a front; see `analyse`."""

U = np.uint64  # an index without a sign is not looked at for counting from the end


@nb.njit(**HELPER)
def multiply(starts, rows, data, right, result):
    """Add the product of a matrix with right sides (6V, M) to a result (6V, M)."""
    for j in range(len(starts) - 1):
        high = B * (starts[j + 1] - starts[j])
        for block in range(starts[j], starts[j + 1]):
            at, i = B * B * starts[j] + B * (block - starts[j]), B * rows[block]
            for r in range(B):
                a, b, c = data[at + r], data[at + high + r], data[at + 2 * high + r]
                d, e, f = data[at + 3 * high + r], data[at + 4 * high + r], data[at + 5 * high + r]
                to, k = U(i + r), U(B * j)
                for m in range(U(right.shape[1])):
                    first = a * right[k, m] + b * right[k + U(1), m] + c * right[k + U(2), m]
                    last = d * right[k + U(3), m] + e * right[k + U(4), m] + f * right[k + U(5), m]
                    result[to, m] += first + last


@nb.njit(**HELPER)
def _eliminate(starts, rows, neighbours, touching, counts, bounds, members, order, absorbed, marks, degrees):
    """Order the joints by minimum degree: at which step each is eliminated, and which joints are coupled by that, its
    ``degrees`` members from ``bounds`` on. Gives how many members there are in all, or more than there is room for.

    counts (2, V): how many joints that are still there a joint is coupled to by itself, and how many eliminated ones
    touch it, each of which couples all of its members.
    """
    count = len(starts) - 1
    for i in range(count):
        counts[0, i], counts[1, i] = 0, 0
        order[i], marks[i], absorbed[i] = -1, -1, 0
        for at in range(starts[i], starts[i + 1]):
            if rows[at] != i:
                neighbours[starts[i] + counts[0, i]] = rows[at]
                counts[0, i] += 1
        degrees[i] = counts[0, i]
    used = 0
    for step in range(count):
        p, least = -1, count + 1
        for i in range(count):
            if order[i] < 0 and degrees[i] < least:
                p, least = i, degrees[i]
        order[p], begin = step, used
        if used + least + 1 > len(members):
            return len(members) + 1
        marks[p] = step
        for at in range(starts[p], starts[p] + counts[0, p]):
            v = neighbours[at]
            if order[v] < 0 and marks[v] != step:
                marks[v] = step
                members[used] = v
                used += 1
        for at in range(starts[p], starts[p] + counts[1, p]):
            e = touching[at]
            absorbed[e] = 1
            for m in range(bounds[e], bounds[e] + degrees[e]):
                v = members[m]
                if order[v] < 0 and marks[v] != step:
                    marks[v] = step
                    members[used] = v
                    used += 1
        bounds[p], degrees[p] = begin, used - begin
        for m in range(begin, used):
            i = members[m]
            kept = 0
            for at in range(starts[i], starts[i] + counts[0, i]):
                v = neighbours[at]
                if order[v] < 0 and marks[v] != step:
                    neighbours[starts[i] + kept] = v
                    kept += 1
            counts[0, i] = kept
            kept = 0
            for at in range(starts[i], starts[i] + counts[1, i]):
                if absorbed[touching[at]] == 0:
                    touching[starts[i] + kept] = touching[at]
                    kept += 1
            touching[starts[i] + kept] = p
            counts[1, i] = kept + 1
        for m in range(begin, used):
            i = members[m]
            mark = count + step * count + m - begin  # one that was never used
            marks[i] = mark
            degree = 0
            for at in range(starts[i], starts[i] + counts[0, i]):
                marks[neighbours[at]] = mark
                degree += 1
            for at in range(starts[i], starts[i] + counts[1, i]):
                e = touching[at]
                for k in range(bounds[e], bounds[e] + degrees[e]):
                    v = members[k]
                    if order[v] < 0 and marks[v] != mark:
                        marks[v] = mark
                        degree += 1
            degrees[i] = degree
    return used


@nb.njit(cache=True, error_model="numpy")
def analyse(starts, rows, order, fronts, bounds, members, sizes):
    """In which order joints are eliminated, and in which fronts.

    starts (V+1,) and rows (M,) tell which blocks there are in each column, those of both triangles. Out: order (V,) of
    the joints; of each front fronts (V+1, 7) its first joint in that order, how many children it has, its parent or -1,
    the first front of the subtree below it, which of the `TASKS` it belongs to or -1 for what comes after them, where
    what is left of it waits for its parent, and where its factors begin; bounds (V+1,) where its members begin, the
    joints that its own are coupled to; and sizes (6,): how many fronts there are, how many members, rows of the largest
    front, numbers in all factors, room for what waits, and rows of the largest front of a task. Where there is no room
    for the members, there are no fronts.
    """
    count = len(starts) - 1
    room = len(members)
    found, begins = np.empty(room, dtype=np.int64), np.zeros(count, dtype=np.int64)
    step, degrees = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    marks, absorbed = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    left, right = np.empty(len(rows) + count, dtype=np.int64), np.empty(len(rows) + count, dtype=np.int64)
    counts = np.empty((2, count), dtype=np.int64)
    used = _eliminate(starts, rows, left, right, counts, begins, found, step, absorbed, marks, degrees)
    sizes[0] = 0
    if used > room:
        return
    # the elimination tree in postorder: children before their parents, and those of one next to each other
    parent, child = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    sibling, by_step = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for i in range(count):
        by_step[step[i]], parent[i], child[i], sibling[i] = i, -1, -1, -1
    for s in range(count - 1, -1, -1):
        i = by_step[s]
        for m in range(begins[i], begins[i] + degrees[i]):
            v = found[m]
            if parent[i] < 0 or step[v] < step[parent[i]]:
                parent[i] = v
        if parent[i] >= 0:
            sibling[i], child[parent[i]] = child[parent[i]], i
    place, stack, done = np.empty(count, dtype=np.int64), np.empty(count + 1, dtype=np.int64), 0
    for s in range(count):
        if parent[by_step[s]] >= 0:
            continue
        deep, stack[0] = 1, by_step[s]
        while deep > 0:
            i = stack[deep - 1]
            if child[i] >= 0:
                stack[deep], child[i] = child[i], sibling[child[i]]
                deep += 1
            else:
                place[i], order[done] = done, i
                done, deep = done + 1, deep - 1
    # fronts: joints one after the other whose columns have the same members
    number, used, total = -1, 0, 0
    of = np.empty(count, dtype=np.int64)
    for k in range(count):
        i = order[k]
        before = order[k - 1]
        if k == 0 or parent[before] != i or degrees[before] != degrees[i] + 1:
            number += 1
            fronts[number, 0], fronts[number, CHILDREN], fronts[number, PARENT] = k, 0, -1
        of[k] = number
    fronts[number + 1, 0] = count
    largest = 0
    for f in range(number + 1):
        last = order[fronts[f + 1, 0] - 1]
        bounds[f] = used
        for m in range(begins[last], begins[last] + degrees[last]):
            members[used] = place[found[m]]
            used += 1
        for m in range(bounds[f] + 1, used):  # sorted by insertion
            k, at = members[m], m
            while at > bounds[f] and members[at - 1] > k:
                members[at] = members[at - 1]
                at -= 1
            members[at] = k
        if used > bounds[f]:
            fronts[f, PARENT] = of[members[bounds[f]]]
            fronts[fronts[f, PARENT], CHILDREN] += 1
        wide, high = fronts[f + 1, 0] - fronts[f, 0], used - bounds[f]
        largest = max(largest, B * (wide + high))
        fronts[f, FACTORS] = total
        total += B * wide * B * (wide + high)
    bounds[number + 1] = used
    work = np.empty(number + 1)
    heads, loads = np.empty(number + 1, dtype=np.int64), np.empty(TASKS)
    _weigh(fronts, bounds, number + 1, work)
    best, opened = np.inf, 0
    for tried in range(OPENED):
        longest = _share(fronts, number + 1, work, heads, loads, tried)
        if longest < best:
            best, opened = longest, tried
    _share(fronts, number + 1, work, heads, loads, opened)
    waiting, most = _place_waiting(fronts, bounds, number + 1)
    sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5] = number + 1, used, largest, total, waiting, most


@nb.njit(**HELPER)
def _weigh(fronts, bounds, number, work):
    """Find the subtree below each front, and the work (number,) that it is."""
    for f in range(number):
        work[f], fronts[f, SUBTREE] = 0.0, f
    for f in range(number):  # children before their parents
        wide, high, parent = fronts[f + 1, 0] - fronts[f, 0], bounds[f + 1] - bounds[f], fronts[f, PARENT]
        work[f] += float(wide) * float(wide * wide + 3 * wide * high + 3 * high * high)
        if parent >= 0:
            work[parent] += work[f]
            fronts[parent, SUBTREE] = min(fronts[parent, SUBTREE], fronts[f, SUBTREE])


@nb.njit(**HELPER)
def _share(fronts, number, work, heads, loads, opened):
    """Give all subtrees to tasks, the heaviest first, each to the task that has least to do; and before that, open the
    heaviest so many times: its root comes after all tasks, and what is below it is given away by itself.

    heads (number,) and loads (TASKS,) are room. Gives the work from the first front to the last when each task has a
    thread.
    """
    last, count, whole = 0.0, 0, -1
    for f in range(number):
        fronts[f, TASK] = -1
        if fronts[f, PARENT] < 0:
            heads[count] = f
            count += 1
    for task in range(TASKS):
        loads[task] = 0.0
    while count > 0:
        heaviest, whole = 0, whole + 1
        for n in range(1, count):
            if work[heads[n]] > work[heads[heaviest]]:
                heaviest = n
        head = heads[heaviest]
        count -= 1
        heads[heaviest] = heads[count]
        if whole < opened:
            last += work[head]
            child = head - 1
            for _ in range(fronts[head, CHILDREN]):
                last -= work[child]
                heads[count] = child
                count += 1
                child = fronts[child, SUBTREE] - 1
        else:
            task = 0
            for n in range(1, TASKS):
                if loads[n] < loads[task]:
                    task = n
            loads[task] += work[head]
            for f in range(fronts[head, SUBTREE], head + 1):
                fronts[f, TASK] = task
    longest = 0.0
    for task in range(TASKS):
        longest = max(longest, loads[task])
    return last + longest


@nb.njit(**HELPER)
def _place_waiting(fronts, bounds, number):
    """Tell where what is left of each front waits for its parent: of a task's ones over what has been taken from there.
    Gives the room that it takes, and rows of the largest front of a task."""
    room, most = 0, 0
    for task in range(TASKS):
        top = room
        for f in range(number):
            if fronts[f, TASK] == task:
                child = f - 1
                for _ in range(fronts[f, CHILDREN]):
                    top = fronts[child, WAITING]
                    child = fronts[child, SUBTREE] - 1
                fronts[f, WAITING] = top
                high = B * (bounds[f + 1] - bounds[f])
                top += high * high
                room, most = max(room, top), max(most, B * (fronts[f + 1, 0] - fronts[f, 0]) + high)
    for f in range(number):
        if fronts[f, TASK] < 0:
            fronts[f, WAITING] = room
            room += (B * (bounds[f + 1] - bounds[f])) ** 2
    return room, most


@nb.njit(**HELPER)
def _factor_front(front, size, own, turned, pivots, first):
    """L D L^T of the first ``own`` of ``size`` rows of a front, of which the lower triangle is looked at, and what is
    left of the others. False where a pivot is 0 or no number."""
    for at in range(0, own, B):
        for j in range(at, at + B):
            pivot = front[j * size + j]
            if not abs(pivot) > 0.0 or not abs(pivot) < np.inf:
                return False
            pivots[first + j] = pivot
            inverse = 1.0 / pivot
            for r in range(j + 1, at + B):
                front[r * size + j] *= inverse
            for r in range(j + 1, at + B):
                weight = front[r * size + j] * pivot
                for c in range(j + 1, r + 1):
                    front[r * size + c] -= weight * front[c * size + j]
        for r in range(at + B, size):
            row = r * size + at
            for j in range(B):
                value = front[row + j]
                for q in range(j):
                    value -= turned[q * size + r] * front[(at + j) * size + at + q]
                turned[j * size + r] = value
            for j in range(B):
                front[row + j] = turned[j * size + r] / pivots[first + at + j]
        for r in range(at + B, size):
            row = r * size
            a, b, c = front[row + at], front[row + at + 1], front[row + at + 2]
            d, e, f = front[row + at + 3], front[row + at + 4], front[row + at + 5]
            base = U(row)
            for k in range(U(at + B), U(r + 1)):
                more = a * turned[k] + b * turned[U(size) + k] + c * turned[U(2 * size) + k]
                more += d * turned[U(3 * size) + k] + e * turned[U(4 * size) + k] + f * turned[U(5 * size) + k]
                front[base + k] -= more
    return True


@nb.njit(**HELPER)
def _eliminate_front(
    f, starts, rows, data, order, place, fronts, bounds, members, front, turned, local, waiting, factors, pivots
):
    """Factors of a front whose children are done. False where a pivot is 0 or no number.

    front, turned and local (V,) are room for what is worked on, a panel of it, and where joints are in it.
    """
    first, after = fronts[f, 0], fronts[f + 1, 0]
    wide, high = after - first, bounds[f + 1] - bounds[f]
    size, own = B * (wide + high), B * wide
    for k in range(U(size * size)):
        front[k] = 0.0
    for k in range(first, after):
        local[k] = B * (k - first)
    for m in range(high):
        local[members[bounds[f] + m]] = own + B * m
    for k in range(first, after):
        i = order[k]
        column, tall = local[k], B * (starts[i + 1] - starts[i])
        for b in range(starts[i], starts[i + 1]):
            other = place[rows[b]]
            if other < k:
                continue
            row, source = local[other], B * B * starts[i] + B * (b - starts[i])
            for c in range(B):
                for r in range(B):
                    front[(row + r) * size + column + c] = data[source + c * tall + r]
    child = f - 1
    for _ in range(fronts[f, CHILDREN]):
        begin, length = bounds[child], bounds[child + 1] - bounds[child]
        _extend_front(front, size, waiting, fronts[child, WAITING], members, begin, length, local)
        child = fronts[child, SUBTREE] - 1
    if not _factor_front(front, size, own, turned, pivots, B * first):
        return False
    at, top = fronts[f, FACTORS], fronts[f, WAITING]
    for r in range(size):
        for c in range(own):
            factors[at + r * own + c] = front[r * size + c]
    for r in range(own, size):
        to = top + (r - own) * B * high
        for c in range(own, r + 1):
            waiting[to + c - own] = front[r * size + c]
    return True


@nb.njit(**HELPER)
def _eliminate_task(
    task,
    starts,
    rows,
    data,
    order,
    place,
    fronts,
    bounds,
    members,
    sizes,
    front,
    turned,
    local,
    waiting,
    factors,
    pivots,
):
    """Factors of the fronts of one task, whose children are done or among them. False as of `_eliminate_front`."""
    for f in range(sizes[0]):
        if fronts[f, TASK] == task and not _eliminate_front(
            f,
            starts,
            rows,
            data,
            order,
            place,
            fronts,
            bounds,
            members,
            front,
            turned,
            local,
            waiting,
            factors,
            pivots,
        ):
            return False
    return True


@nb.njit(cache=True, error_model="numpy")
def factorise(tasks, starts, rows, data, order, fronts, bounds, members, sizes, waiting, factors, pivots, good):
    """Factors of the fronts of some tasks, one after the other; -1 is what comes after all others.

    data has the blocks' columns one after the other, each through all of its blocks; of each pair of blocks on both
    sides of the diagonal one is looked at. Out: factors, front by front (rows, own columns), and pivots (6V,), in the
    joints' order; good (1,) is 0 where a pivot is 0 or no number, else 1. waiting is room that all tasks share, from
    one call to the next.
    """
    count = len(order)
    place, local = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for k in range(count):
        place[order[k]] = k
    front, turned = np.empty(sizes[2] * sizes[2]), np.empty(B * sizes[2])
    good[0] = 1
    for task in tasks:
        if good[0] == 1 and not _eliminate_task(
            task,
            starts,
            rows,
            data,
            order,
            place,
            fronts,
            bounds,
            members,
            sizes,
            front,
            turned,
            local,
            waiting,
            factors,
            pivots,
        ):
            good[0] = 0


@nb.njit(parallel=True, cache=True, error_model="numpy")
def factorise_together(starts, rows, data, order, fronts, bounds, members, sizes, waiting, factors, pivots, good):
    """As `factorise`, of all tasks but the last at the same time."""
    count = len(order)
    place, fine = np.empty(count, dtype=np.int64), np.empty(TASKS, dtype=np.int64)
    for k in range(count):
        place[order[k]] = k
    for task in nb.prange(TASKS):
        front, turned = np.empty(sizes[5] * sizes[5]), np.empty(B * sizes[5])
        local = np.empty(count, dtype=np.int64)
        done = _eliminate_task(
            task,
            starts,
            rows,
            data,
            order,
            place,
            fronts,
            bounds,
            members,
            sizes,
            front,
            turned,
            local,
            waiting,
            factors,
            pivots,
        )
        fine[task] = 1 if done else 0
    good[0] = fine.min()


@nb.njit(**HELPER)
def _extend_front(front, size, waiting, top, members, begin, length, local):
    """Add what is left of a child to the front of its parent."""
    for m in range(length):
        row = local[members[begin + m]]
        for r in range(B):
            to, source = (row + r) * size, top + (B * m + r) * B * length
            for k in range(m + 1):
                column = local[members[begin + k]]
                for c in range(B):
                    front[to + column + c] += waiting[source + B * k + c]


@nb.njit(cache=True, fastmath=ANY_ORDER, error_model="numpy")
def solve(order, fronts, bounds, members, sizes, factors, pivots, right, result):
    """Solutions (6V, M) for right sides (6V, M)."""
    count, number, sides = len(order), sizes[0], right.shape[1]
    values = np.empty((B * count, sides))
    places = np.empty(sizes[2], dtype=np.int64)
    for k in range(count):
        for r in range(B):
            for m in range(sides):
                values[B * k + r, m] = right[B * order[k] + r, m]
    for f in range(number):
        own, size = _rows_of(f, fronts, bounds, members, places)
        _forwards(values, factors, fronts[f, FACTORS], places, own, size)
    for i in range(B * count):
        inverse = 1.0 / pivots[i]
        for m in range(sides):
            values[i, m] *= inverse
    for back in range(number):
        f = number - 1 - back
        own, size = _rows_of(f, fronts, bounds, members, places)
        _backwards(values, factors, fronts[f, FACTORS], places, own, size)
    for k in range(count):
        for r in range(B):
            for m in range(sides):
                result[B * order[k] + r, m] = values[B * k + r, m]


@nb.njit(**HELPER)
def _rows_of(f, fronts, bounds, members, places):
    """How many own rows a front has and how many in all, and where they are."""
    first, own = B * fronts[f, 0], B * (fronts[f + 1, 0] - fronts[f, 0])
    for r in range(own):
        places[r] = first + r
    size = own
    for m in range(bounds[f], bounds[f + 1]):
        for r in range(B):
            places[size + r] = B * members[m] + r
        size += B
    return own, size


@nb.njit(**HELPER)
def _forwards(values, factors, at, places, own, size):
    sides, first = values.shape[1], places[0]
    for r in range(1, size):
        to, row, many = places[r], at + r * own, min(r, own)
        if sides == 1:
            total = 0.0
            for c in range(U(many)):
                total += factors[U(row) + c] * values[U(first) + c, U(0)]
            values[to, 0] -= total
        else:
            for c in range(many):
                weight = factors[row + c]
                for m in range(U(sides)):
                    values[U(to), m] -= weight * values[U(first + c), m]


@nb.njit(**HELPER)
def _backwards(values, factors, at, places, own, size):
    sides, first = values.shape[1], places[0]
    for back in range(1, size):
        r = size - back
        to, row, many = places[r], at + r * own, min(r, own)
        if sides == 1:
            value = values[to, 0]
            for c in range(U(many)):
                values[U(first) + c, U(0)] -= factors[U(row) + c] * value
        else:
            for c in range(many):
                weight = factors[row + c]
                for m in range(U(sides)):
                    values[U(first + c), m] -= weight * values[U(to), m]
