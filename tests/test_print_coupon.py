"""Test coupons: struts that droop as far as they are made long for, out of the way, laid first, and not judged."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from print_physics import twin_at
from scipy.spatial import cKDTree
from small_frames import tower

from frametwin.cli.main import cli
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import largest_deviation
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.evidence import Evidence
from frametwin.printing.adaptation.material_file import read_material
from frametwin.printing.adaptation.material_fit import BatchRecord, MaterialFit
from frametwin.printing.job.guards import Expectation, GuardLimits, doubts_of_twin
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, guessed_outlook, plan_job
from frametwin.printing.process.coupon import DROOP, with_coupon
from frametwin.printing.process.creep import CreepModel, CreepParameters, PrintState
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence_file import write_sequence
from frametwin.printing.sequencing.given_order import GivenOrder
from frametwin.printing.simulation.growth import GrowingPrint
from frametwin.printing.simulation.simulate import SimulationOptions, simulate_print
from frametwin.printing.simulation.simulated_pictures import SimulatedRig

FRAMES = {"bridge": named_frame("bridge"), "half_bowl": named_frame("half_bowl"), "tower": tower(2)}


def coupon_of(frame: Wireframe, count: int) -> np.ndarray:
    return np.arange(frame.strut_count, frame.strut_count + count)


def parameters(design: Wireframe, weight: float = 1.0, rest: float = 1e-9) -> CreepParameters:
    count = design.strut_count
    return CreepParameters(weight, 600.0, rest, 1.0, np.ones(count), np.zeros((count, 2)))


@pytest.mark.parametrize("weight", [0.3, 1.0, 4.0])
def test_a_strut_droops_as_far_as_it_is_made_long_for(weight: float) -> None:
    frame = named_frame("bridge")
    design = with_coupon(frame, 4, weight, doubt=0.0)
    model = CreepModel(design, PrintSettings(seconds=(1e-3, 2e-3), pause=1e6))
    none = design.replace(printed=[False] * design.strut_count)
    before = PrintState.before(none, np.zeros(design.strut_count), 0.0)
    after = model.after(before, coupon_of(frame, 4), parameters(design, weight))
    tips = design.edges[coupon_of(frame, 4), 1]
    drooped = np.linalg.norm(after.points - before.points, axis=1)[tips]
    np.testing.assert_allclose(drooped, DROOP * design.lengths[coupon_of(frame, 4)], rtol=0.02)


def test_lengths_suit_heavier_and_lighter_materials_where_the_weight_is_not_known() -> None:
    frame = named_frame("bridge")
    for weight in (1.0, 3.0, 1.0 / 3.0):
        lengths = with_coupon(frame, 20, 1.0, doubt=1.2).lengths[-20:]
        wanted = with_coupon(frame, 1, weight, doubt=0.0).lengths[-1]
        assert lengths.min() < 1.01 * wanted and lengths.max() > 0.99 * wanted


@pytest.mark.parametrize("name", FRAMES)
@pytest.mark.parametrize("count", [1, 7, 20, 60])
def test_a_coupon_stands_around_the_frame_and_touches_nothing(name: str, count: int) -> None:
    frame = FRAMES[name]
    design = with_coupon(frame, count)
    assert np.array_equal(design.control_points[: frame.strut_count], frame.control_points)
    assert np.array_equal(design.vertices[: frame.vertex_count], frame.vertices)
    assert design.strut_count == frame.strut_count + count
    struts = coupon_of(frame, count)
    plate = frame.vertices[frame.grounded, 2].min()
    ends = design.vertices[design.edges[struts]]
    assert design.grounded[design.edges[struts]].tolist() == [[True, False]] * count
    assert (ends[:, 0, 2] == plate).all() and (ends[:, 1, 2] > plate).all()
    points = [bezier.evaluate(curve[None], np.linspace(0.0, 1.0, 40))[0] for curve in design.control_points]
    others, radius = np.concatenate(points[: frame.strut_count]), float(np.median(frame.radius))
    for number, strut in enumerate(struts):
        beside = np.concatenate([others, *(points[other] for other in struts if other != strut)])
        assert cKDTree(beside).query(points[strut])[0].min() > 5.0 * radius, number


def test_no_coupon_leaves_the_frame_as_it_is_and_none_stands_without_a_plate() -> None:
    frame = named_frame("bridge")
    assert with_coupon(frame, 0) is frame
    with pytest.raises(InputError, match="grounded"):
        with_coupon(frame.replace(grounded=[False] * frame.vertex_count), 3)


def test_vertices_that_no_strut_uses_are_no_plate() -> None:
    frame = named_frame("bridge")
    more = Wireframe.create(
        np.vstack([frame.vertices, [[0.0, 0.0, -100.0]]]),
        frame.edges,
        radius=frame.radius,
        grounded=[*frame.grounded, True],
        name="more",
    )
    feet = with_coupon(more, 3).vertices[-6::2]
    assert np.array_equal(feet, with_coupon(frame, 3).vertices[-6::2])
    with pytest.raises(InputError, match="nothing stands on the plate"):
        with_coupon(more.replace(grounded=[*[False] * frame.vertex_count, True]), 3)


def test_a_coupon_outside_of_the_workspace_is_named(tmp_path: Path) -> None:
    frame = named_frame("bridge")
    low, high = frame.bounds
    tight = (*(low - 2.0), *(high + 300.0))
    for base in (None, ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))):
        options = PlanOptions(coupon=8, allow_contact=True, workspace=tight, base=base)
        with pytest.raises(InputError, match=r"coupon: its struts around the frame reach [0-9.]+ mm outside"):
            plan_job(tmp_path / "job", frame, options)
    assert not (tmp_path / "job").exists()
    wide = (*(low - 300.0), *(high + 300.0))
    assert plan_job(tmp_path / "job", frame, replace(options, workspace=wide)).settings.coupon == 8


def test_a_frame_in_place_of_the_number_is_told_of(tmp_path: Path) -> None:
    command = ["print", "plan", "--coupon", "bridge.json", "--out", str(tmp_path / "job")]
    said = CliRunner().invoke(cli, command)
    assert said.exit_code == 2 and "'bridge.json' is no number" in said.output
    assert "1000" in CliRunner().invoke(cli, [*command[:2], "bridge", *command[4:], "--coupon", "5000"]).output


def test_it_is_laid_first_a_few_struts_at_a_time(tmp_path: Path) -> None:
    frame = named_frame("bridge")
    job = plan_job(tmp_path / "job", frame, PlanOptions(coupon=10, allow_contact=True))
    sequence = job.sequence_at(0)
    assert sorted(sequence.struts[:10]) == coupon_of(frame, 10).tolist()
    assert np.bincount(sequence.batch)[:3].tolist() == [4, 4, 2]
    laid = sequence.struts[10:]
    assert (np.diff(frame.batch[laid]) >= 0).all()  # the frame's own batches go on in their order
    assert PrintJob(tmp_path / "job").settings.of_frame(job.design).sum() == frame.strut_count


def test_an_order_for_the_frame_serves_with_a_coupon_too(tmp_path: Path) -> None:
    frame = tower(2)
    options = PlanOptions(allow_contact=True)
    plain = plan_job(tmp_path / "plain", frame, options).sequence_at(0)
    write_sequence(tmp_path / "order.json", plain)
    job = plan_job(tmp_path / "job", frame, replace(options, coupon=5), order=tmp_path / "order.json")
    sequence = job.sequence_at(0)
    assert np.array_equal(sequence.struts[5:], plain.struts) and np.array_equal(sequence.start[5:], plain.start)
    used = np.unique(frame.edges)
    kept = sequence.part(job.settings.of_frame(job.design), used)
    assert np.array_equal(kept.struts, plain.struts) and np.array_equal(kept.batch, plain.batch)
    kept.end_in(frame.subset(np.ones(frame.strut_count, dtype=bool))[0])


def test_a_job_with_more_of_it_than_there_are_struts_is_damaged(tmp_path: Path) -> None:
    job = plan_job(tmp_path / "job", named_frame("bridge"), PlanOptions(coupon=2, allow_contact=True))
    path = tmp_path / "job" / "job.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    del told["hash"]  # which would tell of the change, too
    for count, fits in ((job.design.strut_count - 1, True), (job.design.strut_count, False)):
        told["settings"]["coupon"] = count
        path.write_text(json.dumps(told), encoding="utf-8")
        if fits:
            assert PrintJob(tmp_path / "job").settings.of_frame(job.design).sum() == 1
        else:
            with pytest.raises(InputError, match=r"settings\.coupon: is [0-9]+, and there are only"):
                PrintJob(tmp_path / "job")


def test_orders_of_all_kinds_come_after_it() -> None:
    frame = with_coupon(tower(2), 3)
    first, rest = np.arange(24, 27), np.arange(24)
    walk = GivenOrder(rest[::-1], frame.edges[rest[::-1], 0]).after(frame, first, 2)
    assert walk.struts is not None and walk.start is not None and walk.batch is not None
    assert walk.struts.tolist() == [*first, *rest[::-1]] and frame.grounded[walk.start[:3]].all()
    assert walk.batch[first].tolist() == [0, 0, 1] and (walk.batch[rest] == 2).all()
    layers = GivenOrder(batch=np.where(rest < 5, 4, 7)).after(frame, first, 3)
    assert layers.batch is not None and layers.batch.tolist() == [1] * 5 + [4] * 19 + [0] * 3
    walk.check(frame)
    layers.check(frame)


def test_a_print_is_judged_without_it(tmp_path: Path) -> None:
    frame = tower(2)
    plan = PlanOptions(coupon=6, allow_contact=True, adapt=False)
    simulated = simulate_print(tmp_path / "job", frame, SimulationOptions(plan, PrintSettings(sag=0.02), seed=4))
    stands = simulated.standing.frame
    own = simulated.job.settings.of_frame(simulated.job.design)
    off = [
        largest_deviation(simulated.job.design.control_points[part], stands.control_points[part])
        for part in (own, ~own)
    ]
    assert off[0] == pytest.approx(simulated.report.e_max[-1], rel=1e-9) and simulated.report.completed
    assert off[1] > 1.5 * off[0]
    told = simulated.job.report(simulated.job.answered - 1)
    assert told["e_max"] == 0.0  # without twins, what stands is taken to be where it was planned
    alone = GrowingPrint(frame, simulated.job.sequence_at(0).part(own, np.unique(frame.edges)))
    assert simulated_scale(simulated.job, 4) == pytest.approx(alone.scale, rel=1e-9)


def simulated_scale(job: PrintJob, seed: int) -> float:
    return GrowingPrint(job.design, job.sequence_at(0), seed=seed, added=job.settings.coupon).scale


def test_a_strut_of_it_that_falls_over_does_not_mislead() -> None:
    frame = named_frame("bridge")
    design = with_coupon(frame, 8, doubt=0.0)
    struts = coupon_of(frame, 8)
    model = CreepModel(design, PrintSettings())
    none = design.replace(printed=[False] * design.strut_count)
    state = PrintState.before(none, np.zeros(design.strut_count), 0.0)
    after = model.after(state, struts, parameters(design, 1.3, rest=0.1), parts=3)
    moved = np.where(design.grounded[:, None], 0.0, after.points - state.points)
    known = np.zeros(design.vertex_count, dtype=bool)
    known[design.edges[struts, 1]] = True

    def told(moved: np.ndarray, known: np.ndarray) -> float:
        record = BatchRecord(state, struts, after.laid, moved, known)
        return MaterialFit.start(model).updated(record).parameters.weight

    fallen, tip = moved.copy(), int(design.edges[struts[0], 1])
    fallen[tip] += (0.6 * design.lengths[struts[0]]) * np.array([0.5, 0.0, -0.8])
    unseen = known.copy()
    unseen[tip] = False
    assert told(fallen, known) == pytest.approx(told(moved, unseen), rel=1e-12)
    assert told(moved, known) == pytest.approx(1.3, rel=0.1)


def test_it_tells_of_the_material_before_the_frame_is_begun(tmp_path: Path) -> None:
    frame = tower(2)
    plan = PlanOptions(coupon=12, allow_contact=True, reprint=True, formats=("json",))
    rig = SimulatedRig(size=(300, 400), views=6)
    settings = PrintSettings(variation=0.3)
    simulated = simulate_print(tmp_path / "job", frame, SimulationOptions(plan, settings, rig, seed=11))
    job, drawn = simulated.job, settings.of_print(11)
    after = read_material(job.batch_folder(2) / "material.json")  # three batches of four
    true = simulated_scale(job, 11) * drawn.flow / settings.flow
    assert abs(after.mean[0] - np.log(true)) < 3.0 * after.deviation[0] and after.deviation[0] < 0.5
    assert simulated.report.completed and simulated.report.e_max[-1] < 4.0


def test_whether_a_print_stands_is_told_of_the_frame_alone(tmp_path: Path) -> None:
    frame = tower(2)
    options = PlanOptions(allow_contact=True)
    plain = plan_job(tmp_path / "plain", frame, options)
    write_sequence(tmp_path / "order.json", plain.sequence)
    job = plan_job(tmp_path / "job", frame, replace(options, coupon=8), order=tmp_path / "order.json")
    assert guessed_outlook(job) == guessed_outlook(plain)


def test_a_coupon_that_droops_and_falls_holds_no_print(tmp_path: Path) -> None:
    frame = tower(2)
    job = plan_job(tmp_path / "job", frame, PlanOptions(coupon=4, allow_contact=True))
    design, sequence = job.design, job.sequence
    count, printed = design.strut_count, np.ones(design.strut_count, dtype=bool)
    vertices = np.array(design.vertices)
    tips = design.edges[coupon_of(frame, 4), 1]
    vertices[tips[:2], 2] -= 40.0
    standing = printed.copy()
    standing[-2:] = False
    twin = twin_at(vertices, design.moved_to(vertices).control_points, completeness=standing.astype(float))
    last = sequence.batch_count - 1
    stands, evidence = design.replace(printed=standing), Evidence(0.0, 0.0, 0.0, np.full(0, np.nan))
    kinds = [
        [doubt.kind for doubt in doubts_of_twin(expected, twin, stands, evidence, GuardLimits())]
        for expected in (Expectation(last, sequence, design.replace(printed=printed), coupon) for coupon in (4, 0))
    ]
    assert kinds[0] == [] and "displacement" in kinds[1] and count == 28
