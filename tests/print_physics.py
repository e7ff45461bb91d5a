"""What the tests of adaptive printing share: fields that are formulas, twins that are right, and simple orders."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from frametwin.fields.base import DeformationField, Floats, checked_points
from frametwin.fitting.frame_field import field_through
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.adapt import adapt
from frametwin.printing.adaptation.anticipation import Anticipation, drift_rate
from frametwin.printing.adaptation.compensation import SagForecast, compensate
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.simulation.growth import GrowingPrint
from frametwin.simulation.print_order import print_order
from frametwin.twin.twin import Twin


class Formula(DeformationField):
    """A field that is a function of the points (N, 3)."""

    kind = "formula"

    def __init__(self, displacement: Callable[[np.ndarray], np.ndarray]) -> None:
        self.displacement = displacement

    def evaluate(self, points: ArrayLike) -> Floats:
        return self.displacement(checked_points(points))

    def laplacian(self, points: ArrayLike) -> Floats:
        raise NotImplementedError

    def tensors(self) -> dict[str, np.ndarray]:
        raise NotImplementedError

    def metadata(self) -> dict[str, str]:
        raise NotImplementedError

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> DeformationField:
        raise NotImplementedError


def twin_at(
    vertices: np.ndarray,
    control_points: np.ndarray,
    completeness: np.ndarray | None = None,
    confidence: np.ndarray | None = None,
) -> Twin:
    """A twin of these curves, of whole and well-seen struts unless told otherwise."""
    count = len(control_points)
    ones = np.ones(count)
    return Twin(
        control_points=control_points,
        vertices=vertices,
        thickness=np.ones((count, 4)),
        opacity=np.ones((count, 4)),
        completeness=ones if completeness is None else completeness,
        confidence=ones if confidence is None else confidence,
    )


def lowest_first(frame: Wireframe, batches: int) -> PrintSequence:
    """The struts from the ground up in batches of even size, each begun where something stands."""
    struts = print_order(frame)
    there, start = frame.grounded.copy(), []
    for a, b in frame.edges[struts]:
        start.append(a if there[a] and (not there[b] or frame.vertices[a, 2] <= frame.vertices[b, 2]) else b)
        there[[a, b]] = True
    batch = np.arange(len(struts)) * batches // len(struts)
    return PrintSequence(struts, np.array(start), np.tile([0.0, 0.0, 1.0], (len(struts), 1)), batch)


def print_with_right_twins(
    printing: GrowingPrint, forecast: SagForecast | None = None, anticipates: bool = False
) -> None:
    """Print the whole sequence, every batch answered by a twin that is right; compensated if there is a forecast."""
    plan = printing.design.replace(printed=np.zeros(printing.design.strut_count, dtype=bool))
    seen: list[Observation] = []
    for batch in range(printing.sequence.batch_count):
        laying = printing.sequence.in_batch(batch)
        ahead = Anticipation.of(plan, laying, drift_rate(seen) if anticipates else None)
        printing.lay(batch, plan, laying, ahead.curves())
        real = printing.standing().frame
        asked = plan.replace(printed=plan.printed | (printing.sequence.laid_before(batch + 1, plan.strut_count)))
        stands, struts, _ = asked.replace(printed=real.printed).printed_part()
        field = field_through(stands, real.control_points[struts], (2, 5))
        twin = twin_at(real.vertices, real.control_points, completeness=real.printed.astype(float))
        plan = adapt(asked, twin, field)
        seen.append(Observation.of(batch, asked, twin, struts=len(laying)))
        if forecast is not None:
            plan = compensate(plan, printing.design, forecast.remaining_drift(seen, batch + 1))
