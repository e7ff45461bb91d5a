"""What a job expects of its own print: the fit of its material, and the state in which the print is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.aiming import aimed, expected_drift
from frametwin.printing.adaptation.material_fit import BatchRecord, MaterialEstimate, MaterialFit
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.adaptation.rest_of_print import PrintStep, resized_steps, steps_of
from frametwin.printing.process.added_struts import without_last
from frametwin.printing.process.creep import CreepModel, PrintState
from frametwin.printing.process.material import USUAL_SPEED, PrintSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.resizing import resized, suitable_size

UNTRUSTED_SIZE = 4
"""Most struts in a batch while no forecast is trusted: what is laid before can not be aimed any more."""

LEAST_TRUST = 0.5
"""Forecasts of the next batch that are trusted less are left to `frametwin.printing.adaptation.anticipation`."""


@dataclass(frozen=True, eq=False)
class CreepForecast:
    """A print between two batches.

    Attributes
    ----------
    fit
        What the twins so far tell of the material.
    plan
        What the robot follows in the batch that comes, ``printed`` marking what stands.
    laid_at : (E,) array, s
        When each strut was laid, at the pace of the model.
    clock
        Seconds since the print began.
    coupon
        How many of the last struts are a test coupon, which is laid as it is planned.
    """

    fit: MaterialFit
    plan: Wireframe
    laid_at: np.ndarray
    clock: float = 0.0
    coupon: int = 0

    @classmethod
    def start(
        cls, design: Wireframe, known: MaterialEstimate | None = None, coupon: int = 0, speed: float = USUAL_SPEED
    ) -> CreepForecast:
        """Before the first batch, of a print at a speed of the nozzle in mm/s."""
        fit = MaterialFit.start(CreepModel(design, PrintSettings(speed=speed)), known)
        plan, laid_at = design.replace(printed=[False] * design.strut_count), np.zeros(design.strut_count)
        return cls(fit, plan, laid_at, coupon=coupon)

    @property
    def design(self) -> Wireframe:
        """Where the finished frame shall be."""
        return self.fit.model.design

    def following(self, plan: Wireframe) -> CreepForecast:
        """With the plan that is really followed in the batch that comes."""
        return replace(self, plan=plan)

    def answered(self, laying: PrintSequence, seen: Observation, adapted: Wireframe) -> CreepForecast:
        """After a batch.

        Parameters
        ----------
        laying
            The batch.
        seen
            What the twin saw move.
        adapted
            The plan that meets it, ``printed`` marking what stands.
        """
        state = PrintState.before(self.plan, self.laid_at, self.clock)
        struts = laying.struts[adapted.printed[laying.struts]]
        fit = self.fit.updated(BatchRecord(state, struts, np.array(adapted.printed), seen.drift, seen.known))
        model = fit.model
        then = state.with_struts(laying.struts, self.design.edges, model.seconds, model.settings.pause)
        return replace(self, fit=fit, plan=adapted, laid_at=then.laid_at, clock=then.clock)

    def aimed(
        self, sequence: PrintSequence, batch: int, targets: np.ndarray | None = None, *, resize: bool = False
    ) -> Wireframe:
        """The plan with what is laid from a batch on aimed so that it ends where the design has it.

        Parameters
        ----------
        sequence
            The order.
        batch
            The next one.
        targets : (V, 3) array, mm, optional
            Where joints that are still to come were aimed before; the design by default.
        resize
            The batches will be made smaller or larger when their turn comes; see `resized`. Each of them ends with a
            pause, and a print that takes longer sags further.
        """
        state = PrintState.before(self.plan, self.laid_at, self.clock)
        start = self.design.vertices if targets is None else targets
        steps = steps_of([sequence.struts[sequence.batch == k] for k in range(batch, sequence.batch_count)])
        moves = None
        if resize and self.fit.trust >= LEAST_TRUST:
            at = replace(state, points=np.where(state.there[:, None], state.points, start))
            steps, moves = resized_steps(self.fit, at, steps, self._size_in)
        own = without_last(self.design.strut_count, self.coupon)
        return aimed(self.design, self.plan, start, self.fit, state, steps, own, moves)

    def resized(self, sequence: PrintSequence, batch: int) -> PrintSequence:
        """The order with as many struts in a batch as suit the drift that is expected while it is laid."""
        laying = sequence.in_batch(batch)
        rate = self.drift(laying)
        untrusted = min(len(laying), UNTRUSTED_SIZE)
        size = untrusted if rate is None else self._suitable_size(laying.struts, rate, len(laying))
        return resized(sequence, batch, size)

    def _size_in(self, step: PrintStep, rate: np.ndarray) -> int:
        """How many struts a batch of a step should have, where joints drift like ``rate`` (V, 3)."""
        return self._suitable_size(step.struts, rate, max(1, round(len(step.struts) / step.batches)))

    def _suitable_size(self, struts: np.ndarray, rate: np.ndarray, size: int) -> int:
        """How many struts a batch should have instead of ``size`` of these, where joints drift like ``rate`` (V, 3)."""
        fastest = float(np.linalg.norm(rate[self.design.edges[struts]], axis=2).max())
        bead = 2.0 * self.fit.model.settings.bead * float(self.design.radius[struts].min())
        return suitable_size(size, fastest / bead)

    def drift(self, laying: PrintSequence) -> np.ndarray | None:
        """(V, 3) array, mm: expected drift with each strut of the batch; ``None`` where that cannot be told."""
        if self.fit.trust < LEAST_TRUST:
            return None
        state = PrintState.before(self.plan, self.laid_at, self.clock)
        return expected_drift(self.plan, self.fit, state, laying.struts)
