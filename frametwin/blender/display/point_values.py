"""What a twin says along its struts, as attributes of Blender's Curves."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from frametwin.blender.display.colours import State
from frametwin.blender.display.quantities import quantity_named
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.frames.strut_curves import Attribute, Sampling, pieces_of
from frametwin.geometry import bezier
from frametwin.geometry.nearest import nearest_parameters
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import DARK
from frametwin.twin.twin import Twin

ALONG = ("opacity", "radius", "distance", "difference")
"""Attributes that differ along a strut; the other quantities are one number a strut."""


def twin_sampling(twin: Twin, missing: np.ndarray, radius: np.ndarray) -> Sampling:
    """Points at which a twin is shown, its struts of radius (E,) mm.

    Broken struts, by index, are cut at the ends of the twin's own pieces.
    """
    pieces = pieces_of(twin.strut_count, twin.bent, radius)
    pieces[missing] = np.maximum(twin.opacity.shape[1], pieces[missing])
    return Sampling.of(pieces)


def twin_attributes(
    twin: Twin, frame: Wireframe, sampling: Sampling, missing: np.ndarray, values: Mapping[str, StrutValues]
) -> dict[str, Attribute]:
    """Attributes of a twin's points and struts, by name.

    Parameters
    ----------
    twin, frame
        The twin and its plan.
    sampling
        See `twin_sampling`.
    missing
        Indices of the struts that are missing, in whole or in part.
    values
        Quantities of every strut.
    """
    dark = np.zeros(twin.opacity.shape, dtype=np.float64)
    dark[missing] = twin.opacity[missing] < DARK
    return {
        "opacity": Attribute("FLOAT", sampling.between(twin.opacity)),
        "distance": Attribute("FLOAT", height_above(twin.curves, frame.control_points, sampling)),
        "radius_guessed": Attribute("BOOLEAN", sampling.between(unmeasured(twin, frame.printed)) > 0.0),
        "missing": Attribute("BOOLEAN", sampling.between(dark) > 0.75),
        "state": Attribute("INT", np.where(frame.printed, State.PRINTED, State.UNPRINTED), "CURVE"),
        **strut_attributes(values),
    }


def unmeasured(twin: Twin, printed: np.ndarray) -> np.ndarray:
    """(E, K) 1 where no picture shows the piece, so that its radius is a guess from the plan or what is near."""
    return np.where(printed[:, None] & (twin.thickness > 0.0) & (twin.opacity >= DARK), 0.0, 1.0)


def strut_attributes(values: Mapping[str, StrutValues]) -> dict[str, Attribute]:
    """The quantities that are one number a strut."""
    found = {}
    for key, column in values.items():
        name = quantity_named(key).attribute
        if name not in (*ALONG, "printed", "batch"):
            found[name] = Attribute("FLOAT", column.values, "CURVE")
    return found


def height_above(curves: np.ndarray, plan: np.ndarray, sampling: Sampling) -> np.ndarray:
    """(P,) mm, distance of each point of curves (E, n + 1, 3) from the same strut of the plan (E, 4, 3).

    Below 0 where the point is lower than the nearest one of the plan, as where a strut sags.
    """
    point, _ = sampling.points(curves)
    strut = plan[sampling.strut]
    nearest = nearest_parameters(point, strut, sampling.parameter)
    away = point - np.einsum("pk,pkd->pd", bezier.bernstein(3, nearest), strut)
    return np.where(away[:, 2] < 0.0, -1.0, 1.0) * np.linalg.norm(away, axis=1)


def farthest(values: np.ndarray, sampling: Sampling) -> np.ndarray:
    """(E,) of each strut the value of its points (P,) that is farthest from 0."""
    first = np.cumsum(sampling.pieces + 1) - (sampling.pieces + 1)
    high, low = np.maximum.reduceat(values, first), np.minimum.reduceat(values, first)
    return np.where(high >= -low, high, low)
