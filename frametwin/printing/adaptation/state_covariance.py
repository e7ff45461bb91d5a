"""Covariance of a long state most of which depends on nothing yet: a matrix of the rows that do, and variances.

Of a print, most is still to come for most of the time, and a matrix of all of it would be many times as large.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class StateCovariance:
    """Covariance (N, N) of a state.

    Attributes
    ----------
    rows : (A,) int64 array
        Rows of the state that depend on each other, rising.
    among : (A, A) array
        Covariance of these.
    alone : (N,) array
        Variance of every row that depends on no other.
    """

    rows: np.ndarray
    among: np.ndarray
    alone: np.ndarray

    @classmethod
    def independent(cls, variance: np.ndarray) -> StateCovariance:
        """Of a state (N,) no row of which depends on another."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 0)), np.array(variance))

    def __len__(self) -> int:
        return len(self.alone)

    @property
    def variance(self) -> np.ndarray:
        """(N,) variance of every row."""
        result = np.array(self.alone)
        result[self.rows] = np.diagonal(self.among)
        return result

    def of(self, rows: np.ndarray) -> np.ndarray:
        """(R, R) covariance of some rows (R,); a new array."""
        if not len(self.rows):
            return np.diag(self.alone[rows])
        place = np.minimum(np.searchsorted(self.rows, rows), len(self.rows) - 1)
        result = self.among.take(place, axis=0).take(place, axis=1)  # much faster than by rows and columns at once
        own = np.flatnonzero(self.rows[place] != rows)
        result[own], result[:, own] = 0.0, 0.0
        result[own, own] = self.alone[rows[own]]
        return result

    def with_independent(self, rows: np.ndarray, variance: float) -> StateCovariance:
        """With some rows (R,) that depend on no other any more."""
        alone = np.array(self.alone)
        alone[rows] = variance
        kept = np.flatnonzero(~np.isin(self.rows, rows))
        if len(kept) == len(self.rows):
            return replace(self, alone=alone)
        return StateCovariance(self.rows[kept], self.among[np.ix_(kept, kept)], alone)
