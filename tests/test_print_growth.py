"""The growing print against beam theory, symmetry, and what becomes of struts that find nothing to stick to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from print_physics import lowest_first, print_with_right_twins
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.errors import InputError
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.process.material import PrintSettings, ProcessVariation
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.simulation.growth import GrowingPrint
from frametwin.printing.simulation.outcome import mean_deviation
from frametwin.raster.silhouette import silhouettes

CERTAIN = PrintSettings(uneven=0.0, lean=0.0, residual=0.0, placement=0.0)
WEIGHTLESS = dataclasses.replace(CERTAIN, sag=0.0)


def in_order(*start: int, batch: list[int] | None = None) -> PrintSequence:
    count = len(start)
    axis = np.tile([0.0, 0.0, 1.0], (count, 1))
    return PrintSequence(np.arange(count), np.array(start), axis, np.arange(count) if batch is None else batch)


def chain(*points: list[float]) -> Wireframe:
    """Struts in a row, the first point on the plate."""
    count = len(points)
    edges = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    return Wireframe.create(points, edges, radius=1.0, grounded=np.arange(count) == 0)


def with_joint(frame: Wireframe, joint: int, shift: list[float]) -> Wireframe:
    vertices = frame.vertices.copy()
    vertices[joint] += shift
    return Wireframe.create(vertices, frame.edges, radius=frame.radius, grounded=frame.grounded)


def test_a_cantilever_droops_as_a_beam_of_its_fluidity() -> None:
    length = 30.0
    frame = chain([0, 0, 0], [length, 0, 0])
    settings = dataclasses.replace(CERTAIN, sag=None, flow=50.0, increments=1, seconds=(40.0, 40.0), pause=60.0)
    printing = GrowingPrint(frame, in_order(0), settings)
    printing.lay(0, frame)
    age = 40.0 / 2.0 + 60.0
    flowed = 50.0 * (1.0 - np.exp(-age / settings.hardening) + settings.rest * age / settings.hardening)
    load = 1.24e-6 * 9.80665 * np.pi  # N/mm of PLA of 1 mm radius
    wanted = flowed * load * length**4 / (8.0 * 3500.0 * np.pi / 4.0)
    assert 0.001 < wanted < 0.01 * length
    np.testing.assert_allclose(-printing.standing().frame.vertices[1, 2], wanted, rtol=1e-3)


def test_at_half_the_speed_a_strut_takes_twice_as_long_and_flows_half_as_far() -> None:
    frame = chain([0, 0, 0], [30.0, 0, 0])
    usual = dataclasses.replace(CERTAIN, sag=None, flow=50.0, rest=0.0, increments=1, seconds=(40.0, 40.0), pause=1e5)
    droop, seconds = [], []
    for speed in (5.0, 2.5):
        printing = GrowingPrint(frame, in_order(0), dataclasses.replace(usual, speed=speed))
        seconds.append(printing.lay(0, frame).seconds - 1e5)
        droop.append(-float(printing.standing().frame.vertices[1, 2]))
    np.testing.assert_allclose(seconds, [40.0, 80.0])
    np.testing.assert_allclose(droop[1], 0.5 * droop[0], rtol=1e-3)


def test_the_weight_of_a_print_is_that_of_the_usual_speed() -> None:
    """Else the sag would be the same whatever the speed."""
    frame = tower()
    one, other = (GrowingPrint(frame, lowest_first(frame, 4), PrintSettings(speed=speed)) for speed in (5.0, 1.0))
    assert one.scale == other.scale


@pytest.mark.parametrize("forwards", [True, False])
def test_a_nozzle_pulls_at_the_post_from_which_it_draws_a_strut(forwards: bool) -> None:
    """The post bends as a cantilever under a load at its end, by as much as it flows while the strut is laid."""
    height, length = 20.0, 30.0
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height], [length, 0.0, height]])
    edges = [[0, 1], [1, 2] if forwards else [2, 1]]
    frame = Wireframe.create(points, edges, radius=1.0, grounded=[True, False, False])
    usual = dataclasses.replace(CERTAIN, sag=None, flow=5.0, increments=1, seconds=(40.0, 40.0), pause=60.0)
    tops = []
    for draw in (0.0, 2.0):
        printing = GrowingPrint(frame, in_order(0, 1, batch=[0, 1]), dataclasses.replace(usual, draw=draw))
        for batch in range(2):
            printing.lay(batch, frame)
        tops.append(float(printing.standing().frame.vertices[1, 0]))
    flowed = float(usual.flowed(np.array([80.0]), np.array([180.0]))[0])  # the post, from 80 s after it was laid
    force = 2.0 * 1.24e-6 * 9.80665 * np.pi * length * 40.0 / 100.0
    np.testing.assert_allclose(tops[1] - tops[0], flowed * force * height**3 / (3.0 * 3500.0 * np.pi / 4.0), rtol=0.01)


def test_flow_adds_up_over_time() -> None:
    ages = np.array([0.0, 50.0, 300.0, 5000.0])
    parts = CERTAIN.flowed(ages[:-1], ages[1:])
    np.testing.assert_allclose(parts.sum(), CERTAIN.flowed(ages[:1], ages[-1:])[0])
    lone = dataclasses.replace(CERTAIN, rest=0.0)
    np.testing.assert_allclose(lone.flowed(np.zeros(1), np.array([1e9])), lone.flow)


@pytest.mark.parametrize("name", ["tower", "half_bowl"])
def test_without_weight_nothing_moves(name: str) -> None:
    frame = tower() if name == "tower" else named_frame(name)
    printing = GrowingPrint(frame, lowest_first(frame, 4), dataclasses.replace(WEIGHTLESS, lean=0.3, residual=0.3))
    for batch in range(4):
        printing.lay(batch, frame)
    np.testing.assert_allclose(printing.standing().frame.control_points, frame.control_points, atol=1e-9)
    report = printing.report()
    assert report.completed and report.collapsed_at_batch is None
    assert max(report.e_max) < 1e-9 and report.mean_deviation < 1e-9
    assert sum(report.attached) == frame.strut_count


@pytest.mark.parametrize(("beads", "sticks"), [(0.9, True), (1.1, False)])
def test_a_start_further_than_a_bead_from_its_joint_does_not_stick(beads: float, sticks: bool) -> None:
    frame = chain([0, 0, 0], [0, 0, 20], [0, 0, 40], [0, 0, 60])
    printing = GrowingPrint(frame, in_order(0, 1, 2), WEIGHTLESS)
    assert printing.lay(0, frame).attached.tolist() == [0]
    outcome = printing.lay(1, with_joint(frame, 1, [2.0 * beads, 0, 0]))
    assert outcome.attached.tolist() == ([1] if sticks else [])
    above = printing.lay(2, frame)  # begins where the strut before should have ended
    assert above.attached.tolist() == ([2] if sticks else [])
    assert above.lost.tolist() == ([] if sticks else [1, 2])
    assert above.collapsed is not sticks
    np.testing.assert_array_equal(printing.standing().frame.printed, [True, sticks, sticks])
    if sticks:  # welded to the joint where that really is
        np.testing.assert_allclose(printing.standing().frame.vertices[1], frame.vertices[1], atol=1e-9)


def test_a_far_end_that_misses_its_joint_hangs_free() -> None:
    frame = Wireframe.create(
        [[0, 0, 0], [20, 0, 0], [10, 0, 20]], [[0, 2], [1, 2]], radius=1.0, grounded=[True, True, False]
    )
    printing = GrowingPrint(frame, in_order(0, 1), WEIGHTLESS)
    printing.lay(0, frame)
    outcome = printing.lay(1, with_joint(frame, 2, [0, 3.0, 0]))
    assert outcome.attached.tolist() == [1] and outcome.hanging.tolist() == [1]
    stands = printing.standing()
    assert stands.frame.printed.tolist() == [True, False] and stands.present.tolist() == [[0.0, 1.0], [0.0, 0.0]]
    assert stands.pictured.printed.all()
    np.testing.assert_allclose(stands.pictured.control_points[1, 3], [10, 3, 20])
    np.testing.assert_array_equal(stands.frame.edges, frame.edges)
    assert not printing.report().completed
    camera = ring_rig(frame, 1, size=(60, 80))
    seen, whole = (silhouettes(part, camera)[0].astype(int).sum() for part in (stands.frame, stands.pictured))
    assert whole > 1.3 * seen


def test_a_start_on_another_strut_of_its_joint_sticks_too() -> None:
    frame = chain([0, 0, 0], [30, 0, 0], [30, 0, 20])
    printing = GrowingPrint(frame, in_order(0, 1), WEIGHTLESS)
    printing.lay(0, frame)
    assert printing.lay(1, with_joint(frame, 1, [-8.0, 0, 0])).attached.tolist() == [1]


def test_a_strut_bent_too_far_comes_off_and_what_it_held_falls() -> None:
    frame = chain([0, 0, 0], [30, 0, 0], [60, 0, 0])
    settings = dataclasses.replace(CERTAIN, sag=None, flow=3e5)
    printing = GrowingPrint(frame, in_order(0, 1, batch=[0, 0]), settings)
    outcome = printing.lay(0, frame)
    assert outcome.lost.tolist() == [0, 1] and outcome.standing == 0 and outcome.collapsed
    assert not printing.standing().pictured.printed.any()
    assert np.isnan(printing.report().mean_deviation)


def test_the_print_has_collapsed_when_less_stands_than_before() -> None:
    """A soft arm holds until the weight at its end is too much."""
    frame = chain([0, 0, 0], [30, 0, 0], [60, 0, 0], [90, 0, 0])
    settings = dataclasses.replace(CERTAIN, sag=None, flow=3e4, collapse_share=1.0, bead=100.0)
    printing = GrowingPrint(frame, in_order(0, 1, 2), settings)
    outcomes = [printing.lay(batch, frame) for batch in range(3)]
    first = next(k for k, outcome in enumerate(outcomes) if len(outcome.lost))
    assert first > 0 and outcomes[first].standing < outcomes[first - 1].standing
    assert [outcome.collapsed for outcome in outcomes] == [k >= first for k in range(3)]
    assert printing.report().collapsed_at_batch == first


def test_a_symmetric_frame_sags_symmetrically() -> None:
    frame = tower()
    settings = dataclasses.replace(CERTAIN, sag=0.02, seconds=(1e-9, 1e-9), increments=1)
    printing = GrowingPrint(frame, lowest_first(frame, 2), settings)
    for batch in range(2):
        printing.lay(batch, frame)
    real = printing.standing().frame
    assert real.printed.all()
    turn = rotation_matrices(np.array([0.0, 0.0, np.pi / 2.0]))
    middle = np.array([10.0, 10.0, 0.0])
    turned = (real.vertices - middle) @ turn.T + middle
    nearest = np.linalg.norm(turned[:, None] - real.vertices, axis=2).min(axis=1)
    assert np.abs(real.vertices - frame.vertices).max() > 0.1
    assert nearest.max() < 1e-6


def test_the_expected_print_sags_as_far_as_is_wanted() -> None:
    frame = named_frame("bridge")
    settings = dataclasses.replace(CERTAIN, sag=0.002)
    printing = GrowingPrint(frame, lowest_first(frame, 6), settings)
    for batch in range(6):
        printing.lay(batch, frame)
    moved = np.linalg.norm(printing.standing().frame.vertices - frame.vertices, axis=1).max()
    np.testing.assert_allclose(moved, 0.002 * frame.extent, rtol=0.02)


def test_the_seed_decides_and_nothing_else() -> None:
    frame = named_frame("bridge")
    sequence = lowest_first(frame, 8)

    def curves(seed: int) -> np.ndarray:
        printing = GrowingPrint(frame, sequence, seed=seed)
        for batch in range(4):
            printing.lay(batch, frame)
        return printing.standing().pictured.control_points

    np.testing.assert_array_equal(curves(3), curves(3))
    assert np.abs(curves(0) - curves(1)).max() > 0.1


def test_what_is_left_to_chance_does_not_depend_on_the_plan() -> None:
    frame = tower()
    moved = frame.transformed(np.array([[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    one, other = (GrowingPrint(frame, lowest_first(frame, 3), seed=4) for _ in range(2))
    assert one.lay(0, frame).seconds == other.lay(0, moved).seconds
    shift = other.standing().frame.vertices[:4] - one.standing().frame.vertices[:4]  # on the plate: only placed
    np.testing.assert_allclose(shift, np.tile([0.5, 0, 0], (4, 1)), atol=1e-12)


def test_adaptation_finishes_a_print_that_collapses_without() -> None:
    frame = named_frame("bridge")
    sequence = lowest_first(frame, 16)
    plain, adapted = (GrowingPrint(frame, sequence, seed=1) for _ in range(2))
    for batch in range(16):
        plain.lay(batch, frame)
    print_with_right_twins(adapted)
    assert plain.report().collapsed_at_batch is not None and not plain.report().completed
    assert adapted.report().completed
    assert adapted.report().e_max[-1] > 2.0 * frame.radius[0]  # it sagged all the same, by more than a bead


def test_the_deviation_is_a_distance_between_curves() -> None:
    frame = tower()
    along = frame.replace(printed=np.arange(frame.strut_count) == 0)
    shifted = along.transformed(np.array([[1, 0, 0, 2.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    np.testing.assert_allclose(mean_deviation(frame, shifted), 2.0, rtol=1e-9)


def test_lost_struts_can_be_laid_again() -> None:
    frame = chain([0, 0, 0], [0, 0, 20], [0, 0, 40])
    sequence = in_order(0, 1)
    printing = GrowingPrint(frame, sequence, WEIGHTLESS)
    printing.lay(0, frame)
    printing.lay(1, with_joint(frame, 1, [5.0, 0, 0]))
    outcome = printing.lay(2, frame, sequence.in_batch(1))
    assert outcome.attached.tolist() == [1] and not len(outcome.lost)


def test_bad_settings_and_plans_are_refused() -> None:
    frame = tower()
    for wrong in ({"hardening": 0.0}, {"sag": 1.0}, {"increments": 0}, {"seconds": (5.0, 1.0)}, {"rest": -1.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            PrintSettings(**wrong)
    with pytest.raises(InputError, match="seed"):
        ProcessVariation.draw(3, PrintSettings(), -1)
    printing = GrowingPrint(frame, lowest_first(frame, 2))
    with pytest.raises(InputError, match="edges"):
        printing.lay(0, tower(3))
