"""The forecast that learns from the print: derivatives, parameters found again, and frames that end at their design."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from print_cases import LeaningPrint, fingerprint, print_batch, small_job
from print_physics import lowest_first, twin_at
from small_frames import tower

from frametwin.errors import InputError
from frametwin.files import read_json, write_json
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.aiming import aimed, expected_drift
from frametwin.printing.adaptation.anticipation import Anticipation
from frametwin.printing.adaptation.material_file import (
    ABOUT_USUAL,
    PRINT_TO_PRINT,
    for_next_print,
    read_material,
    read_usual,
    usual_after,
    write_material,
)
from frametwin.printing.adaptation.material_fit import GUESS, BatchRecord, MaterialEstimate, MaterialFit
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.adaptation.printability import Fall, first_fall, outlook
from frametwin.printing.adaptation.rest_of_print import remaining_movement, resized_steps, steps_of
from frametwin.printing.job.creep_forecast import CreepForecast
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.job_files import JOB
from frametwin.printing.job.plan_job import PlanOptions, guessed_outlook, plan_job, require_standing
from frametwin.printing.process.creep import LARGEST_MOVE, CreepModel, CreepParameters, PrintState
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.resizing import resized, suitable_size
from frametwin.printing.simulation.growth import GrowingPrint

SETTINGS = PrintSettings()
BATCHES = 12


@pytest.fixture(scope="module")
def bridge() -> Wireframe:
    return named_frame("bridge")


@pytest.fixture(scope="module")
def sequence(bridge: Wireframe) -> PrintSequence:
    return lowest_first(bridge, BATCHES)


def known(weight: float, hardening: float, rest: float, axial: float, error: float = 0.2) -> MaterialEstimate:
    mean = (np.log(weight), 0.03, -0.02, np.log(hardening), np.log(rest), np.log(axial))
    return MaterialEstimate(tuple(float(one) for one in mean), (error, 0.05, 0.05, error, error, error))


def records(truth: MaterialFit, sequence: PrintSequence, batches: int, noise: float) -> list[BatchRecord]:
    """What twins see of a print that creeps just as the model has it."""
    design, rng = truth.model.design, np.random.default_rng(3)
    state = PrintState.before(design.replace(printed=[False] * design.strut_count), np.zeros(design.strut_count), 0.0)
    result = []
    for batch in range(batches):
        struts = sequence.struts[sequence.batch == batch]
        after = truth.model.after(state, struts, truth.parameters, parts=3)
        moved = after.points - state.points
        there = after.there & ~design.grounded
        seen = np.where(there[:, None], moved + noise * rng.normal(size=moved.shape), 0.0)
        result.append(BatchRecord(state, struts, after.laid, seen, there))
        state = after
    return result


def test_derivatives_are_those_of_finite_differences(bridge: Wireframe, sequence: PrintSequence) -> None:
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.3, 500.0, 0.1, 0.2))
    record = records(fit, sequence, 5, 0.0)[-1]
    joints, none = np.flatnonzero(record.known), np.zeros(0, dtype=np.int64)
    # One part: the derivatives of later parts leave out that they start from points that have moved.
    moved, slope = fit._measured(record, joints, 1, np.arange(len(fit.values)))
    laid = int(sequence.struts[sequence.batch == 3][1])
    count = bridge.strut_count
    for place in (*range(6), 6 + laid, 6 + count + laid, 6 + 2 * count + laid):
        shifted = [fit.values.copy() for _ in range(2)]
        for values, sign in zip(shifted, (1.0, -1.0), strict=True):
            values[place] += sign * 1e-4
        plus, minus = (dataclasses.replace(fit, values=v)._measured(record, joints, 1, none)[0] for v in shifted)
        numeric = (plus - minus) / 2e-4
        assert np.abs(numeric).max() > 0.0
        np.testing.assert_allclose(slope[:, place], numeric, atol=2e-3 * np.abs(numeric).max())


def test_a_material_is_found_again_with_an_error_bar(bridge: Wireframe, sequence: PrintSequence) -> None:
    model = CreepModel(bridge, SETTINGS)
    truth = MaterialFit.start(model, known(1.8, 450.0, 0.13, 0.12))
    fit = MaterialFit.start(model)
    for record in records(truth, sequence, 8, 0.03):
        fit = fit.updated(record)
    off = np.array(fit.estimate.mean) - np.array(truth.estimate.mean)
    deviation = np.array(fit.estimate.deviation)
    assert (deviation < 0.6 * np.array(GUESS.deviation))[[0, 3, 4]].all()
    assert (np.abs(off) < 3.0 * deviation).all()
    assert abs(off[0] - off[3]) < 0.5 and fit.trust > 0.9


def test_what_twins_are_off_by_time_after_time_is_not_taken_for_movement(
    bridge: Wireframe, sequence: PrintSequence
) -> None:
    """Twins that are shifted, and off at each joint in the same way in every batch, tell the material all the same."""
    model, rng = CreepModel(bridge, SETTINGS), np.random.default_rng(5)
    truth, fit = MaterialFit.start(model, known(1.8, 450.0, 0.13, 0.12)), MaterialFit.start(model)
    off = np.array([0.15, -0.1, 0.2]) + 0.15 * rng.normal(size=(bridge.vertex_count, 3))
    real = records(truth, sequence, BATCHES, 0.0)
    for record in real:
        old = record.state.there[:, None]
        state = dataclasses.replace(record.state, points=record.state.points + np.where(old, off, 0.0))
        moved = np.where(record.known[:, None], record.moved + np.where(old, 0.0, off), 0.0)
        fit = fit.updated(dataclasses.replace(record, state=state, moved=moved))
    wrong = np.array(fit.estimate.mean) - np.array(truth.estimate.mean)
    assert (np.abs(wrong) < 3.0 * np.array(fit.estimate.deviation)).all()
    assert np.abs(wrong[[0, 3, 4]]).max() < 0.2
    stands = real[-1].known
    last = real[-1].state.points + real[-1].moved
    told = fit.points + fit.shift
    assert np.abs((told - (last + off))[stands]).max() < 0.1  # where the twins see the joints


def test_a_joint_that_one_twin_gets_wrong_says_little_of_the_material(
    bridge: Wireframe, sequence: PrintSequence
) -> None:
    model = CreepModel(bridge, SETTINGS)
    truth = MaterialFit.start(model, known(1.5, 600.0, 0.1, 0.1))
    real = records(truth, sequence, 7, 0.03)
    joint = int(np.flatnonzero(real[4].state.there & ~bridge.grounded)[0])
    told = {}
    for wrong in (0.0, 3.0):
        fit = MaterialFit.start(model, known(1.5, 600.0, 0.1, 0.1))
        for batch, record in enumerate(real):
            points, moved = np.array(record.state.points), np.array(record.moved)
            if batch == 4:
                moved[joint, 2] -= wrong
            elif batch == 5:  # it is seen again where it was, from where it was seen wrongly
                points[joint, 2] -= wrong
                moved[joint, 2] += wrong
            state = dataclasses.replace(record.state, points=points)
            fit = fit.updated(dataclasses.replace(record, state=state, moved=moved))
        told[wrong] = fit.values[[0, 3, 4, 5]]
    assert np.abs(told[3.0] - told[0.0]).max() < 0.05


def test_what_twins_are_off_by_is_not_held_against_a_forecast(bridge: Wireframe, sequence: PrintSequence) -> None:
    """Where the first struts are seen beside where they are by more than they move, the rest is aimed all the same."""
    model, rng = CreepModel(bridge, SETTINGS), np.random.default_rng(7)
    truth = MaterialFit.start(model, known(1.2, 600.0, 0.1, 0.1))
    fit = MaterialFit.start(model, known(1.2, 600.0, 0.1, 0.1))
    record = records(truth, sequence, 1, 0.0)[0]
    seen = record.known[:, None] * 0.3 * rng.normal(size=record.moved.shape)
    assert np.linalg.norm(seen) > np.linalg.norm(record.moved)
    assert fit.updated(replace(record, moved=record.moved + seen)).trust > 0.95


def test_a_print_that_goes_another_way_than_forecast_is_not_aimed(bridge: Wireframe, sequence: PrintSequence) -> None:
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(3.0, 600.0, 0.1, 0.1, error=0.02))
    for record in records(fit, sequence, 8, 0.0):
        fit = fit.updated(replace(record, moved=-record.moved))
    assert fit.trust < 0.2


def test_batches_that_nobody_saw_are_followed_all_the_same(bridge: Wireframe, sequence: PrintSequence) -> None:
    """What moves unseen is not taken for a sudden movement by the next twin."""
    model = CreepModel(bridge, SETTINGS)
    truth = MaterialFit.start(model, known(1.5, 600.0, 0.1, 0.1))
    fit = MaterialFit.start(model, known(1.5, 600.0, 0.1, 0.1))
    for batch, record in enumerate(records(truth, sequence, 8, 0.0)):
        blind = np.zeros_like(record.known) if batch in (3, 4, 5) else record.known
        fit = fit.updated(dataclasses.replace(record, known=blind))
    np.testing.assert_allclose(fit.values[:6], truth.values[:6], atol=0.01)


def test_struts_that_flow_faster_are_told_from_the_others(bridge: Wireframe, sequence: PrintSequence) -> None:
    model = CreepModel(bridge, SETTINGS)
    truth, fit = (MaterialFit.start(model, known(1.5, 600.0, 0.1, 0.1)) for _ in range(2))
    speeds = 0.3 * np.random.default_rng(1).normal(size=bridge.strut_count)
    values = truth.values.copy()
    values[6 : 6 + bridge.strut_count] = speeds
    truth = dataclasses.replace(truth, values=values)
    for record in records(truth, sequence, BATCHES, 0.01):
        fit = fit.updated(record)
    found = np.log(fit.parameters.speed)
    assert np.corrcoef(found, speeds)[0, 1] > 0.5


def test_what_is_aimed_is_forecast_to_end_at_the_design(bridge: Wireframe, sequence: PrintSequence) -> None:
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.2, 600.0, 0.1, 0.1, error=1e-4))
    plan = bridge.replace(printed=[False] * bridge.strut_count)
    state = PrintState.before(plan, np.zeros(bridge.strut_count), 0.0)
    steps = steps_of([sequence.struts[sequence.batch == k] for k in range(BATCHES)])
    unaimed = np.linalg.norm(remaining_movement(fit, state, steps).joints, axis=1)
    plan = aimed(bridge, plan, bridge.vertices, fit, state, steps)  # the first aim, nothing being aimed before
    moves = remaining_movement(fit, PrintState.before(plan, state.laid_at, 0.0), steps)
    moved, bows = moves.joints, moves.bows
    ends = np.linalg.norm(plan.vertices + moved - bridge.vertices, axis=1)
    assert unaimed.max() > 3.0 and np.sqrt(np.mean(ends**2)) < 0.15
    straight = bridge.moved_to(plan.vertices).control_points
    bent = (plan.control_points - straight)[:, 1:3]
    np.testing.assert_allclose(bent, -fit.trust * bows, atol=0.1 * np.abs(bows).max())


def test_batches_far_ahead_take_as_long_together_as_one_by_one(bridge: Wireframe) -> None:
    """Each ends with a pause, in which the print goes on sagging."""
    many = lowest_first(bridge, 38)
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.2, 600.0, 0.1, 0.1))
    plan = bridge.replace(printed=many.laid_before(2, bridge.strut_count))
    began = PrintState.before(plan, np.zeros(bridge.strut_count), 300.0)
    batches = [many.struts[many.batch == k] for k in range(2, 38)]
    together, state = remaining_movement(fit, began, steps_of(batches)).joints, began
    for struts in batches:
        state = fit.model.after(state, struts, fit.parameters)
    single = state.points - began.points
    assert np.linalg.norm(together - single) < 0.06 * np.linalg.norm(single)


@pytest.mark.parametrize("batch", [0, 2])
def test_where_the_next_joints_end_does_not_hang_on_how_finely_time_is_divided(batch: int) -> None:
    """Against the same model that settles after every strut."""
    frame = named_frame("half_bowl")
    sequence = lowest_first(frame, 6)
    fit = MaterialFit.start(CreepModel(frame, SETTINGS), known(1.2, 600.0, 0.1, 0.1))
    batches = [sequence.struts[sequence.batch == k] for k in range(6)]
    began = PrintState.before(frame.replace(printed=[False] * frame.strut_count), np.zeros(frame.strut_count), 0.0)
    for struts in batches[:batch]:
        began = fit.model.after(began, struts, fit.parameters, parts=len(struts))
    state = began
    for struts in batches[batch:]:
        state = fit.model.after(state, struts, fit.parameters, parts=len(struts))
    next_ones = frame.replace(printed=sequence.laid_before(batch + 2, frame.strut_count)).printed_vertices()
    next_ones &= ~began.there
    wanted = (state.points - began.points)[next_ones]
    found = remaining_movement(fit, began, steps_of(batches[batch:])).joints[next_ones]
    assert len(wanted) > 10 and np.linalg.norm(wanted, axis=1).max() > 1.0
    assert np.linalg.norm(found - wanted) < 0.12 * np.linalg.norm(wanted)


def test_sizes_of_batches_are_found_with_how_the_print_moves_in_them(bridge: Wireframe) -> None:
    many = lowest_first(bridge, 30)
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.2, 600.0, 0.1, 0.1))
    plan = bridge.replace(printed=many.laid_before(2, bridge.strut_count))
    began = PrintState.before(plan, np.zeros(bridge.strut_count), 300.0)
    steps, moves = resized_steps(
        fit, began, steps_of([many.struts[many.batch == k] for k in range(2, 30)]), lambda step, rate: 2
    )
    assert all(2 * step.batches - 1 <= len(step.struts) <= 2 * step.batches for step in steps)
    assert max(step.batches for step in steps) > 1
    assert np.array_equal(np.concatenate([step.struts for step in steps]), many.struts[many.batch >= 2])
    again = remaining_movement(fit, began, steps)
    np.testing.assert_array_equal(moves.joints, again.joints)
    np.testing.assert_allclose(moves.bows, again.bows, atol=1e-12)


def test_a_print_is_aimed_for_the_batches_it_will_be_laid_in(bridge: Wireframe) -> None:
    """Batches that are cut short when their turn comes make a print longer, and it sags further."""
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.5, 600.0, 0.1, 0.1, error=1e-4))
    off = {}
    for told in (True, False):
        sequence, batch = lowest_first(bridge, 5), 0
        forecast = replace(CreepForecast.start(bridge), fit=fit)
        state = PrintState.before(forecast.plan, forecast.laid_at, 0.0)
        while batch < sequence.batch_count:
            plan = forecast.aimed(sequence, batch, state.points, resize=told)
            sequence = forecast.following(plan).resized(sequence, batch)
            laying = sequence.in_batch(batch).struts
            state = fit.model.after(replace(state, points=np.array(plan.vertices)), laying, fit.parameters, parts=3)
            plan = plan.replace(printed=state.laid).moved_to(state.points)
            forecast = replace(forecast, plan=plan, laid_at=state.laid_at, clock=state.clock)
            batch += 1
        assert batch > 10
        off[told] = float(np.sqrt(np.mean(np.sum((state.points - bridge.vertices) ** 2, axis=1))))
    assert off[True] < 0.7 and off[False] > 3.0 * off[True]


def test_what_is_not_known_is_not_acted_upon(bridge: Wireframe, sequence: PrintSequence) -> None:
    forecast = CreepForecast.start(bridge)
    assert forecast.fit.trust == 0.0
    assert forecast.aimed(sequence, 0) is forecast.plan and forecast.drift(sequence.in_batch(0)) is None


def test_a_print_that_stands_still_is_hardly_aimed(bridge: Wireframe, sequence: PrintSequence) -> None:
    forecast = CreepForecast.start(bridge)
    for batch in range(6):
        laying = sequence.in_batch(batch)
        stands = bridge.replace(printed=sequence.laid_before(batch + 1, bridge.strut_count))
        there = stands.printed_vertices() & ~bridge.grounded
        forecast = forecast.answered(laying, Observation(batch, np.zeros((len(there), 3)), there), stands)
    aims = forecast.aimed(sequence, 6).vertices - bridge.vertices
    assert np.abs(aims).max() < 0.4


def closed_loop(design: Wireframe, sequence: PrintSequence, seed: int, start: CreepForecast | None) -> GrowingPrint:
    """A print whose twins are right; aimed where there is a forecast, else met where it is."""
    printing = GrowingPrint(design, sequence, dataclasses.replace(SETTINGS, variation=0.3), seed)
    plan = design.replace(printed=[False] * design.strut_count)
    forecast, targets = start, design.vertices
    for batch in range(sequence.batch_count):
        laying, rate = sequence.in_batch(batch), None
        if forecast is not None:
            plan = forecast.following(plan).aimed(sequence, batch, targets)
            forecast, targets = forecast.following(plan), plan.vertices
            rate = forecast.drift(laying)
        ahead = Anticipation.of(plan, laying, rate)
        printing.lay(batch, plan, laying, ahead.curves())
        real = printing.standing().frame
        twin = twin_at(real.vertices, real.control_points, completeness=real.printed.astype(float))
        asked = plan.replace(printed=sequence.laid_before(batch + 1, design.strut_count))
        seen = Observation.of(batch, asked, twin, struts=len(laying))
        there = real.printed_vertices()[:, None]
        plan = real.moved_to(np.where(there, real.vertices, plan.vertices if forecast else design.vertices))
        if forecast is not None:
            forecast = forecast.answered(laying, seen, plan)
    return printing


def test_an_aimed_print_ends_at_its_design(bridge: Wireframe, sequence: PrintSequence) -> None:
    plain = closed_loop(bridge, sequence, 100, None).report()
    aims = closed_loop(bridge, sequence, 100, CreepForecast.start(bridge)).report()
    assert aims.completed and aims.mean_deviation < 0.4 * plain.mean_deviation


def test_drift_is_told_of_joints_that_come_into_being(bridge: Wireframe, sequence: PrintSequence) -> None:
    fit = MaterialFit.start(CreepModel(bridge, SETTINGS), known(1.2, 600.0, 0.1, 0.1))
    plan = bridge.replace(printed=sequence.laid_before(4, bridge.strut_count))
    state = PrintState.before(plan, np.zeros(bridge.strut_count), 3000.0)
    laying = sequence.in_batch(4)
    rate = expected_drift(plan, fit, state, laying.struts)
    new = bridge.replace(printed=sequence.laid_before(5, bridge.strut_count)).printed_vertices() & ~state.there
    assert new.any() and (rate[new, 2] < 0.0).all() and not rate[bridge.grounded].any()
    ahead = Anticipation.of(plan, laying, rate)
    after = fit.model.after(state, laying.struts, fit.parameters, parts=3)
    np.testing.assert_allclose(ahead.frame(len(laying)).vertices[new], after.points[new], atol=1e-9)


# --- files and jobs


def test_materials_come_back_from_their_files(tmp_path: Path) -> None:
    estimate = dataclasses.replace(known(1.5, 700.0, 0.2, 0.3, error=0.11), prints=2)
    write_material(tmp_path / "material.json", estimate)
    again = read_material(tmp_path / "material.json")
    np.testing.assert_allclose(np.array(again.mean)[[0, 3, 4, 5]], np.array(estimate.mean)[[0, 3, 4, 5]])
    assert again.prints == 2 and again.mean[1:3] == (0.0, 0.0)
    assert for_next_print(read_usual(tmp_path / "material.json")).deviation[0] == pytest.approx(
        np.hypot(0.11, PRINT_TO_PRINT)
    )
    for name, wrong in (("weight", 3), ("rest", {"value": -1.0, "error": 0.1}), ("prints", 0), ("format", "x")):
        data = {**read_json(tmp_path / "material.json"), name: wrong}
        write_json(tmp_path / "wrong.json", data)
        with pytest.raises(InputError, match=name):
            read_material(tmp_path / "wrong.json")


def test_what_is_usual_is_the_mean_of_prints_that_tell_all_of_themselves() -> None:
    """As of numbers with a known spread: the mean, to within the spread over the root of their number."""
    rng, places = np.random.default_rng(2), [0, 3, 4, 5]
    own = rng.normal(size=(6, 5)) * 0.2
    wide = MaterialEstimate(GUESS.mean, (30.0, 0.1, 0.1, 30.0, 30.0, 30.0))
    before = wide
    for count in range(1, 6):
        found = known(*np.exp(own[[0, 3, 4, 5], count - 1]), error=1e-4)
        usual = usual_after(before, replace(found, prints=count))
        assert usual.prints == count
        np.testing.assert_allclose(np.array(usual.mean)[places], own[places, :count].mean(axis=1), atol=1e-3)
        np.testing.assert_allclose(np.array(usual.deviation)[places], ABOUT_USUAL / np.sqrt(count), rtol=1e-3)
        before = for_next_print(usual)


def test_a_print_that_tells_nothing_leaves_the_usual_as_it_was() -> None:
    before = for_next_print(known(1.5, 700.0, 0.2, 0.3, error=0.1))
    usual = usual_after(before, before)
    np.testing.assert_allclose(usual.mean, before.mean)
    np.testing.assert_allclose(np.array(usual.deviation)[[0, 3, 4, 5]], 0.1)


def test_the_usual_comes_back_from_its_file(tmp_path: Path) -> None:
    own, usual = known(1.5, 700.0, 0.2, 0.3, error=0.05), known(1.2, 600.0, 0.1, 0.2, error=0.15)
    write_material(tmp_path / "material.json", replace(own, prints=3), usual=usual)
    again = read_usual(tmp_path / "material.json")
    np.testing.assert_allclose(np.array(again.mean)[[0, 3, 4, 5]], np.array(usual.mean)[[0, 3, 4, 5]])
    assert again.prints == 3 and again.deviation[0] == 0.15
    data = read_json(tmp_path / "material.json")
    usual_gone, own_damaged = json.loads(json.dumps(data)), json.loads(json.dumps(data))
    del usual_gone["rest"]["usual"]
    own_damaged["rest"]["value"] = -0.1
    for wrong in (usual_gone, own_damaged):
        write_json(tmp_path / "wrong.json", wrong)
        with pytest.raises(InputError, match="rest"):
            read_usual(tmp_path / "wrong.json")


@pytest.fixture
def aiming(tmp_path: Path) -> PrintJob:
    return small_job(tmp_path / "job", tower(3), batch_size=8, compensate=True, formats=("json",))


def test_a_job_writes_what_it_learns_and_starts_with_what_another_has(aiming: PrintJob, tmp_path: Path) -> None:
    real = LeaningPrint(aiming.design, np.array([0.0, 0.0, -0.5]))
    for k in range(2):
        aiming.answer(real.take(tmp_path / f"capture{k}", print_batch(aiming, real)))
    told = read_material(aiming.folder)
    assert told.prints == 1 and told.deviation[0] < GUESS.deviation[0]
    other = small_job(tmp_path / "other", tower(3), batch_size=8, compensate=True, formats=("json",))
    assert other.settings.compensate and not (other.folder / "known.json").exists()


def test_a_job_that_is_opened_anew_goes_on_as_one_that_was_not(aiming: PrintJob, tmp_path: Path) -> None:
    real = LeaningPrint(aiming.design, np.array([0.2, 0.0, -0.4]))
    captures = []
    for k in range(3):
        captures.append(real.take(tmp_path / f"capture{k}", print_batch(aiming, real)))
        aiming.answer(captures[-1])
    small_job(tmp_path / "again" / "job", tower(3), batch_size=8, compensate=True, formats=("json",))
    for capture in captures:
        PrintJob(tmp_path / "again" / "job").answer(capture)
    for name in ("plan.json", "drift.json"):
        paths = [folder / "batches" / "003" / name for folder in (aiming.folder, tmp_path / "again" / "job")]
        assert [path.exists() for path in paths] in ([True, True], [False, False])
        if paths[0].exists():
            assert paths[0].read_bytes() == paths[1].read_bytes()
    assert fingerprint(aiming.batch_folder(3)) == fingerprint(tmp_path / "again" / "job" / "batches" / "003")


def test_jobs_of_before_keep_their_forecast(aiming: PrintJob) -> None:
    data = read_json(aiming.folder / JOB)
    assert data["settings"]["forecast"] == "creep"
    del data["settings"]["forecast"], data["hash"]
    write_json(aiming.folder / JOB, data)
    assert PrintJob(aiming.folder).settings.forecast == "linear"


# --- sizes of batches


def test_a_batch_is_cut_short_where_joints_drift_and_grows_where_they_stand(sequence: PrintSequence) -> None:
    assert suitable_size(12, 0.03) == 12
    assert suitable_size(12, 0.1) == 5 and suitable_size(12, 5.0) == 4 and suitable_size(3, 5.0) == 3
    assert suitable_size(12, 1e-3) == 24 and suitable_size(30, 0.0) == 30
    sizes = np.bincount(sequence.batch)
    for size in (2, int(sizes[3]), int(sizes[3] + 2), int(sizes[3:6].sum() + 1)):
        other = resized(sequence, 3, size)
        assert np.array_equal(other.struts, sequence.struts) and np.array_equal(other.start, sequence.start)
        assert np.array_equal(np.bincount(other.batch)[:4], [*sizes[:3], size])
        cuts, old = (set(np.flatnonzero(np.diff(one.batch)).tolist()) for one in (other, sequence))
        last = int(sizes[:3].sum() + size - 1)
        assert cuts - old <= {last}
        assert {cut for cut in old if cut > last} <= cuts
    assert resized(sequence, 3, int(sizes[3])) is sequence


def test_little_is_laid_at_once_while_nothing_is_known(bridge: Wireframe, sequence: PrintSequence) -> None:
    forecast = CreepForecast.start(bridge)
    size = len(sequence.in_batch(2))
    assert size > 4 and len(forecast.resized(sequence, 2).in_batch(2)) == 4


def test_a_batch_whose_own_joints_sag_is_not_made_longer(bridge: Wireframe, sequence: PrintSequence) -> None:
    """The first struts start from the plate, which does not move; where they end, the print goes down all the same."""
    soft = known(20.0, 600.0, 0.1, 0.1, error=1e-4)
    forecast = CreepForecast.start(bridge, soft)
    first = sequence.in_batch(0)
    assert bridge.grounded[first.start].all()
    assert len(forecast.resized(sequence, 0).in_batch(0)) <= len(first)
    stiff = CreepForecast.start(bridge, known(1e-4, 600.0, 0.1, 0.1, error=1e-4))
    assert len(stiff.resized(sequence, 0).in_batch(0)) > len(first)


# --- what cannot be printed


def gallows(length: float) -> tuple[Wireframe, PrintSequence]:
    """A short post with a long arm that hangs on it until the second post is there."""
    vertices = [[0, 0, 0], [0, 0, 20], [length, 0, 20], [length, 0, 0]]
    frame = Wireframe.create(vertices, [[0, 1], [1, 2], [3, 2]], radius=1.0, grounded=[True, False, False, True])
    axis = np.tile([0.0, 0.0, 1.0], (3, 1))
    return frame, PrintSequence(np.arange(3), np.array([0, 1, 3]), axis, np.arange(3))


def test_a_strut_that_would_sag_away_is_told_with_what_would_help(tmp_path: Path) -> None:
    soft = MaterialEstimate(known(1.0, 600.0, 0.1, 0.1).mean, GUESS.deviation, 1)
    assert _falls(30.0, soft) is None
    fall = _falls(120.0, soft)
    assert fall is not None and fall.strut == 1 and fall.batch == 1 and fall.reason == "sag"
    assert "half the speed" in fall.remedy
    worse = _falls(180.0, soft)
    assert worse is not None and "prop under joint 2" in worse.remedy
    write_material(tmp_path / "soft.json", soft)
    arm = gallows(180.0)[0].subset(np.array([True, True, False]))[0]
    with pytest.raises(InputError, match="strut 1 would sag away.*prop under joint 2"):
        plan_job(tmp_path / "job", arm, PlanOptions(allow_contact=True, batch_size=1), material=tmp_path / "soft.json")
    assert not (tmp_path / "job").exists()


def test_half_the_speed_is_a_remedy_that_can_be_taken(tmp_path: Path) -> None:
    """What is refused or warned of with that advice is planned by who takes it."""
    write_material(tmp_path / "soft.json", replace(known(1.0, 600.0, 0.1, 0.1, error=0.1), prints=1))
    arm = gallows(120.0)[0].subset(np.array([True, True, False]))[0]
    options = PlanOptions(allow_contact=True, batch_size=1)
    slow = replace(options, waypoints={"speed": 2.5})
    with pytest.raises(InputError, match="half the speed"):
        plan_job(tmp_path / "fast", arm, options, material=tmp_path / "soft.json")
    plan_job(tmp_path / "slow", arm, slow, material=tmp_path / "soft.json")
    warned, heeded = (guessed_outlook(plan_job(tmp_path / f"{k}", arm, one)) for k, one in enumerate((options, slow)))
    assert warned.typical is not None and "half the speed" in warned.typical.remedy and heeded.typical is None


def test_what_is_said_to_help_does_at_every_length() -> None:
    """At half the speed, and in a material that hardens in half the time, of which no refusal is left then."""
    material, quick = (known(1.3, seconds, 0.1, 0.1, error=0.1) for seconds in (600.0, 300.0))
    advised = []
    for length in np.linspace(40.0, 130.0, 19):
        arm = gallows(length)[0].subset(np.array([True, True, False]))[0]
        order = PrintSequence(np.arange(2), np.arange(2), np.tile([0.0, 0.0, 1.0], (2, 1)), np.zeros(2, dtype=int))
        try:
            require_standing(arm, order, material, compensate=True)
        except InputError as error:
            advised.append(str(error))
            if "half the speed" in str(error) and "prop" not in str(error):
                require_standing(arm, order, material, compensate=True, speed=2.5)
            if "half the time" in str(error) and "prop" not in str(error):
                require_standing(arm, order, quick, compensate=True)
    said = [("half the speed" in words, "prop" in words) for words in advised]
    assert {(True, False), (False, True)} <= set(said)


def test_a_bowl_that_would_lean_out_stands_where_it_is_aimed() -> None:
    """Unaimed, its lowest struts turn by more than 40 degrees under the rim; aimed, by less than half of that."""
    bowl = named_frame("half_bowl")
    sequence = lowest_first(bowl, 16)
    heavy = known(7.0, 400.0, 0.09, 0.066, error=0.1)
    with pytest.raises(InputError, match="cannot be printed like that"):
        require_standing(bowl, sequence, heavy)
    require_standing(bowl, sequence, heavy, compensate=True)


@pytest.mark.parametrize(("length", "stands"), [(10.0, (True, True)), (90.0, (True, False)), (180.0, (False, False))])
def test_an_outlook_without_a_known_material_has_its_error_bar(length: float, stands: tuple[bool, bool]) -> None:
    frame, sequence = gallows(length)
    batches = [sequence.struts[sequence.batch == batch] for batch in range(3)]
    told = outlook(CreepForecast.start(frame).fit, frame, batches)
    assert (told.typical is None, told.soft is None) == stands
    named = [fall.problem in told.sentence for fall in (told.typical, told.soft) if fall is not None]
    assert not named or any(named)
    if not all(stands):
        assert told.soft is not None and told.soft.strut == 1 and told.soft.batch == 1


def _falls(length: float, material: MaterialEstimate) -> Fall | None:
    frame, sequence = gallows(length)
    fit = CreepForecast.start(frame, material).fit
    return first_fall(fit, lambda _: frame, [sequence.struts[sequence.batch == batch] for batch in range(3)])


def test_a_forecast_of_a_frame_that_gives_way_stays_within_reason() -> None:
    """Weight without measure, and a strut that nothing holds up: no joint moves further than the extent."""
    frame = named_frame("bridge")
    model = CreepModel(frame, PrintSettings())
    count = frame.strut_count
    heavy = CreepParameters(1e9, 50.0, 0.05, 1.0, np.ones(count), np.zeros((count, 2)))
    state = PrintState.before(frame.replace(printed=[False] * count), np.zeros(count), 0.0)
    high = int(np.argmax(frame.vertices[frame.edges].min(axis=1)[:, 2]))
    after = model.after(state, np.array([high]), heavy)
    np.testing.assert_array_equal(after.points, state.points)  # it hangs in the air
    everything = model.after(state, np.arange(count), heavy)
    moved = np.linalg.norm(everything.points - state.points, axis=1)
    assert np.isfinite(everything.points).all() and 0.0 < moved.max() <= LARGEST_MOVE * frame.extent * (1.0 + 1e-9)
