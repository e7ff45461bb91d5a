"""Rows of the state of `material_fit` that take part in a batch, and the two steps of a Kalman filter on them.

The whole state has values for every strut and place for every joint; most of a print is still to come for most of the
time, and what is to come depends on nothing yet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_OFF = 2.5
"""Standard deviations that a joint may be seen off where it is expected."""


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
        All rows, the values first, then the shift, then the joints.
    """

    values: np.ndarray
    joints: np.ndarray
    active: np.ndarray

    @classmethod
    def of(cls, covariance: np.ndarray, told: np.ndarray, joints: np.ndarray, coordinates: int) -> StateRows:
        """Choose rows.

        Parameters
        ----------
        covariance : (N, N) array
            Of the whole state: values, 3 of the shift, and those of all joints.
        told : array of int
            Values on which the batch depends; those that depend on others already are added.
        joints : (J,) int64 array
            That are there.
        coordinates
            How many rows all joints have.
        """
        count = len(covariance) - coordinates - 3
        chosen = np.count_nonzero(covariance[:count], axis=1) > 1
        chosen[told] = True
        values = np.flatnonzero(chosen)
        rows = count + 3 + (3 * joints[:, None] + np.arange(3)).ravel()
        return cls(values, joints, np.concatenate([values, count + np.arange(3), rows]))

    def carried(self, covariance: np.ndarray, slope: np.ndarray, wandering: float, missed: np.ndarray) -> np.ndarray:
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
        count, result = len(self.values), np.array(covariance)
        shift, joints = slice(count, count + 3), slice(count + 3, None)
        result[joints] += slope @ covariance[:count]
        result[joints, joints] += result[joints, :count] @ slope.T
        result[: joints.start, joints] = result[joints, : joints.start].T
        result[shift, shift] += wandering * np.eye(3)
        result[joints, joints] += np.diag(missed)
        return result

    def doubted(self, covariance: np.ndarray, left: np.ndarray, seen: np.ndarray, noise: float) -> np.ndarray:
        """Variance (M,) of what was seen, larger where a joint is seen further off than it can well be.

        It is made so large that the joint is `MOST_OFF` standard deviations off, so that no joint that a twin takes for
        another one, and no strut it gets wrong, says much of the material (after P. Huber, "Robust statistics", 1981).
        See `change`.
        """
        _, inner = self._seen(covariance, seen, np.full(len(left), noise))
        expected = np.diag(inner).reshape(-1, 3).mean(axis=1)
        off = (left.reshape(-1, 3) ** 2).mean(axis=1)
        return noise + np.repeat(np.maximum(off / MOST_OFF**2 - expected, 0.0), 3)

    def change(self, covariance: np.ndarray, left: np.ndarray, seen: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """Change of the active rows by what was seen.

        Parameters
        ----------
        covariance : (A, A) array
            Before.
        left : (M,) array
            Seen coordinates less the expected ones.
        seen : (3 J,) bool array
            Which coordinates those are: three or none of each joint.
        noise : (M,) array
            Variance of each.

        Returns
        -------
        (A,) array
        """
        across, inner = self._seen(covariance, seen, noise)
        result: np.ndarray = across @ np.linalg.solve(inner, left)
        return result

    def corrected(self, covariance: np.ndarray, seen: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """(A, A) array: covariance of the active rows after what was seen; see `change`."""
        across, inner = self._seen(covariance, seen, noise)
        result: np.ndarray = covariance - across @ np.linalg.solve(inner, across.T)
        return np.asarray(0.5 * (result + result.T))

    def _seen(self, covariance: np.ndarray, seen: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Covariance (A, M) of the active rows with what is seen, which has the shift in it, and of that itself."""
        count = len(self.values)
        shift, rows = slice(count, count + 3), count + 3 + np.flatnonzero(seen)
        times = len(rows) // 3
        across = covariance[:, rows] + np.tile(covariance[:, shift], times)
        return across, across[rows] + np.tile(across[shift], (times, 1)) + np.diag(noise)
