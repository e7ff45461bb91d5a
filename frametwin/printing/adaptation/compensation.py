"""Printing against the sag still to come, so that the finished frame is near the design and not only unbroken.

The paper leaves this to future work (Sec. VI.D: "inversely deforming the unprinted portion of the target model based
on the deformation captured by the digital twin of the printed portion"). Here models of the print, one for each of
several candidate materials, forecast how far every joint drifts from when it is laid to the end. Each model has three
factors, on the weight and on sideways loads along x and y, which are found by least squares, with priors, from what the
twins saw so far. The models are averaged, weighted by how well they fit, and the joints still to be laid are aimed at
the design less the forecast. Joints that stand are met where they are, as ever.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.process.calibration import linear_drift
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence import PrintSequence

LOAD_DIRECTIONS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
"""Unit loads: along x, along y, and the weight."""

PLACEMENT_NOISE = 0.05
"""Standard deviation of laying and seeing a joint along each axis, as a share of a strut's diameter."""

CANDIDATE_MATERIALS = tuple(
    PrintSettings(axial=axial, rest=rest, lean=0.1, increments=1) for axial in (0.07, 0.25, 1.0) for rest in (0.04, 0.2)
)
"""What materials may be like: how stiff struts are along themselves and how long they go on flowing."""

WEIGHT_EXPONENT = 10.0
"""A candidate's weight is its residual sum of squares to the power of minus this, as if 20 values were independent:
drifts of neighbouring joints, and what a model leaves of them, are correlated."""

SIGNIFICANCE = 4.0
"""Factors within so many variances of zero, which is two standard deviations, count as zero."""


@dataclass(frozen=True, eq=False)
class SagForecast:
    """Models of how a print drifts, one for each candidate material, each up to three factors.

    Attributes
    ----------
    design
        What shall be printed.
    drift : (B, N, V, 3, 3) array, mm
        Of each joint in each batch with each candidate, along x, y and z, under each of `LOAD_DIRECTIONS`.
    lean
        Prior of the sideways loads: their standard deviation as a share of the weight.
    noise : float, mm
        Standard deviation of laying and seeing a joint along each axis.
    """

    design: Wireframe
    drift: np.ndarray
    lean: float
    noise: float

    @classmethod
    def build(
        cls, design: Wireframe, sequence: PrintSequence, candidates: Sequence[PrintSettings] = CANDIDATE_MATERIALS
    ) -> SagForecast:
        """Analyse a print of the design, once for all batches.

        Parameters
        ----------
        design, sequence
            The print.
        candidates
            What the material may be like; what was seen decides. Weight, ``flow`` and ``sag`` do not matter.
        """
        noise = PLACEMENT_NOISE * 2.0 * float(np.median(design.radius))
        lean = max(1e-3, float(np.mean([candidate.lean for candidate in candidates])))
        drift = [linear_drift(design, sequence, candidate, LOAD_DIRECTIONS) for candidate in candidates]
        return cls(design, np.stack(drift, axis=1), lean, noise)

    def fit(self, seen: Sequence[Observation]) -> tuple[np.ndarray, np.ndarray]:
        """Fit each candidate to what was seen.

        Least squares, with a prior on the sideways factors of about ``lean`` times that of the weight, all of them
        shrunk towards zero (the positive part of James and Stein's estimate) as long as what was seen could as well be
        noise of laying and seeing: after a first batch that hardly moved, any weight would do.

        Returns
        -------
        weights : (N,) array
            Of the candidates; they sum to 1.
        factors : (N, 3) array
            On `LOAD_DIRECTIONS`.

        Raises
        ------
        InputError
            If a batch is seen that the print does not have.
        """
        for one in seen:
            if not 0 <= one.batch < len(self.drift):
                problem = f"is {one.batch} in a print of {len(self.drift)} batches"
                raise InputError.at(self.design.name, "batch", problem, "give the batches of this print")
        count = self.drift.shape[1]
        weights, factors = np.full(count, 1.0 / count), np.zeros((count, 3))
        if not any(one.known.any() for one in seen):
            return weights, factors
        value = np.concatenate([one.drift[one.known].ravel() for one in seen])
        residual = np.zeros(count)
        for candidate in range(count):
            model = np.concatenate([self.drift[one.batch, candidate][one.known].reshape(-1, 3) for one in seen])
            residual[candidate], factors[candidate] = self._factors(model, value)
        residual = np.maximum(residual, 1e-12 * float(value @ value) + 1e-300)
        weights = (residual / residual.min()) ** -WEIGHT_EXPONENT
        return weights / weights.sum(), factors

    def remaining_drift(self, seen: Sequence[Observation], batch: int) -> np.ndarray:
        """Forecast how far each joint drifts in the batches from ``batch`` on: the weighted mean of the candidates.

        Returns
        -------
        (V, 3) array, mm
        """
        weights, factors = self.fit(seen)
        total: np.ndarray = np.einsum("n,nvxk,nk->vx", weights, self.drift[batch:].sum(axis=0), factors)
        return total

    def _factors(self, model: np.ndarray, value: np.ndarray) -> tuple[float, np.ndarray]:
        """The residual sum of squares that a model (M, 3) leaves of the values (M,), in square mm, and its factors."""
        down = model[:, 2]
        if not down.any():
            return float(value @ value), np.zeros(3)
        weight = max(0.0, float(down @ value) / float(down @ down))  # nothing falls upwards
        noise = max(self.noise**2, float(np.mean((value - weight * down) ** 2)))
        prior = np.diag([1.0, 1.0, 0.0]) * noise / max(self.lean * weight, 1e-12) ** 2
        factors = np.linalg.solve(model.T @ model + prior, model.T @ value)
        variance = noise / float(down @ down) / max(factors[2], 1e-12) ** 2  # relative to the weight's factor
        left: np.ndarray = value - model @ factors
        return float(left @ left), factors * max(0.0, 1.0 - SIGNIFICANCE * variance)


def compensate(plan: Wireframe, design: Wireframe, remaining: np.ndarray) -> Wireframe:
    """Aim the joints that are still to be laid at the design less what they will drift.

    Parameters
    ----------
    plan
        Adapted to the print (`frametwin.printing.adaptation.adapt.adapt`).
    design
        Where the finished frame shall be.
    remaining : (V, 3) array, mm
        See `SagForecast.remaining_drift`.

    Returns
    -------
    The plan with its unprinted joints moved, and unprinted struts following their ends in proportion. Joints on the
    plate and joints of printed struts stay where they are, to the last bit.
    """
    free = ~plan.printed_vertices() & ~plan.grounded
    return plan.moved_to(np.where(free[:, None], design.vertices - remaining, plan.vertices))
