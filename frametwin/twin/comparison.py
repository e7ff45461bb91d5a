"""Two twins of the same struts compared: how far each strut of one is from the same strut of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.nearest import distances_to_curves
from frametwin.geometry.wireframe import Wireframe

_SAMPLES = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True, eq=False)
class Comparison:
    """How far struts are from where they were.

    Attributes
    ----------
    distance : (E, S) array, mm
        Of points at even parameters of each strut from the nearest point of the same strut as it was; NaN where the
        strut cannot be compared.
    """

    distance: np.ndarray

    @property
    def compared(self) -> np.ndarray:
        """(E,) whether the strut could be compared."""
        return ~np.isnan(self.distance[:, 0])

    @property
    def of_strut(self) -> np.ndarray:
        """(E,) the largest distance along each strut in mm; NaN where it cannot be compared."""
        return np.asarray(self.distance.max(axis=1))

    @property
    def mean(self) -> float:
        """Over all points of all struts that can be compared, in mm; NaN if there is none."""
        return float(self.distance[self.compared].mean()) if self.compared.any() else np.nan

    @property
    def largest(self) -> float:
        """Of any point, in mm; NaN if no strut can be compared."""
        return float(self.distance[self.compared].max()) if self.compared.any() else np.nan

    def moved_most(self, count: int) -> np.ndarray:
        """The struts with the largest distances, farthest first: ``count`` of them at most."""
        order = np.argsort(-self.of_strut, kind="stable")
        return order[self.compared[order]][:count]


def compare_struts(before: np.ndarray, after: np.ndarray, comparable: np.ndarray | None = None) -> Comparison:
    """Compare the curves of struts.

    Parameters
    ----------
    before, after : (E, n + 1, 3) array, mm
        Control points of the same struts; the degrees may differ.
    comparable : (E,) bool array
        Which of them are known on both sides; all by default.
    """
    chosen = np.ones(len(after), dtype=bool) if comparable is None else np.asarray(comparable, dtype=bool)
    distance = np.full((len(after), len(_SAMPLES)), np.nan)
    points = bezier.evaluate(after[chosen], _SAMPLES).reshape(-1, 3)
    curves = np.repeat(before[chosen], len(_SAMPLES), axis=0)
    distance[chosen] = distances_to_curves(points, curves).reshape(-1, len(_SAMPLES))
    return Comparison(distance)


def check_comparable(before: Wireframe, after: Wireframe, name: str) -> None:
    """Refuse to compare what is not of the same struts.

    Raises
    ------
    InputError
        If the frames have other joints or struts; ``name`` is that of the first.
    """
    if not np.array_equal(before.edges, after.edges):
        problem = f"has {before.strut_count} struts that are not the {after.strut_count} of {after.name}"
        raise InputError.at(name, "struts", problem, "choose another twin of the same plan")
