"""How far a print sags in an order, in closed form, and that the order which sags less is taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from frametwin.errors import Cancelled
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.stiffness import PLA
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.sequencing.reachability import search_space
from frametwin.printing.sequencing.removal import remove_all
from frametwin.printing.sequencing.sagging import expected_sag, heights_to_try, least_sagging
from frametwin.progress import Progress

UP = np.array([0.0, 0.0, 1.0])


def in_order(frame: Wireframe, struts: list[int], start: list[int], batch: list[int]) -> PrintSequence:
    axes = np.tile(UP, (len(struts), 1))
    return PrintSequence(np.array(struts), np.array(start), axes, np.array(batch), source=frame.name)


def test_sag_of_one_hot_cantilever_in_closed_form() -> None:
    length, radius = 30.0, 1.0
    grounded = np.array([True, False])
    frame = Wireframe.create([[0.0, 0.0, 10.0], [length, 0.0, 10.0]], [[0, 1]], radius=radius, grounded=grounded)
    settings = PrintSettings()
    elastic = PLA.weight * np.pi * radius**2 * length**4 / (8.0 * PLA.young * np.pi * radius**4 / 4.0)
    age = 0.5 * np.mean(settings.seconds) + settings.pause  # from the middle of its laying until the next batch
    integral = settings.hardening * (1.0 - np.exp(-age / settings.hardening)) + settings.rest * age
    sag = expected_sag(frame, in_order(frame, [0], [0], [0]))
    assert sag == pytest.approx(settings.flow * elastic * integral / settings.hardening, rel=1e-3)


def beam(spans: int) -> Wireframe:
    """A row of struts from a foot at each end."""
    vertices = np.column_stack([20.0 * np.arange(spans + 1), np.zeros(spans + 1), np.full(spans + 1, 30.0)])
    grounded = np.zeros(spans + 1, dtype=bool)
    grounded[[0, -1]] = True
    edges = np.column_stack([np.arange(spans), np.arange(1, spans + 1)])
    return Wireframe.create(vertices, edges, radius=1.0, grounded=grounded)


def test_the_order_from_both_feet_is_taken() -> None:
    frame = beam(6)
    one = in_order(frame, [0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5])
    both = in_order(frame, [0, 5, 1, 4, 2, 3], [0, 6, 1, 5, 2, 3], [0, 1, 2, 3, 4, 5])
    assert least_sagging(frame, [one, both]) is both
    assert least_sagging(frame, [both, one]) is both
    assert least_sagging(frame, [both, replace(both)]) is both
    with pytest.raises(ValueError, match="no orders"):
        least_sagging(frame, [])


def test_a_planned_order_sags_no_more_than_the_usual_one(curved_frame: Wireframe) -> None:
    settings = OrderSettings(batch_size=4, allow_contact=True)
    space = search_space(curved_frame, settings)
    found = plan_sequence(curved_frame, settings)
    for height in heights_to_try(curved_frame, space):
        way = remove_all(replace(space, height=height))
        start = curved_frame.edges[way.struts, way.start]
        other = PrintSequence(way.struts, start, settings.axes[way.axis], found.batch, source=curved_frame.name)
        assert expected_sag(curved_frame, found) <= 1.05 * expected_sag(curved_frame, other)


def test_computing_the_print_can_be_cancelled() -> None:
    frame = beam(4)
    order = in_order(frame, [0, 3, 1, 2], [0, 4, 1, 2], [0, 1, 2, 3])

    def stop(progress: Progress) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        least_sagging(frame, [order, order], stop)
