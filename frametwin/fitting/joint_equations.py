"""Equations between joints: a symmetric positive definite matrix of one block of 6 by 6 for every joint and strut.

Which blocks there are never changes during a fit, so the order in which joints are eliminated, and where what they
leave behind goes, is found once. What is left is a Cholesky factorisation by blocks of known size, which runs in
vector registers: several times faster than a solver that has to ask for every number where it belongs.

References
----------
T. A. Davis, "Direct methods for sparse linear systems", SIAM 2006, chapters 4 and 7.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from frametwin.fitting.joint_kernels import SIZE, WIDE, entries, factorised, filled, solved
from frametwin.mechanics.beams import factorise


class JointEquations:
    """What a factorisation of matrices with the same blocks can know beforehand.

    Parameters
    ----------
    edges : (E, 2) array of int
        Joints that a strut connects.
    joints : int
        Their number V.
    indices, indptr : arrays of int
        Of the matrices (6V, 6V) in compressed columns, which hold nothing but blocks of joints and struts.
    """

    def __init__(self, edges: np.ndarray, joints: int, indices: np.ndarray, indptr: np.ndarray) -> None:
        rows, starts = _neighbours(edges, joints)
        place = _elimination_order(rows, starts, joints)
        self._place = place
        self._starts, self._rows = filled(rows, starts, np.argsort(place), place)
        self._indices, self._indptr = indices, indptr
        columns = np.repeat(np.arange(SIZE * joints), np.diff(indptr))
        self._source, self._slot = entries(indices.astype(np.int64), columns, place, self._starts, self._rows)

    def factor(self, data: np.ndarray) -> JointFactor:
        """Factors of the matrix with these entries, in the order of the pattern's ``indices``.

        Raises
        ------
        ArithmeticError
            If it is not positive definite.
        """
        blocks = np.zeros((len(self._rows), SIZE, WIDE))
        blocks.reshape(-1)[self._slot] = data[self._source]
        if not factorised(blocks, self._starts, self._rows):
            raise ArithmeticError("the matrix is not positive definite")
        return JointFactor(blocks, self._starts, self._rows, self._place)


class JointFactor:
    """Factors of a matrix; see `JointEquations.factor`."""

    def __init__(self, blocks: np.ndarray, starts: np.ndarray, rows: np.ndarray, place: np.ndarray) -> None:
        self._blocks, self._starts, self._rows, self._place = blocks, starts, rows, place

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution (6V,) or (6V, N) for right-hand sides of the same shape."""
        sides = right.reshape(len(self._place), SIZE, -1)
        ordered = np.empty_like(sides, dtype=np.float64)
        ordered[self._place] = sides
        solved(self._blocks, self._starts, self._rows, ordered)
        return ordered[self._place].reshape(right.shape)


def _neighbours(edges: np.ndarray, joints: int) -> tuple[np.ndarray, np.ndarray]:
    """Joints that each joint is connected to, one list after the other, and where each begins (V + 1,)."""
    both = np.concatenate([edges, edges[:, ::-1]]).astype(np.int64)
    key = np.unique(both[:, 0] * joints + both[:, 1])
    return (key % joints).astype(np.int64), np.searchsorted(key, np.arange(joints + 1) * joints).astype(np.int64)


def _elimination_order(rows: np.ndarray, starts: np.ndarray, joints: int) -> np.ndarray:
    """(V,) the place of each joint in the order of elimination, by minimum degree."""
    ones = np.ones(len(rows))
    graph = sparse.csc_matrix((-ones, rows, starts), shape=(joints, joints))
    return np.asarray(factorise(graph + sparse.diags(np.diff(starts) + 1.0, format="csc")).perm_c, dtype=np.int64)
