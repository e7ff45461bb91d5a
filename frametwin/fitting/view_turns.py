"""Which views a step looks at: all of them, or a few in a random order in which each comes once in a round."""

from __future__ import annotations

import numpy as np


class ViewTurns:
    """Views step by step.

    Parameters
    ----------
    views : int
        How many there are.
    per_step : int
        How many a step looks at; 0 for all.
    seed : int
        Of the order.

    Attributes
    ----------
    taken : int
        Steps that have been begun.
    """

    def __init__(self, views: int, per_step: int, seed: int) -> None:
        self._all = list(range(views))
        self._per_step = views if per_step == 0 else min(per_step, views)
        self._rng = np.random.default_rng(seed)
        self._waiting: list[int] = []
        self.taken = 0

    def take(self) -> list[int]:
        """Numbers of the views of the next step, each at most once."""
        self.taken += 1
        if self._per_step == len(self._all):
            return self._all
        if len(self._waiting) < self._per_step:
            self._waiting = self._rng.permutation(self._all).tolist()
        chosen, self._waiting = self._waiting[: self._per_step], self._waiting[self._per_step :]
        return chosen
