"""The struts of a twin as a table to sort and to filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from frametwin.blender.display.quantities import quantity_named
from frametwin.blender.display.statistics import StrutValues

INDEX, BATCH = "index", "batch"


@dataclass(frozen=True, eq=False)
class StrutTable:
    """What is known of every strut of a twin.

    Attributes
    ----------
    key
        Which twin it is.
    values
        Quantities by name, (E,) each.
    batch : (E,) int array
        The batch in which each strut is printed.
    kinds
        Struts that are found together: ``missing``, ``uncertain`` and ``torn``.
    """

    key: str
    values: Mapping[str, StrutValues]
    batch: np.ndarray
    kinds: Mapping[str, np.ndarray]

    @property
    def count(self) -> int:
        """How many struts there are."""
        return len(self.batch)

    def order(self, by: str, reverse: bool = False) -> np.ndarray:
        """(E,) struts, the worst first where it is a quantity, else by number; those without a value last."""
        if by == BATCH:
            keys = self.batch.astype(np.float64)
        elif by in self.values:
            keys = -quantity_named(by).badness(self.values[by].values)
        else:
            keys = np.arange(self.count, dtype=np.float64)
        order = np.argsort(-keys if reverse else keys, kind="stable")
        known = ~np.isnan(keys[order])
        return np.concatenate([order[known], order[~known]])

    def shown(self, kind: str = "all", batch: int = -1) -> np.ndarray:
        """(E,) whether each strut is of a kind (one of ``kinds``, or ``all``) and of a batch (-1: any)."""
        mask = np.ones(self.count, dtype=bool) if kind == "all" else np.isin(np.arange(self.count), self.kinds[kind])
        return mask if batch < 0 else mask & (self.batch == batch)

    def text(self, strut: int, name: str) -> str:
        """A value of a strut as the table shows it; a dash where there is none."""
        if name == INDEX:
            return str(strut)
        if name == BATCH:
            return str(int(self.batch[strut]))
        found = self.values.get(name)
        if found is None or np.isnan(found.values[strut]):
            return "-"
        return f"{found.values[strut]:.2f}"
