"""How many struts have which value of what the colours show, bin by bin along the bar of the legend."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from frametwin.blender.display.colours import BINS, Legend, State
from frametwin.blender.display.display_inputs import ATTRIBUTE, UNIT, get_input
from frametwin.blender.frames.strut_curves import first_points, read_attribute


def histogram_of(objects: Iterable[bpy.types.Object], legend: Legend, bins: int = BINS) -> np.ndarray:
    """Struts in each of the equal parts of a legend's range, from its good end to its bad one.

    A strut counts as one, spread over its values where they differ along it. Those beyond the range are in the bins at
    its ends, whose colours they have. What is missing, not printed, or without a value has another colour and does not
    count.

    Parameters
    ----------
    objects
        Curves objects with the display, which are shown together.
    legend
        What their colours mean.
    bins
        How many parts.

    Returns
    -------
    (bins,) float64, whose sum is the number of struts that are coloured.
    """
    counts = np.zeros(bins)
    for obj in objects:
        values, weights = _coloured_values(obj)
        counts += binned(values, weights, legend.ends, bins)
    return counts


def binned(values: np.ndarray, weights: np.ndarray, ends: tuple[float, float], bins: int) -> np.ndarray:
    """(bins,) sums of weights (N,) of finite values (N,) between two ends, the second of which may be the lower."""
    first, last = ends
    known = np.isfinite(values)
    place = np.floor((values[known] - first) / (last - first) * bins)
    at = np.clip(place, 0, bins - 1).astype(np.int64)
    return np.bincount(at, weights=weights[known], minlength=bins)


def _coloured_values(obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Values (N,) of points or struts in the unit of the legend, and (N,) how much of a strut each stands for."""
    name = str(get_input(obj, ATTRIBUTE) or "")
    there = obj.data.attributes.get(name) if obj.type == "CURVES" else None
    state = obj.data.attributes.get("state") if there is not None else None
    if there is None or state is None or there.data_type not in ("FLOAT", "INT"):
        return np.zeros(0), np.zeros(0)
    values = read_attribute(obj.data, name).astype(np.float64) * float(get_input(obj, UNIT))
    printed = read_attribute(obj.data, "state") == State.PRINTED
    offsets = first_points(obj.data)
    points = np.diff(offsets)  # (E,)
    share = np.repeat(printed / points, points)
    if obj.data.attributes.get("missing") is not None:
        share[read_attribute(obj.data, "missing")] = 0.0
    if there.domain == "POINT":
        return values, share
    return values, np.add.reduceat(share, offsets[:-1])
