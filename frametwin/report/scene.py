"""What a report shows in 3D: the curves of a print and the figures of each strut."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from frametwin.evaluation.evaluate import Errors
from frametwin.geometry.displacement import strut_displacements
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import missing_struts, torn_ends, uncertain_struts
from frametwin.twin.twin import Twin

SAMPLES = 12
"""Intervals of the curve parameter in which the largest displacement of a strut is looked for."""

DIGITS = 5
"""Significant digits of the figures of a strut."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A print at one moment.

    Attributes
    ----------
    label : str
        What it is called where there are several.
    plan : Wireframe
        What displacements are counted from, ``printed`` marking what is shown.
    curves : (E, n + 1, 3) array, mm
        Where the struts are; n is above 3 where one is bent as no cubic can be.
    quantities : mapping of str to (E,) array
        Figures of each strut by name, NaN where there is none.
    marks : mapping of str to (N,) array
        Indices of struts of which something is to be said: missing, uncertain, torn, lost.
    torn : sequence of (int, int, float)
        Ends that are off their joints: the strut, 0 for its start or 1 for its end, and how far off in mm.
    """

    label: str
    plan: Wireframe
    curves: np.ndarray
    quantities: Mapping[str, np.ndarray]
    marks: Mapping[str, np.ndarray] = field(default_factory=dict)
    torn: Sequence[tuple[int, int, float]] = ()

    @classmethod
    def of_twin(cls, label: str, plan: Wireframe, twin: Twin, errors: Errors | None = None) -> Scene:
        """The scene of a twin, its printed struts those of ``plan``."""
        quantities = {"displacement": strut_displacements(twin.change_from(plan), SAMPLES)}
        if errors is not None:
            quantities |= {"error": errors.strut_max, "error_mean": errors.strut_mean}
        if twin.sigma_across is not None and twin.sigma_along is not None:
            quantities |= {"sigma_across": twin.sigma_across, "sigma_along": twin.sigma_along}
        quantities |= {"completeness": twin.completeness, "confidence": twin.confidence}
        marks = {"missing": missing_struts(twin, plan.printed), "uncertain": uncertain_struts(twin, plan.printed)}
        torn = torn_ends(twin, plan.printed)
        if torn:
            quantities["gap"] = twin.gap.max(axis=1) if twin.gap is not None else np.full(plan.strut_count, np.nan)
            marks["torn"] = np.unique([strut for strut, _, _ in torn])
        return cls(label, plan, twin.curves, quantities, marks, torn)

    def content(self, *, with_plan: bool = True) -> dict[str, Any]:
        """As for the page: printed struts by number, their curves, and their figures.

        Parameters
        ----------
        with_plan
            Whether the plan is told as well; scenes of one job share theirs.
        """
        struts = np.flatnonzero(self.plan.printed)
        told: dict[str, Any] = {
            "label": self.label,
            "struts": struts.tolist(),
            "curves": floats(self.curves[struts]),
            "degree": self.curves.shape[1] - 1,
            "quantities": {name: numbers(values[struts]) for name, values in self.quantities.items()},
            "marks": {name: values.tolist() for name, values in self.marks.items()},
            "torn": [[strut, side, None if np.isnan(gap) else round(gap, DIGITS)] for strut, side, gap in self.torn],
        }
        return {**told, "plan": plan_content(self.plan)} if with_plan else told

    @property
    def ranking(self) -> np.ndarray:
        """Indices of the printed struts, the worst first: by error where it is known, else by displacement."""
        values = self.quantities.get("error", self.quantities["displacement"])
        shown = np.flatnonzero(self.plan.printed & ~np.isnan(values))
        return shown[np.argsort(-values[shown], kind="stable")]


def plan_content(plan: Wireframe) -> dict[str, Any]:
    """A plan, as for the page."""
    return {
        "curves": floats(plan.control_points),
        "radius": numbers(plan.radius),
        "edges": plan.edges.ravel().tolist(),
    }


def floats(values: np.ndarray) -> str:
    """Numbers as base64 of little-endian float32, which is shorter than digits and read at once."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def numbers(values: np.ndarray) -> list[float | None]:
    """Numbers (N,) as for a JSON file; NaN becomes ``None``."""
    return [None if np.isnan(value) else float(f"{value:.{DIGITS}g}") for value in values.tolist()]
