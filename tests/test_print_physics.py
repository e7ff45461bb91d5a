"""The simulated print and the job's own model of it against an integrator that shares no code with either."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from portal_frames import Viscous, crept

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.process.creep import CreepModel, CreepParameters, PrintState
from frametwin.printing.process.material import PrintSettings, ProcessVariation
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.simulation.growth import GrowingPrint

SECONDS, PAUSE, PULL = 1.0, 300.0, 0.4
SETTINGS = PrintSettings(sag=None, flow=60.0, increments=1, seconds=(SECONDS, SECONDS), pause=PAUSE, axial=0.3)

CANTILEVER = (np.array([[0, 50], [20, 50], [40, 55], [60, 50]]), [(0, 1), (1, 2), (2, 3)], [0], [0, 1, 2])
PORTAL = (
    np.array([[0, 0], [60, 0], [0, 40], [60, 40], [30, 42]]),
    [(0, 2), (1, 3), (2, 4), (3, 4), (2, 3)],
    [0, 1],
    [0, 0, 1, 1, 2],
)
"""Nodes in mm, members from start to end, nodes held, and the batch of each member."""


@pytest.fixture(params=[CANTILEVER, PORTAL], ids=["cantilever", "portal"])
def case(request: pytest.FixtureRequest) -> tuple[Wireframe, PrintSequence, np.ndarray, list[float]]:
    """A frame, its order, how far an independent integrator has its joints move, and when members are laid."""
    nodes, members, held, batch = request.param
    batch = np.array(batch)
    laid = [SECONDS * (k + 0.5) + PAUSE * batch[k] for k in range(len(members))]
    frame = Wireframe.create(
        np.column_stack([nodes[:, 0], np.zeros(len(nodes)), nodes[:, 1]]),
        members,
        radius=1.0,
        grounded=np.isin(np.arange(len(nodes)), held),
    )
    weight = SETTINGS.material.weight
    one = Viscous(3500.0, 1.0, weight, PULL, SETTINGS.axial, SETTINGS.flow, SETTINGS.hardening, SETTINGS.rest)
    end = SECONDS * len(members) + PAUSE * (batch.max() + 1)
    moved = crept(nodes.astype(float), members, held, one, laid, end)
    axis = np.tile([0.0, 0.0, 1.0], (len(members), 1))
    sequence = PrintSequence(np.arange(len(members)), np.array(members)[:, 0], axis, batch)
    return frame, sequence, moved, laid


def test_the_simulated_print_creeps_as_an_independent_integrator_has_it(
    case: tuple[Wireframe, PrintSequence, np.ndarray, list[float]],
) -> None:
    frame, sequence, wanted, _ = case
    count = frame.strut_count
    certain = ProcessVariation(
        np.ones(count), np.tile([PULL, 0.0, -1.0], (count, 1)), np.zeros((count, 2, 3)), np.full(count, SECONDS)
    )
    printing = GrowingPrint(frame, sequence, SETTINGS, variation=certain, scale=1.0)
    plan = frame
    for batch in range(sequence.batch_count):
        printing.lay(batch, plan)
        there = printing.standing().frame
        plan = frame.moved_to(np.where(there.printed_vertices()[:, None], there.vertices, frame.vertices))
    moved = printing.standing().frame.vertices - frame.vertices
    assert printing.standing().frame.printed.all() and 0.005 < np.abs(wanted).max() < 1.0
    # Within an increment of 300 s struts of different age share loads as they do on average, not at each moment.
    np.testing.assert_allclose(moved[:, [0, 2]], wanted, atol=0.04 * np.abs(wanted).max())
    np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-9)


def test_the_model_of_the_job_creeps_as_an_independent_integrator_has_it(
    case: tuple[Wireframe, PrintSequence, np.ndarray, list[float]],
) -> None:
    frame, sequence, wanted, _ = case
    count = frame.strut_count
    model = CreepModel(frame, SETTINGS)
    pull = np.tile([PULL, 0.0], (count, 1))
    parameters = CreepParameters(1.0, SETTINGS.hardening, SETTINGS.rest, SETTINGS.axial, np.ones(count), pull)
    state = PrintState.before(frame.replace(printed=[False] * count), np.zeros(count), 0.0)
    for batch in range(sequence.batch_count):
        state = model.after(state, sequence.struts[sequence.batch == batch], parameters)
    moved = state.points - frame.vertices
    np.testing.assert_allclose(moved[:, [0, 2]], wanted, atol=0.04 * np.abs(wanted).max())


def test_short_increments_of_struts_of_two_ages_agree_with_the_integrator() -> None:
    nodes, members, held, _ = PORTAL
    weight = SETTINGS.material.weight
    one = Viscous(3500.0, 1.0, weight, PULL, SETTINGS.axial, SETTINGS.flow, SETTINGS.hardening, SETTINGS.rest)
    laid, end = np.array([0.0, 0.0, 400.0, 400.0, 400.0]), 1200.0
    wanted = crept(nodes.astype(float), members, held, one, laid.tolist(), end)
    places = np.column_stack([nodes[:, 0], np.zeros(5), nodes[:, 1]])
    frame = Wireframe.create(places, members, radius=1.0, grounded=np.arange(5) < 2)
    model, points = CreepModel(frame, SETTINGS), np.array(frame.vertices)
    parameters = CreepParameters(1.0, 600.0, 0.1, 0.3, np.ones(5), np.tile([PULL, 0.0], (5, 1)))
    times = np.linspace(0.0, end, 25)
    for before, after in zip(times[:-1], times[1:], strict=True):
        there = laid <= before
        joints = frame.replace(printed=there).printed_vertices() | frame.grounded
        state = PrintState(points, joints, there, laid, float(after))
        points = points + model.step(state, float(before), parameters).moved[:, :3]
    error = np.abs((points - frame.vertices)[:, [0, 2]] - wanted).max()
    assert error < 0.015 * np.abs(wanted).max()  # what is left is the shape, which the model follows as it changes


def test_what_varies_from_print_to_print_is_drawn_by_the_seed() -> None:
    settings = dataclasses.replace(SETTINGS, variation=0.3)
    drawn = [settings.of_print(seed) for seed in range(200)]
    for name in ("flow", "hardening", "rest", "axial"):
        factors = np.array([getattr(one, name) for one in drawn]) / getattr(settings, name)
        assert 0.7 <= factors.min() < 0.72 and 1.28 < factors.max() <= 1.3
    assert settings.of_print(3) == drawn[3] and SETTINGS.of_print(3) == SETTINGS
