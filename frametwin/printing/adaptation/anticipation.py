"""Where the print will be when the next struts are laid, rather than where the last pictures saw it.

A batch takes minutes, and soft or top-heavy frames go on moving meanwhile: the last struts of a batch would be laid
beside joints that have left. The paper's loop stands still between two twins. Here the drift of each joint from one
twin to the next is carried on: by which share of it joints move again in the batch that follows is found by least
squares from the batches before, for joints that were new then and for older ones, since what was just laid hardens.
Nothing is assumed of the material; a print that stands still, or moves without rule, is not anticipated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.records.sequence import PrintSequence

HISTORY = 4
"""Batches that are looked back at: the shares of movement that persist are found from each and the one before it."""

SIGNIFICANCE = 4.0
"""Shares within so many variances of zero, which is two standard deviations, count as zero."""

LARGEST_SHARE = 1.0
"""Largest share of a drift that is expected again. Where larger ones were found, they missed more often than not."""


def drift_rate(seen: Sequence[Observation]) -> np.ndarray | None:
    """Estimate how fast joints go on moving.

    Parameters
    ----------
    seen
        Drifts of successive batches, the last one being that which was just seen.

    Returns
    -------
    (V, 3) array, mm, or None
        Drift with each strut that is laid from now on, 0 at joints of which nothing is known; ``None`` where nothing
        can be said yet, or nothing moves.
    """
    seen = list(seen)[-HISTORY:]
    if len(seen) < 2:
        return None
    last, before = seen[-1], seen[-2]
    rate = np.zeros_like(last.drift)
    for new in (True, False):
        part = last.known & (before.known != new)
        rate[part] = _persistence(seen, new) * last.drift[part] / last.struts
    return rate if rate.any() else None


def _persistence(seen: Sequence[Observation], new: bool) -> float:
    """The share of a batch's drift per strut that is found again in the next one.

    Least squares over successive batches, shrunk towards zero by its own variance (the positive part of James and
    Stein's estimate): of joints in the first batch in which they were seen where ``new``, else of all the others.
    """
    was, then = [], []
    for k in range(1, len(seen)):
        one, other = seen[k - 1], seen[k]
        earlier = seen[k - 2].known if k > 1 else np.zeros_like(one.known)
        part = one.known & other.known & (earlier != new)
        was.append((one.drift[part] / one.struts).ravel())
        then.append((other.drift[part] / other.struts).ravel())
    x, y = np.concatenate(was), np.concatenate(then)
    square = float(x @ x)
    if square == 0.0:
        return 0.0
    share = float(x @ y) / square
    variance = float(np.mean((y - share * x) ** 2)) / square
    return float(np.clip(share * max(0.0, 1.0 - SIGNIFICANCE * variance / max(share**2, 1e-12)), 0.0, LARGEST_SHARE))


@dataclass(frozen=True, eq=False)
class Anticipation:
    """How a print is expected to move while a batch is laid.

    Attributes
    ----------
    plan
        As things stand before the batch, ``printed`` marking what does.
    laying
        The batch, in its order.
    rate : (V, 3) array, mm
        Drift of each joint with each strut that is laid.
    since : (V,) array
        Number of struts of the batch after which a joint is there: 0 for those that stand.
    """

    plan: Wireframe
    laying: PrintSequence
    rate: np.ndarray
    since: np.ndarray

    @classmethod
    def of(cls, plan: Wireframe, laying: PrintSequence, rate: np.ndarray | None) -> Anticipation:
        """Apply a rate of drift to a batch; joints that are new in it, and have none, drift with those they hang on.

        Parameters
        ----------
        plan, laying
            See the attributes.
        rate : (V, 3) array, mm, or None
            See `drift_rate`; ``None`` for a print that stands still.
        """
        since = np.zeros(plan.vertex_count)
        if rate is None:
            return cls(plan, laying, np.zeros_like(plan.vertices), since)
        rate, told = np.array(rate), rate.any(axis=1)
        there, struts = plan.printed_vertices() | plan.grounded, np.zeros(plan.vertex_count)
        for place, (start, end) in enumerate(zip(laying.start, laying.end_in(plan), strict=True)):
            if there[end]:
                continue
            since[end] = since[end] if struts[end] else place + 0.5
            struts[end] += 1.0
            if not told[end]:
                rate[end] += (rate[start] - rate[end]) / struts[end]  # the mean over its struts
        return cls(plan, laying, rate, since)

    def shift(self, laid: float) -> np.ndarray:
        """(V, 3) array, mm: drift of the joints by the time at which so many struts of the batch have been laid."""
        return np.maximum(laid - self.since, 0.0)[:, None] * self.rate

    def frame(self, laid: float) -> Wireframe:
        """The plan as it will be by then, struts following their ends in proportion.

        What is not moved stays as it is, to the last bit.
        """
        shift = self.shift(laid)
        return self.plan.moved_to(self.plan.vertices + shift) if shift.any() else self.plan

    def curves(self) -> np.ndarray:
        """(N, 4, 3) array, mm: the struts as they are laid, from start to end, where their joints will be by then."""
        curves = self.laying.directed_curves(self.plan)
        if not self.rate.any():
            return curves
        when = np.arange(len(self.laying)) + 0.5
        ends = []
        for joints in (self.laying.start, self.laying.end_in(self.plan)):
            ends.append(np.maximum(when - self.since[joints], 0.0)[:, None] * self.rate[joints])
        return curves + bezier.straight(*ends)
