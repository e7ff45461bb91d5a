"""The plan moved to meet the print: the answer to a batch (paper, Sec. III.B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.fields.base import DeformationField
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.ranges import Share, check_settings
from frametwin.twin.blending import SAMPLES, blend
from frametwin.twin.twin import Twin


@dataclass(frozen=True)
class AdaptSettings:
    """What of a twin is believed.

    Attributes
    ----------
    completeness
        A printed strut of which a smaller share is there counts as lost: it did not attach, or fell.
    confidence
        A printed strut with less is where the field says, not where the twin says: the views cannot tell.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    completeness: Share = 0.5
    confidence: Share = 0.02

    def __post_init__(self) -> None:
        check_settings(self)


def adapt(plan: Wireframe, twin: Twin, field: DeformationField, settings: AdaptSettings | None = None) -> Wireframe:
    """The plan of the next batch: printed struts where the twin saw them, unprinted ones blended towards them.

    The paper's three cases, with the joints of printed struts closing exactly (`frametwin.twin.blending.blend`). Plans
    compose: the result is what the robot follows next, and what the next twin is found relative to. Where twin
    and field say that nothing moved, the result is the plan to the last bit.

    Parameters
    ----------
    plan
        What the robot followed until now, ``printed`` being what the twin was asked for.
    twin, field
        Of a fit of ``plan`` to pictures of the print.
    settings
        See `AdaptSettings`.

    Returns
    -------
    A frame of the same struts and joints. Lost struts are not marked as printed: nothing is supported by them, nor
    expected in the next pictures; they move like other struts that are still to come. Printed struts that are
    seen too badly move with the field, and so do joints of which nothing better is known.

    Raises
    ------
    InputError
        If the twin is not one of this plan.
    """
    settings = AdaptSettings() if settings is None else settings
    twin.as_wireframe(plan)  # refuses a twin of another plan
    standing = plan.printed.copy()
    standing[lost_struts(plan, twin, settings)] = False
    trusted = standing & (twin.confidence >= settings.confidence)
    stands = plan.replace(printed=standing)
    guessed = stands.printed_vertices() & ~plan.replace(printed=trusted).printed_vertices()
    vertices, curves = np.array(twin.vertices), np.array(twin.control_points)
    if guessed.any():
        vertices[guessed] = plan.vertices[guessed] + field.evaluate(plan.vertices[guessed])
    unsure = np.flatnonzero(standing & ~trusted)
    if len(unsure):
        curves[unsure] = _carried(plan, vertices, unsure, field)
    vertices, curves = blend(stands, vertices, curves, field.evaluate)
    return stands.replace(vertices=vertices, control_points=curves)


def lost_struts(plan: Wireframe, twin: Twin, settings: AdaptSettings | None = None) -> np.ndarray:
    """Find printed struts that are not in the twin, as indices (N,): they did not attach, or fell."""
    settings = AdaptSettings() if settings is None else settings
    return np.flatnonzero(plan.printed & (twin.completeness < settings.completeness))


def _carried(plan: Wireframe, vertices: np.ndarray, struts: np.ndarray, field: DeformationField) -> np.ndarray:
    """Curves (S, 4, 3) of ``struts``, moved with the field between the joints ``vertices`` (V, 3)."""
    u = np.linspace(0.0, 1.0, SAMPLES + 1)
    points = bezier.evaluate(plan.control_points[struts], u)  # (S, m + 1, 3)
    change = bezier.refit_matrix(SAMPLES) @ field.evaluate(points.reshape(-1, 3)).reshape(points.shape)
    moved = plan.control_points[struts] + change
    start, end = (vertices[plan.edges[struts, side]] for side in (0, 1))
    return moved + bezier.straight(start - moved[:, 0], end - moved[:, 3])
