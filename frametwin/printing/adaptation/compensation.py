"""Printing against the sag still to come, so that the finished frame is near the design and not only unbroken.

The paper leaves this to future work (Sec. VI.D: "inversely deforming the unprinted portion of the target model based
on the deformation captured by the digital twin of the printed portion"). Here a model of the print forecasts how far
every joint drifts from when it is laid to the end; what kind of material it is, and three factors, on the weight and
on the pull along x and y, are found by least squares from what the twins saw so far; and the joints still to be laid
are aimed at the design less the forecast. Joints that stand are met where they are, as ever.
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

PULLS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
"""Along x, along y, and the weight."""

NOISE = 0.05
"""Inaccuracy of laying and seeing a joint, as a share of a strut's diameter."""

BELIEFS = tuple(
    PrintSettings(axial=axial, rest=rest, lean=0.1, increments=1) for axial in (0.07, 0.25, 1.0) for rest in (0.04, 0.2)
)
"""What materials may be like: how stiff struts are along themselves and how long they go on flowing."""

EVIDENCE = 10.0
"""A belief has say in proportion to its misfit to the power of minus this, as if 20 values had been seen: drifts of
neighbouring joints, and what is left of them, go together."""

DOUBT = 4.0
"""Factors within so many variances of zero, two standard deviations, are taken for zero."""


@dataclass(frozen=True, eq=False)
class SagForecast:
    """Models of how a print drifts, each up to three factors.

    Attributes
    ----------
    design
        What shall be printed.
    drift
        (B, N, V, 3, 3) mm that each joint drifts in each batch, by belief and direction, for each of `PULLS`.
    lean
        Sideways pull to be expected, as a share of the weight.
    noise
        Inaccuracy of laying and seeing a joint, in mm along each axis.
    """

    design: Wireframe
    drift: np.ndarray
    lean: float
    noise: float

    @classmethod
    def build(
        cls, design: Wireframe, sequence: PrintSequence, beliefs: Sequence[PrintSettings] = BELIEFS
    ) -> SagForecast:
        """Analyse a print of the design, once for all batches.

        Parameters
        ----------
        design, sequence
            The print.
        beliefs
            What the material may be like; what was seen decides. Weight, ``flow`` and ``sag`` do not matter.
        """
        noise = NOISE * 2.0 * float(np.median(design.radius))
        lean = max(1e-3, float(np.mean([belief.lean for belief in beliefs])))
        drift = [linear_drift(design, sequence, belief, PULLS) for belief in beliefs]
        return cls(design, np.stack(drift, axis=1), lean, noise)

    def explain(self, seen: Sequence[Observation]) -> tuple[np.ndarray, np.ndarray]:
        """How well each belief explains what was seen, and by which factors.

        Least squares, with sideways factors expected to be about ``lean`` times that of the weight, and all of them
        drawn towards zero (the positive part of James and Stein's estimate) as long as what was seen could as well be
        inaccuracy of laying and seeing: after a first batch that hardly moved, any weight would do.

        Returns
        -------
        say, factors
            (N,) weights of the beliefs that sum to 1, and (N, 3) factors on `PULLS`.

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
        say, factors = np.full(count, 1.0 / count), np.zeros((count, 3))
        if not any(one.known.any() for one in seen):
            return say, factors
        value = np.concatenate([one.drift[one.known].ravel() for one in seen])
        misfit = np.zeros(count)
        for belief in range(count):
            model = np.concatenate([self.drift[one.batch, belief][one.known].reshape(-1, 3) for one in seen])
            misfit[belief], factors[belief] = self._factors(model, value)
        misfit = np.maximum(misfit, 1e-12 * float(value @ value) + 1e-300)
        say = (misfit / misfit.min()) ** -EVIDENCE
        return say / say.sum(), factors

    def to_come(self, seen: Sequence[Observation], batch: int) -> np.ndarray:
        """(V, 3) mm that each joint will drift in the batches from ``batch`` on: the beliefs' mean, by their say."""
        say, factors = self.explain(seen)
        total: np.ndarray = np.einsum("n,nvxk,nk->vx", say, self.drift[batch:].sum(axis=0), factors)
        return total

    def _factors(self, model: np.ndarray, value: np.ndarray) -> tuple[float, np.ndarray]:
        """What a model (M, 3) leaves of the values (M,), in square mm, and its factors."""
        down = model[:, 2]
        if not down.any():
            return float(value @ value), np.zeros(3)
        weight = max(0.0, float(down @ value) / float(down @ down))  # nothing falls upwards
        noise = max(self.noise**2, float(np.mean((value - weight * down) ** 2)))
        prior = np.diag([1.0, 1.0, 0.0]) * noise / max(self.lean * weight, 1e-12) ** 2
        factors = np.linalg.solve(model.T @ model + prior, model.T @ value)
        doubt = noise / float(down @ down) / max(factors[2], 1e-12) ** 2
        left: np.ndarray = value - model @ factors
        return float(left @ left), factors * max(0.0, 1.0 - DOUBT * doubt)


def compensate(plan: Wireframe, design: Wireframe, to_come: np.ndarray) -> Wireframe:
    """Aim the joints that are still to be laid at the design less what they will drift.

    Parameters
    ----------
    plan
        Adapted to the print (`frametwin.printing.adaptation.adapt.adapt`).
    design
        Where the finished frame shall be.
    to_come
        (V, 3) mm, see `SagForecast.to_come`.

    Returns
    -------
    The plan with its unprinted joints moved, and unprinted struts following their ends in proportion. Joints on the
    plate and joints of printed struts stay where they are, to the last bit.
    """
    free = ~plan.printed_vertices() & ~plan.grounded
    return plan.moved_to(np.where(free[:, None], design.vertices - to_come, plan.vertices))
