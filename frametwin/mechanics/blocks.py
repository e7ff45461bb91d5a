"""Sparse matrices of blocks of six by six, one for each joint and each joined pair, and factors of symmetric ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from frametwin.compiled.kept_loops import KeptLoops

block_kernels = KeptLoops("frametwin.mechanics.block_kernels")

BLOCK = 6

ALL, LAST = np.array([0, 1, -1]), np.array([-1])
"""Tasks that one thread does, and what comes after the others; see `block_kernels.analyse`."""

FEW = 500_000
"""Numbers in factors, below which threads would wait for each other longer than they save."""


@dataclass(frozen=True, eq=False)
class BlockPattern:
    """Where the entries of elements between two joints go in the matrix of all of them, by columns.

    A column holds the rows of its joint and of the joints that elements join it to, six for each, in their order.

    Attributes
    ----------
    starts, rows : (V+1,) and (M,) int64 arrays
        The blocks in each column of blocks.
    slots : (144 N,) int64 array
        Of every entry of the elements (N, 12, 12); 36 M, behind all of them, where an end is held.
    own : (V, 6, 6) int64 array
        Slots of the joints' own blocks, by row and column.
    """

    starts: np.ndarray
    rows: np.ndarray
    slots: np.ndarray
    own: np.ndarray

    @classmethod
    def of(cls, edges: np.ndarray, count: int) -> BlockPattern:
        """The pattern of elements between the joints ``edges`` (N, 2) of ``count``; -1 is an end that is held."""
        elements = len(edges)
        pairs = (edges[:, None, :] * count + edges[:, :, None]).ravel()  # column and row of each block
        free = ((edges[:, None, :] >= 0) & (edges[:, :, None] >= 0)).ravel()
        keys, place = np.unique(np.append(pairs[free], np.arange(count) * (count + 1)), return_inverse=True)
        column, row = np.divmod(keys, max(count, 1))
        starts = np.append(0, np.cumsum(np.bincount(column, minlength=count)))
        inside = _slots_of_blocks(starts, column)
        slots = np.full((4 * elements, BLOCK, BLOCK), 36 * len(keys))
        joined = int(free.sum())
        slots[free] = inside[place[:joined]]
        slots = slots.reshape(elements, 2, 2, BLOCK, BLOCK).transpose(0, 1, 3, 2, 4).ravel()
        return cls(starts, row, slots, inside[place[joined:]])

    @property
    def diagonal(self) -> np.ndarray:
        """(6V,) slots of the diagonal."""
        return np.diagonal(self.own, axis1=1, axis2=2).ravel()

    @cached_property
    def elimination(self) -> Elimination:
        """In which order its joints are eliminated."""
        return Elimination.of(self.starts, self.rows)

    def summed(self, elements: np.ndarray) -> np.ndarray:
        """(36 M,) entries of the sum of elements (N, 12, 12)."""
        size = BLOCK * BLOCK * len(self.rows)
        found = np.bincount(self.slots, weights=elements.ravel(), minlength=size + 1)[:size]
        return found.astype(np.float64, copy=False)  # of nothing it is one of whole numbers


def _slots_of_blocks(starts: np.ndarray, column: np.ndarray) -> np.ndarray:
    """(M, 6, 6) slots of the entries of each block, by row and column; ``column`` (M,) is that of each block."""
    high = np.diff(starts)  # blocks in a column
    corner = 36 * starts[column] + BLOCK * (np.arange(len(column)) - starts[column])
    six = np.arange(BLOCK)
    return np.asarray(corner[:, None, None] + (BLOCK * high[column])[:, None, None] * six + six[:, None])


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """A matrix (6V, 6V) of a pattern.

    Attributes
    ----------
    pattern : BlockPattern
    entries : (36 M,) array
        As `BlockPattern.summed` gives them.
    """

    pattern: BlockPattern
    entries: np.ndarray

    __array_ufunc__ = None  # arrays leave products with it to it

    @property
    def shape(self) -> tuple[int, int]:
        """(6V, 6V)."""
        return (BLOCK * len(self.pattern.own),) * 2

    @property
    def diagonal(self) -> np.ndarray:
        """(6V,) entries of the diagonal."""
        return self.entries[self.pattern.diagonal]

    def __add__(self, other: BlockMatrix) -> BlockMatrix:
        """The sum of two matrices of the same pattern."""
        return BlockMatrix(self.pattern, self.entries + other.entries)

    def __rmul__(self, factor: float) -> BlockMatrix:
        """The matrix, so many times."""
        return BlockMatrix(self.pattern, factor * self.entries)

    def __matmul__(self, right: np.ndarray) -> np.ndarray:
        """Product with (6V,) or (6V, K), in the precision of these."""
        sides = np.ascontiguousarray(right[:, None] if right.ndim == 1 else right)
        result = np.zeros_like(sides)
        entries = np.ascontiguousarray(self.entries, dtype=sides.dtype)
        block_kernels.multiply(self.pattern.starts, self.pattern.rows, entries, sides, result)
        return result.reshape(right.shape)

    def plus_diagonal(self, values: np.ndarray) -> BlockMatrix:
        """The matrix with values (6V,) added to its diagonal."""
        entries = np.array(self.entries)
        entries[self.pattern.diagonal] += values
        return BlockMatrix(self.pattern, entries)

    def factorise(self, alone: bool | None = None) -> BlockFactor:
        """See `Elimination.factorise`."""
        return self.pattern.elimination.factorise(self.entries, alone)

    def toarray(self) -> np.ndarray:
        """All of it, what is zero too."""
        starts, rows, count = self.pattern.starts, self.pattern.rows, len(self.pattern.own)
        column = np.repeat(np.arange(count), np.diff(starts))
        result = np.zeros((count, BLOCK, count, BLOCK))
        result[rows, :, column] = self.entries[_slots_of_blocks(starts, column)]
        return result.reshape(self.shape)


@dataclass(frozen=True, eq=False)
class Elimination:
    """In which order the joints of a pattern are eliminated, and what is eliminated together; see `block_kernels`.

    Attributes
    ----------
    starts, rows : (V+1,) and (M,) int64 arrays
        The blocks in the columns of the pattern.
    order, fronts, bounds, members, sizes
        As `block_kernels.analyse` finds them.
    """

    starts: np.ndarray
    rows: np.ndarray
    order: np.ndarray
    fronts: np.ndarray
    bounds: np.ndarray
    members: np.ndarray
    sizes: np.ndarray

    @classmethod
    def of(cls, starts: np.ndarray, rows: np.ndarray) -> Elimination:
        """Find it for a symmetric pattern.

        Parameters
        ----------
        starts : (V+1,) int array
            Where the blocks of each column begin in ``rows``.
        rows : (M,) int array
            Their rows, in both triangles and on the diagonal.
        """
        starts, rows = (np.ascontiguousarray(one, dtype=np.int64) for one in (starts, rows))
        count, room = len(starts) - 1, 2 * len(rows) + 64
        order, bounds = np.empty(count, dtype=np.int64), np.empty(count + 1, dtype=np.int64)
        fronts, sizes = np.empty((count + 1, 7), dtype=np.int64), np.zeros(6, dtype=np.int64)
        while True:
            members = np.empty(room, dtype=np.int64)
            block_kernels.analyse(starts, rows, order, fronts, bounds, members, sizes)
            if sizes[0] or not count:
                return cls(starts, rows, order, fronts, bounds, members, sizes)
            room *= 2

    def factorise(self, data: np.ndarray, alone: bool | None = None) -> BlockFactor:
        """Factors L D L^T of a matrix of this pattern, without pivoting: it shall be positive definite.

        Parameters
        ----------
        data : (36 M,) array
            Column by column, each through the rows of all of its blocks, as in a sparse matrix by columns. Of each pair
            of entries on both sides of the diagonal one alone is looked at.
        alone : bool, optional
            Whether one thread finds them, by default where they are few; they are the same.

        Raises
        ------
        RuntimeError
            If a pivot is 0 or no number.
        """
        data = np.ascontiguousarray(data, dtype=np.float64)
        factors, pivots = np.empty(self.sizes[3]), np.empty(BLOCK * len(self.order))
        good = np.zeros(1, dtype=np.int64)
        known = (self.starts, self.rows, data, *self._parts, np.empty(self.sizes[4]), factors, pivots, good)
        if bool(self.sizes[3] < FEW) if alone is None else alone:
            block_kernels.factorise(ALL, *known)
        else:
            block_kernels.factorise_together(*known)
            if good[0]:
                block_kernels.factorise(LAST, *known)
        if not good[0]:
            raise RuntimeError("Factor is exactly singular")
        return BlockFactor(self, factors, pivots)

    @property
    def _parts(self) -> tuple[np.ndarray, ...]:
        return self.order, self.fronts, self.bounds, self.members, self.sizes


@dataclass(frozen=True, eq=False)
class BlockFactor:
    """Factors of a matrix (6V, 6V).

    Attributes
    ----------
    elimination : Elimination
    factors, pivots
        As `block_kernels.factorise` finds them.
    """

    elimination: Elimination
    factors: np.ndarray
    pivots: np.ndarray

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solutions for right sides (6V,) or (6V, M)."""
        sides = np.ascontiguousarray(right[:, None] if right.ndim == 1 else right, dtype=np.float64)
        result = np.empty_like(sides)
        block_kernels.solve(*self.elimination._parts, self.factors, self.pivots, sides, result)
        return result.reshape(right.shape)
