"""Compiled loops of `frametwin.fitting.joint_equations`: a Cholesky factorisation by blocks of 6 by 6.

Blocks lie column by column, the diagonal first in each; ``starts`` (V + 1,) says where a column begins and ``rows``
of which row each block is, both in the order of elimination. A block is kept transposed: the entry of row r and column
c is at (c, r), and two columns more, always zero, fill the vector registers.
"""

from __future__ import annotations

from math import sqrt

import numba as nb
import numpy as np

SIZE = 6
"""Freedoms of a joint."""

WIDE = 8
"""Numbers that are kept of each column of a block."""


@nb.njit(cache=True)
def filled(rows, starts, order, place):
    """Blocks of every column of the factor: where each column begins, and its rows, the diagonal first.

    A column has the rows of the matrix, and those of the columns for which it is the first row below the diagonal.
    """
    count = len(order)
    mark = np.full(count, -1)
    first_child, next_child = np.full(count, -1), np.full(count, -1)
    begin = np.zeros(count + 1, dtype=np.int64)
    found = np.empty(max(64, 8 * len(rows)), dtype=np.int64)
    end = 0
    for k in range(count):
        if end + count > len(found):
            more = np.empty(2 * len(found) + count, dtype=np.int64)
            more[:end] = found[:end]
            found = more
        begin[k] = end
        mark[k] = k
        found[end] = k
        end += 1
        joint = order[k]
        for i in range(starts[joint], starts[joint + 1]):
            row = place[rows[i]]
            if row > k and mark[row] != k:
                mark[row] = k
                found[end] = row
                end += 1
        child = first_child[k]
        while child >= 0:
            for i in range(begin[child] + 1, begin[child + 1]):
                row = found[i]
                if mark[row] != k:
                    mark[row] = k
                    found[end] = row
                    end += 1
            child = next_child[child]
        begin[k + 1] = end
        below = found[begin[k] + 1 : end]
        if len(below):
            below.sort()
            parent = below[0]
            next_child[k] = first_child[parent]
            first_child[parent] = k
    return begin, found[:end].copy()


@nb.njit(cache=True)
def entries(indices, columns, place, starts, rows):
    """Entries of the matrix's lower triangle in the order of elimination, and where each goes in the flat blocks."""
    source, slot = np.empty(len(indices), dtype=np.int64), np.empty(len(indices), dtype=np.int64)
    count = 0
    for i in range(len(indices)):
        row, column = place[indices[i] // SIZE], place[columns[i] // SIZE]
        r, c = indices[i] % SIZE, columns[i] % SIZE
        if row < column or (row == column and r < c):
            continue
        low, high = starts[column], starts[column + 1]
        while high - low > 1:
            middle = (low + high) // 2
            if rows[middle] <= row:
                low = middle
            else:
                high = middle
        source[count] = i
        slot[count] = (low * SIZE + c) * WIDE + r
        count += 1
    return source[:count].copy(), slot[:count].copy()


@nb.njit(cache=True, fastmath=True, error_model="numpy")
def factorised(blocks, starts, rows):
    """Overwrite the blocks of a matrix with those of its Cholesky factor; False if it is not positive definite.

    Column by column: each is finished, and what it leaves behind is taken from the columns to its right.
    """
    count = len(starts) - 1
    for k in range(count):
        first, end = starts[k], starts[k + 1]
        pivot = blocks[first]
        for c in range(SIZE):
            value = pivot[c, c]
            if not value > 0.0:
                return False
            scale = 1.0 / sqrt(value)
            for r in range(c, SIZE):
                pivot[c, r] *= scale
            for d in range(c + 1, SIZE):
                factor = pivot[c, d]
                for r in range(d, SIZE):
                    pivot[d, r] -= factor * pivot[c, r]
        for b in range(first + 1, end):
            own = blocks[b]
            for c in range(SIZE):
                scale = 1.0 / pivot[c, c]
                for r in range(WIDE):
                    own[c, r] *= scale
                for d in range(c + 1, SIZE):
                    factor = pivot[c, d]
                    for r in range(WIDE):
                        own[d, r] -= factor * own[c, r]
        for a in range(first + 1, end):
            left = blocks[a]
            at = starts[rows[a]]
            for b in range(a, end):
                while rows[at] != rows[b]:
                    at += 1
                _take(blocks[at], left, blocks[b])
    return True


@nb.njit(inline="always")
def _take(target, left, right):
    """Take the product of two blocks of a finished column from a block to its right."""
    for d in range(SIZE):
        for r in range(WIDE):
            target[d, r] -= (
                left[0, d] * right[0, r]
                + left[1, d] * right[1, r]
                + left[2, d] * right[2, r]
                + left[3, d] * right[3, r]
                + left[4, d] * right[4, r]
                + left[5, d] * right[5, r]
            )


@nb.njit(cache=True, fastmath=True, error_model="numpy")
def solved(blocks, starts, rows, sides):
    """Overwrite right-hand sides (V, 6, N), in the order of elimination, with the solution."""
    count, width = sides.shape[0], sides.shape[2]
    for k in range(count):
        own, pivot = sides[k], blocks[starts[k]]
        for c in range(SIZE):
            scale = 1.0 / pivot[c, c]
            for n in range(width):
                own[c, n] *= scale
            for d in range(c + 1, SIZE):
                factor = pivot[c, d]
                for n in range(width):
                    own[d, n] -= factor * own[c, n]
        for b in range(starts[k] + 1, starts[k + 1]):
            other, block = sides[rows[b]], blocks[b]
            for r in range(SIZE):
                for c in range(SIZE):
                    factor = block[c, r]
                    for n in range(width):
                        other[r, n] -= factor * own[c, n]
    for k in range(count - 1, -1, -1):
        own, pivot = sides[k], blocks[starts[k]]
        for b in range(starts[k] + 1, starts[k + 1]):
            other, block = sides[rows[b]], blocks[b]
            for c in range(SIZE):
                for r in range(SIZE):
                    factor = block[c, r]
                    for n in range(width):
                        own[c, n] -= factor * other[r, n]
        for c in range(SIZE - 1, -1, -1):
            for d in range(c + 1, SIZE):
                factor = pivot[c, d]
                for n in range(width):
                    own[c, n] -= factor * own[d, n]
            scale = 1.0 / pivot[c, c]
            for n in range(width):
                own[c, n] *= scale
