"""Rows of the state of `material_fit` that take part in a batch, and the two steps of a Kalman filter on them.

The whole state has values for every strut and place for every joint; most of a print is still to come for most of the
time, and what is to come depends on nothing yet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve
from scipy.linalg.blas import dsyrk, dtrsm

from frametwin.printing.adaptation.state_covariance import StateCovariance

MOST_OFF = 2.5
"""Standard deviations that a joint may be seen off where it is expected."""

_MIRRORED = 256
"""Rows that are copied across the diagonal at a time."""


@dataclass(frozen=True, eq=False)
class StateRows:
    """Rows of values, of the shift that all joints have in common, and of joints.

    Attributes
    ----------
    values : (K,) int64 array
        Of the material.
    joints : (J,) int64 array
        Numbers of the joints.
    active : (K + 3 + 3 J,) int64 array
        All rows, the values first, then the shift, then the joints; rising.
    """

    values: np.ndarray
    joints: np.ndarray
    active: np.ndarray

    @classmethod
    def of(cls, covariance: StateCovariance, told: np.ndarray, joints: np.ndarray, coordinates: int) -> StateRows:
        """Choose rows.

        Parameters
        ----------
        covariance
            Of the whole state: values, 3 of the shift, and those of all joints.
        told : array of int
            Values on which the batch depends; those that depend on others already are added.
        joints : (J,) int64 array
            That are there, rising.
        coordinates
            How many rows all joints have.
        """
        count = len(covariance) - coordinates - 3
        values = np.union1d(told, covariance.rows[covariance.rows < count])
        rows = count + 3 + (3 * joints[:, None] + np.arange(3)).ravel()
        return cls(values, joints, np.concatenate([values, count + np.arange(3), rows]))

    def carried(self, covariance: np.ndarray, slope: np.ndarray, wandering: float, missed: np.ndarray) -> Carried:
        """Carry the covariance of the active rows through a batch.

        Parameters
        ----------
        covariance : (A, A) array
            Before it.
        slope : (3 J, K) array
            How the joints' movement depends on the values.
        wandering
            Variance that the shift gains.
        missed : (3 J,) array
            Variance that the joints gain.
        """
        count = len(self.values)
        shift, joints = slice(count, count + 3), slice(count + 3, None)
        rows = np.array(covariance[count:])  # (3 + 3 J, A)
        gained = slope @ covariance[:count, :count]
        both = (rows[3:, :count] + 0.5 * gained) @ slope.T
        rows[3:, :count] += gained
        rows[3:, shift] += slope @ covariance[:count, shift]
        rows[:3, joints] = rows[3:, shift].T
        rows[3:, joints] += both + both.T
        rows[:3, shift] += wandering * np.eye(3)
        moved = np.arange(len(missed))
        rows[3 + moved, count + 3 + moved] += missed
        return Carried(rows)


@dataclass(frozen=True, eq=False)
class Carried:
    """Covariance after a batch and before its twin.

    Attributes
    ----------
    rows : (3 + 3 J, A) array
        Rows of the shift and the joints, with all active ones; among the others nothing has changed.
    """

    rows: np.ndarray

    def seen(self, seen: np.ndarray, left: np.ndarray, noise: float) -> Seen:
        """What a twin tells of it.

        Joints that are seen further off than they can well be are told with a variance that is so large that they are
        `MOST_OFF` standard deviations off, so that no joint that a twin takes for another one, and no strut it gets
        wrong, says much of the material (after P. Huber, "Robust statistics", 1981).

        Parameters
        ----------
        seen : (3 J,) bool array
            Which coordinates are seen: three or none of each joint.
        left : (M,) array
            Those that were seen less the expected ones.
        noise
            Variance of each.
        """
        places = np.flatnonzero(seen)
        times, first = len(places) // 3, self.rows.shape[1] - len(seen)  # the first joint's column
        across = np.take(self.rows, 3 + places, axis=0)
        across += np.tile(self.rows[:3], (times, 1))
        inner = np.take(across, first + places, axis=1)
        inner += np.tile(across[:, first - 3 : first], times)
        expected = np.diagonal(inner).reshape(-1, 3).mean(axis=1) + noise
        off = (left.reshape(-1, 3) ** 2).mean(axis=1)
        inner[np.diag_indices_from(inner)] += noise + np.repeat(np.maximum(off / MOST_OFF**2 - expected, 0.0), 3)
        return Seen(across, np.linalg.cholesky(inner), left)


@dataclass(frozen=True, eq=False)
class Seen:
    """What a twin tells.

    Attributes
    ----------
    across : (M, A) array
        Covariance of what is seen, which has the shift in it, with the active rows.
    root : (M, M) array
        Lower triangle, whose square is the covariance of what is seen as it is seen.
    left : (M,) array
        What was seen less what was expected.
    """

    across: np.ndarray
    root: np.ndarray
    left: np.ndarray

    @property
    def change(self) -> np.ndarray:
        """(A,) by which the active rows change."""
        if not len(self.left):
            return np.zeros(self.across.shape[1])
        return np.asarray(cho_solve((self.root, True), self.left) @ self.across)

    def corrected(self, covariance: np.ndarray, carried: Carried) -> np.ndarray:
        """(A, A) covariance of the active rows after a twin; in place of the one before the batch, which is lost."""
        moved = len(covariance) - len(carried.rows)
        covariance[moved:] = carried.rows
        if len(self.left):
            # As BLAS has it, column by column: what is seen, made independent, is (A, M) there.
            own = dtrsm(1.0, self.root.T, np.array(self.across).T, side=1, overwrite_b=1)
            covariance = dsyrk(-1.0, own, beta=1.0, c=covariance.T, overwrite_c=1).T  # the lower triangle, by rows
        return _mirrored(covariance)


def _mirrored(matrix: np.ndarray) -> np.ndarray:
    """A matrix with its lower triangle on both sides; in place."""
    for low in range(0, len(matrix), _MIRRORED):
        high = low + _MIRRORED
        corner = matrix[low:high, low:high]
        corner[:] = np.tril(corner) + np.tril(corner, -1).T
        matrix[low:high, high:] = matrix[high:, low:high].T
    return matrix
