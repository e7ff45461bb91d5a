"""Temporary supports: columns that stand clear of the frame, are printed in time, hold it up, and are not judged."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import cKDTree
from small_frames import tower

from frametwin.cli.main import cli
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import largest_deviation
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.check import check_job
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.process.supports import supportable, supported_sequence, with_supports
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.records.sequence_file import write_sequence
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.sequencing.supporting import supports_for
from frametwin.printing.simulation.growth import GrowingPrint
from frametwin.printing.simulation.simulate import SimulationOptions, simulate_print
from frametwin.printing.simulation.simulated_pictures import SimulatedRig

FRAMES = {name: named_frame(name) for name in ("bridge", "half_bowl")}


def arm(length: float = 60.0) -> Wireframe:
    """A post with an arm of three struts, each 20 mm above the plate."""
    along = np.linspace(0.0, length, 4)
    vertices = [[0.0, 0.0, 0.0], *([x, 0.0, 40.0] for x in along)]
    return Wireframe.create(vertices, [[0, 1], [1, 2], [2, 3], [3, 4]], radius=1.0, name="arm")


@pytest.mark.parametrize("name", FRAMES)
def test_columns_stand_upright_below_their_joints_and_clear_of_everything_else(name: str) -> None:
    frame = FRAMES[name]
    joints = np.flatnonzero(supportable(frame))
    assert len(joints)
    for joint in joints.tolist():
        design = with_supports(frame, [joint])
        assert np.array_equal(design.control_points[: frame.strut_count], frame.control_points)
        assert np.array_equal(design.vertices[: frame.vertex_count], frame.vertices)
        pieces = design.edges[frame.strut_count :]
        assert pieces[-1, 1] == joint and design.grounded[pieces[0, 0]]
        ends = design.vertices[pieces]
        np.testing.assert_allclose(ends[..., :2], np.broadcast_to(frame.vertices[joint, :2], ends[..., :2].shape))
        assert ends[0, 0, 2] == pytest.approx(frame.vertices[frame.grounded, 2].min())
        np.testing.assert_array_equal(ends[1:, 0], ends[:-1, 1])
        others = frame.control_points[~(frame.edges == joint).any(axis=1)]
        steel = bezier.evaluate(design.control_points[frame.strut_count :], np.linspace(0.0, 1.0, 101)).reshape(-1, 3)
        apart, _ = cKDTree(bezier.evaluate(others, np.linspace(0.0, 1.0, 101)).reshape(-1, 3)).query(steel)
        assert apart.min() > 3.0 * float(np.median(frame.radius))


def test_what_stands_under_a_joint_leaves_no_room_for_a_column() -> None:
    assert not supportable(tower(2)).any()  # posts go down from every joint, to the next one
    assert supportable(arm()).nonzero()[0].tolist() == [2, 3, 4]
    assert supportable(arm(), [3]).nonzero()[0].tolist() == [2, 4]
    above = Wireframe.create(
        [*arm().vertices, [20.0, -30.0, 20.0], [20.0, 30.0, 20.0], [0.0, -30.0, 0.0], [0.0, 30.0, 0.0]],
        [*arm().edges, [5, 6], [5, 7], [6, 8]],
        radius=1.0,
    )
    assert 2 not in supportable(above).nonzero()[0]  # a strut passes below


def test_columns_keep_clear_of_bent_thick_and_long_struts() -> None:
    frame = arm(100.0)
    foot = frame.vertex_count
    assert supportable(frame)[4]

    def with_strut(
        ends: list[list[float]], curve: list[list[float]] | None, radius: float, top: int | None
    ) -> Wireframe:
        vertices = [*frame.vertices, *ends]
        edges = [*frame.edges, [foot, foot + 1 if top is None else top]]
        curves = np.concatenate([frame.control_points, bezier.straight(np.array(ends[:1]), np.array(ends[-1:]))])
        if curve is not None:
            curves[-1] = curve
        radii = [*frame.radius, radius]
        return Wireframe.create(vertices, edges, control_points=curves, radius=radii, name="arm")

    tip = [100.0, 0.0, 40.0]
    bent = [[150.0, 0.0, 0.0], [100.0, 0.0, 2.0], [100.0, 0.0, 15.0], tip]  # straight down from the tip at first
    assert not supportable(with_strut(bent[:1], bent, 1.0, 4))[4]
    beside = [[100.0, 4.5, 0.0], [100.0, 4.5, 20.0]]
    assert supportable(with_strut(beside, None, 1.0, None))[4]
    assert not supportable(with_strut(beside, None, 3.6, None))[4]  # its surface is as near as the other's axis
    below = [[100.0, -290.0, 5.0], [100.0, 310.0, 30.0]]
    assert not supportable(with_strut(below, None, 1.0, None))[4]


def test_the_longer_of_two_arms_is_held_first() -> None:
    reach = [0.0, 20.0, 40.0, 60.0, -20.0, -40.0]
    vertices = [[0.0, 0.0, 0.0], *([x, 0.0, 40.0] for x in reach)]
    edges = [[0, 1], [1, 2], [2, 3], [3, 4], [1, 5], [5, 6]]
    frame = Wireframe.create(vertices, edges, radius=1.0)
    start = np.array([0, 1, 2, 3, 1, 5])
    sequence = PrintSequence(np.arange(6), start, np.tile([0.0, 0.0, 1.0], (6, 1)), np.arange(6))
    first, *others = supports_for(frame, sequence, 9)
    assert first in (2, 3, 4) and {5, 6} & set(others)
    assert supports_for(frame, sequence, 1) == [first]


def test_a_frame_that_stands_by_itself_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="tower: supports: no joint has room for a column"):
        plan_job(tmp_path / "job", tower(2), PlanOptions(supports=2, allow_contact=True))
    assert not (tmp_path / "job").exists()


def test_why_nothing_is_supported_is_told() -> None:
    sequence = PrintSequence(np.arange(4), np.arange(4), np.tile([0.0, 0.0, 1.0], (4, 1)), np.arange(4))
    with pytest.raises(InputError, match="tool cannot get past a column"):
        supports_for(arm(), sequence, 2, lambda frame, order: False)
    assert supports_for(arm(), sequence, 0) == []
    floating = arm().replace(grounded=[False] * 5)
    with pytest.raises(InputError, match="nothing stands on the plate"):
        supportable(floating)


@pytest.mark.parametrize("coupon", [0, 5])
def test_the_order_of_the_frame_stays_and_a_column_is_ready_when_its_joint_comes(tmp_path: Path, coupon: int) -> None:
    frame = FRAMES["bridge"]
    options = PlanOptions(allow_contact=True)
    plain = plan_job(tmp_path / "plain", frame, options).sequence_at(0)
    write_sequence(tmp_path / "order.json", plain)
    for order in (None, tmp_path / "order.json"):
        wanted = replace(options, supports=3, coupon=coupon)
        job = plan_job(tmp_path / "job", frame, wanted, order=order, overwrite=True)
        own, sequence = job.settings.of_frame(job.design), job.sequence_at(0)
        assert own.sum() == frame.strut_count and job.settings.coupon == coupon and job.settings.support_struts >= 3
        kept = sequence.part(own, np.arange(frame.vertex_count))
        assert np.array_equal(kept.struts, plain.struts) and np.array_equal(kept.start, plain.start)
        assert np.array_equal(kept.batch, plain.batch)
        there = job.design.grounded.copy()
        for strut, start, end in zip(sequence.struts, sequence.start, sequence.end_in(job.design), strict=True):
            assert there[start]
            if frame.strut_count <= strut < frame.strut_count + job.settings.support_struts:
                assert job.design.vertices[start, 2] < job.design.vertices[end, 2]  # upwards, from the plate
                assert there[end] == (end < frame.vertex_count)  # the frame has come to its joint by then
            there[end] = True


def test_a_print_sags_less_on_columns_and_is_judged_without_them() -> None:
    frame = FRAMES["bridge"]
    sequence = plan_sequence(frame, OrderSettings(allow_contact=True))
    alone = printed(frame, sequence, 0)
    joints = supports_for(frame, sequence, 4)
    design = with_supports(frame, joints)
    more = design.strut_count - frame.strut_count
    held = printed(design, supported_sequence(sequence, design, frame.strut_count), more)
    assert held.scale == pytest.approx(alone.scale, rel=1e-12)
    assert alone.report().completed and held.report().completed
    assert held.report().e_max[-1] < 0.5 * alone.report().e_max[-1]
    stands = held.standing().frame.control_points[: frame.strut_count]
    assert held.report().e_max[-1] == pytest.approx(largest_deviation(frame.control_points, stands), rel=1e-9)


def printed(design: Wireframe, sequence: PrintSequence, added: int) -> GrowingPrint:
    """A print of a design as it is planned."""
    grown = GrowingPrint(design, sequence, PrintSettings(sag=0.01), seed=3, added=added)
    for batch in range(sequence.batch_count):
        grown.lay(batch, design)
    return grown


def test_a_simulated_print_with_both_is_completed_and_goes_on_where_it_was(tmp_path: Path) -> None:
    frame = FRAMES["bridge"]
    plan = PlanOptions(supports=2, coupon=4, allow_contact=True, reprint=True, formats=("json",))
    options = SimulationOptions(plan, PrintSettings(variation=0.3), SimulatedRig(size=(300, 400), views=6), seed=5)
    simulated = simulate_print(tmp_path / "job", frame, options)
    assert simulated.report.completed
    job = PrintJob(tmp_path / "job")
    found = job.adapted(job.answered - 1).control_points[: frame.strut_count]
    told = job.report(job.answered - 1)["e_max"]
    assert told == pytest.approx(largest_deviation(frame.control_points, found), rel=1e-6)
    again = simulate_print(tmp_path / "job", frame, options)
    assert again.report.e_max == simulated.report.e_max


def test_the_tool_keeps_clear_of_columns(tmp_path: Path) -> None:
    job = plan_job(tmp_path / "job", FRAMES["bridge"], PlanOptions(supports=2))
    assert job.waypoint_summary(0)["contacts"] == [] and check_job(job).fine


def test_columns_are_told_of(tmp_path: Path) -> None:
    command = [
        "print",
        "plan",
        "bridge",
        "--out",
        str(tmp_path / "job"),
        "--supports",
        "2",
        "--allow-contact",
        "--quiet",
    ]
    data = json.loads(CliRunner().invoke(cli, [*command, "--json"]).output)
    assert len(data["supported"]) == 2 and data["support_struts"] >= 2
    said = CliRunner().invoke(cli, [*command, "--overwrite"]).output
    assert f"columns below joints {data['supported'][0]} and {data['supported'][1]};" in " ".join(said.split())
    many = CliRunner().invoke(cli, [*command[:-3], "60", *command[-2:], "--overwrite"]).output
    assert re.search(r"below joints [0-9, and]+ \([0-9]+ of 60: no further one helps\)", " ".join(many.split()))


def test_jobs_from_before_there_were_supports_have_none(tmp_path: Path) -> None:
    plan_job(tmp_path / "job", tower(2), PlanOptions(allow_contact=True))
    path = tmp_path / "job" / "job.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    assert told["settings"].pop("support_struts") == 0
    del told["hash"]
    path.write_text(json.dumps(told), encoding="utf-8")
    assert PrintJob(tmp_path / "job").settings.support_struts == 0
    told["settings"]["support_struts"] = 24
    path.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(InputError, match=r"settings\.support_struts: is 24, and there are only 24 struts"):
        PrintJob(tmp_path / "job")
