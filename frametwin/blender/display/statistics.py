"""One number a strut of a twin, and what they say together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.runs import Truth
from frametwin.twin.twin import Twin

_U = np.linspace(0.0, 1.0, 17)


@dataclass(frozen=True, eq=False)
class StrutValues:
    """A quantity, its unit, and (E,) its value for each strut; NaN where there is none."""

    quantity: str
    unit: str
    values: np.ndarray


@dataclass(frozen=True)
class ValueStatistics:
    """Mean, 5th and 95th percentile and extremes over the struts that have a value (NaN if none has)."""

    mean: float
    p95: float
    max: float
    p5: float
    min: float


def strut_values(twin: Twin, frame: Wireframe, truth: Truth | None = None) -> dict[str, StrutValues]:
    """Quantities of every strut: mean (``_max``: largest) displacement between equal parameters of plan and twin, ...

    ``error`` and ``error_max`` are distances from points of the true strut, where it exists, to the twin's strut.
    ``sigma`` and ``sigma_along`` are standard deviations across and along each strut, ``gap`` is how far the farther of
    its torn ends is from its joint, 0 for none; a twin of an older version has none of the three. Struts that are not
    printed have no value but that they are not: nobody has seen them.
    """
    moved = np.linalg.norm(bezier.evaluate(twin.change_from(frame), _U), axis=-1)  # (E, S)
    columns = {
        "displacement": ("mm", moved.mean(axis=1)),
        "displacement_max": ("mm", moved.max(axis=1)),
        "opacity": ("", twin.opacity.mean(axis=1)),
        "completeness": ("", twin.completeness),
        "radius": ("mm", twin.thickness.mean(axis=1)),
        "confidence": ("", twin.confidence),
    }
    for name, known in (("sigma", twin.sigma_across), ("sigma_along", twin.sigma_along)):
        if known is not None:
            columns[name] = ("mm", known)
    if twin.gap is not None:
        columns["gap"] = ("mm", twin.gap.max(axis=1))
    if truth is not None:
        error = _errors(twin.curves, truth)
        columns |= {"error": ("mm", error.mean(axis=1)), "error_max": ("mm", error.max(axis=1))}
    columns = {name: (unit, np.where(frame.printed, values, np.nan)) for name, (unit, values) in columns.items()}
    columns |= {"printed": ("", frame.printed.astype(np.float64)), "batch": ("", frame.batch.astype(np.float64))}
    return {name: StrutValues(name, unit, values) for name, (unit, values) in columns.items()}


def _errors(curves: np.ndarray, truth: Truth) -> np.ndarray:
    """(E, S) distance of points of each true strut to 32 chords of the twin's; NaN where the strut does not exist."""
    error = np.full((len(curves), len(_U)), np.nan)
    for i, true in enumerate(truth.frame.control_points):
        low, high = (0.0, 1.0) if truth.present is None else truth.present[i]
        if high > low:
            points = bezier.evaluate(true, low + (high - low) * _U)[:, None]
            line = bezier.evaluate(curves[i], np.linspace(0.0, 1.0, 33))
            start, step = line[:-1], np.diff(line, axis=0)
            along = ((points - start) * step).sum(axis=-1) / np.maximum((step**2).sum(axis=-1), 1e-300)
            nearest = start + np.clip(along, 0.0, 1.0)[..., None] * step
            error[i] = np.linalg.norm(points - nearest, axis=-1).min(axis=1)
    return error


def statistics_of(values: np.ndarray) -> ValueStatistics:
    """Statistics of values (E,)."""
    known = values[~np.isnan(values)]
    if not len(known):
        return ValueStatistics(np.nan, np.nan, np.nan, np.nan, np.nan)
    p5, p95 = np.percentile(known, [5, 95])
    return ValueStatistics(float(known.mean()), float(p95), float(known.max()), float(p5), float(known.min()))


def worst_struts(values: np.ndarray, count: int) -> np.ndarray:
    """Indices of the ``count`` highest values (E,), highest first; NaN is left out."""
    order = np.argsort(-values, kind="stable")
    return order[~np.isnan(values[order])][:count]
