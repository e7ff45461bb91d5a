"""``frametwin print check``: sound jobs pass, and every fault that is planted in one is named."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_tools import done, refused, run
from print_cases import LeaningPrint, fingerprint, print_batch, small_job
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.errors import Cancelled, InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.check import check_job
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.job.second_look import StandingPoints, tool_balls
from frametwin.printing.job.sign_off import sign_off
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.toolpath.exports import SUFFIXES
from frametwin.printing.toolpath.robot_files import waypoint_file
from frametwin.printing.toolpath.tool_path import read_tool_path
from frametwin.progress import Progress

BASE = ((0.0, -1.0, 0.0, 500.0), (1.0, 0.0, 0.0, -120.0), (0.0, 0.0, 1.0, 40.0), (0.0, 0.0, 0.0, 1.0))


@pytest.fixture
def job(tmp_path: Path) -> PrintJob:
    """A tower, turned and shifted before the robot, in every format."""
    options = PlanOptions(batch_size=8, formats=tuple(SUFFIXES), base=BASE, robot="ur10e", tool=150.0)
    return plan_job(tmp_path / "job", tower(), options)


def waypoints(job: PrintJob) -> Path:
    return job.batch_folder(0) / "waypoints" / waypoint_file(0, "json")


def change(job: PrintJob, edit: Callable[[dict[str, Any]], None]) -> None:
    """Edit the first batch's waypoints by hand."""
    path = waypoints(job)
    data = json.loads(path.read_text())
    edit(data)
    path.write_text(json.dumps(data))


def printed_rows(data: dict[str, Any], place: int) -> tuple[int, int]:
    """First and last waypoint of one of the struts that are laid."""
    strut = data["strut"]
    struts = list(dict.fromkeys(strut))
    rows = [n for n, kind in enumerate(data["kind"]) if strut[n] == struts[place] and kind in ("approach", "print")]
    return rows[0], rows[-1]


def test_a_sound_job_passes_and_is_left_alone(job: PrintJob) -> None:
    before = fingerprint(job.folder)
    found = check_job(job)
    assert found.fine and found.batches == (0,)
    data = json.loads(waypoints(job).read_text())
    assert found.waypoints == len(data["position"]) and found.poses > 3 * found.waypoints
    assert fingerprint(job.folder) == before


def test_every_format_tells_the_same_way(job: PrintJob) -> None:
    paths = [
        read_tool_path(waypoints(job).parent / waypoint_file(0, name), name, job.settings.robot.workspace)
        for name in SUFFIXES
    ]
    for path in paths[1:]:
        np.testing.assert_allclose(path.position, paths[0].position, atol=2e-6)
        np.testing.assert_allclose(path.axis, paths[0].axis, atol=1e-6)
        np.testing.assert_allclose(path.speed, paths[0].speed, atol=2e-3)
        assert path.extrude.tolist() == paths[0].extrude.tolist()
        assert len(path.strut_runs()) == 8
        np.testing.assert_allclose(np.linalg.det(path.rotation), 1.0)


def test_poses_between_waypoints_are_close_and_end_on_them(job: PrintJob) -> None:
    path = read_tool_path(waypoints(job), "json", job.settings.robot.workspace)
    last = len(path.position) - 1
    tip, axis = path.poses(0, last, 0.4)
    assert np.linalg.norm(np.diff(tip, axis=0), axis=1).max() <= 0.4 + 1e-9
    assert (axis[1:] * axis[:-1]).sum(axis=1).min() > np.cos(np.radians(1.01))
    np.testing.assert_allclose(tip[[0, -1]], path.position[[0, last]])
    np.testing.assert_allclose(axis[[0, -1]], path.axis[[0, last]], atol=1e-12)
    away = np.linalg.norm(path.position[:, None] - tip, axis=2).min(axis=1)
    assert away.max() < 1e-9


def test_an_answered_job_passes_at_every_batch(tmp_path: Path) -> None:
    """The plan has moved with a print that leans, and is expected to go on."""
    job, real = small_job(tmp_path / "job", tower(), formats=("json", "gcode")), LeaningPrint(tower())
    for batch in range(2):
        job.answer(real.take(tmp_path / f"capture{batch}", print_batch(job, real)))
    assert np.abs(job.plan(2).vertices - job.design.vertices).max() > 1.0
    found = check_job(job)
    assert [str(fault) for fault in found.faults] == [] and found.batches == (0, 1, 2)
    assert check_job(job, 1).batches == (1,)
    with pytest.raises(InputError, match="batch: 3 has no waypoints"):
        check_job(job, 3)


# --- planted faults


def test_a_waypoint_outside_of_the_workspace_or_too_fast_is_named(job: PrintJob) -> None:
    def edit(data: dict[str, Any]) -> None:
        data["position"][0][2] = 2000.0
        data["speed"][2] = 900.0
        data["speed"][3] = 0.0

    change(job, edit)
    found = check_job(job)
    said = [str(fault) for fault in found.faults]
    assert {"workspace", "speed", "file", "reach"} <= {fault.kind for fault in found.faults}
    assert any(
        ", strut " in line and ": waypoint 0 is " in line and "outside of the workspace" in line for line in said
    )
    assert any("waypoint 2 is reached 650 mm/s too fast" in line for line in said)
    assert any("waypoint 3 has no speed" in line for line in said)


def test_a_tool_that_leans_too_far_is_named(job: PrintJob) -> None:
    def edit(data: dict[str, Any]) -> None:
        lean = Rotation.from_euler("y", 70.0, degrees=True).as_matrix() @ np.diag([1.0, -1.0, -1.0])
        data["rotation"][0] = lean.tolist()

    change(job, edit)
    (tilt,) = (fault for fault in check_job(job).faults if fault.kind == "tilt")
    assert "leans 10 degrees too far at waypoint 0" in str(tilt)


def test_a_strut_that_is_laid_beside_its_joint_is_named(job: PrintJob) -> None:
    strut = int(job.sequence.struts[3])

    def edit(data: dict[str, Any]) -> None:
        first, last = printed_rows(data, 3)
        for n in range(first, last + 1):
            data["position"][n][0] += 0.8

    change(job, edit)
    said = {fault.kind: str(fault) for fault in check_job(job).faults if fault.strut == strut}
    assert said["start"] == f"batch 0, strut {strut}: it begins 0.8 mm beside its joint"
    assert "path" in said


def test_a_strut_that_is_not_laid_is_missed(job: PrintJob) -> None:
    def edit(data: dict[str, Any]) -> None:
        first, last = printed_rows(data, 5)
        data["extrude"][first : last + 1] = [False] * (last + 1 - first)

    change(job, edit)
    said = [str(fault) for fault in check_job(job).faults]
    assert "batch 0: its waypoints lay 7 struts where the batch has 8" in said


def test_a_way_through_the_print_is_a_collision_and_one_through_the_plate_too(job: PrintJob) -> None:
    """The tool crosses the print at half the height of a strut that stands, and dips below the plate beside it."""
    first = int(job.sequence.struts[0])
    middle = job.design.control_points[first].mean(axis=0)

    def edit(data: dict[str, Any]) -> None:
        _, last = printed_rows(data, 6)
        data["position"][last + 2] = middle.tolist()
        data["position"][last + 3][2] = -30.0

    change(job, edit)
    faults = [fault for fault in check_job(job).faults if fault.kind in ("collision", "plate")]
    assert any(first in fault.others and fault.depth > 1.0 for fault in faults)
    assert any(fault.kind == "plate" and fault.depth > 25.0 for fault in faults)


def test_files_that_contradict_each_other_are_named(job: PrintJob) -> None:
    path = waypoints(job).parent / waypoint_file(0, "gcode")
    text = path.read_text()
    move = next(line for line in text.splitlines() if line.startswith("G1"))
    path.write_text(text.replace(move, move.replace("G1 X", "G1 X1"), 1))
    found = {fault.problem for fault in check_job(job).faults if fault.kind == "file"}
    assert found == {"its gcode file has other positions than another one"}


@pytest.mark.parametrize(
    ("format", "line", "other", "said"),
    [
        ("json", r'"dwell": \[0\.0', '"dwell": [7.0', "has other pauses than another one"),
        ("gcode", r"G4 P2000", "G4 P0", "the tool waits 0 s at waypoint .* where 2 were asked for"),
        (
            "urscript",
            r"r=0\.00\d*",
            "r=0.040",
            "its urscript file blends 40 mm at waypoint 3 where 0.[0-9]* are the most",
        ),
        (
            "rapid",
            r"fine(?=.*\n *SetDO ft_extruder, 0)",
            "[FALSE,9.000,9.000,9.000,0.100,9.000,0.100]",
            "its rapid file blends 9 mm",
        ),
        ("krl", r"CDIS = \d\.\d*", "CDIS = 60.000", "its krl file blends 60 mm"),
        ("gcode", r" E(?=\d+\.)", " E1", "its gcode file pushes .* mm of filament where it takes"),
    ],
)
def test_a_file_that_pauses_blends_or_pushes_otherwise_is_named(
    job: PrintJob, format: str, line: str, other: str, said: str
) -> None:
    path = waypoints(job).parent / waypoint_file(0, format)
    text = path.read_text()
    path.write_text(re.sub(line, other, text, count=1))
    assert path.read_text() != text
    assert any(re.search(said, str(fault)) for fault in check_job(job, 0).faults)


def test_a_strut_at_another_speed_than_asked_for_is_named(job: PrintJob) -> None:
    """Well within what the robot may do, in every file, and still not what the print is made for."""
    job = plan_job(job.folder.parent / "one", tower(), PlanOptions(batch_size=8, formats=("json",)))

    def edit(data: dict[str, Any]) -> None:
        first, last = printed_rows(data, 2)
        data["speed"][first + 1 : last + 1] = [80.0] * (last - first)

    change(job, edit)
    (fault,) = check_job(job, 0).faults
    assert fault.kind == "speed" and "it is laid at 80 mm/s where 5 were asked for" in str(fault)


@pytest.mark.parametrize("fault", ["leave out", "go back", "begins on it", "ends on it"])
def test_a_way_that_lays_half_a_strut_or_lays_it_twice_or_stays_is_named(tmp_path: Path, fault: str) -> None:
    """A strut that ends in the air, whose end no joint tells."""
    job = plan_job(tmp_path / "job", tower(), PlanOptions(batch_size=1, formats=("json",)))

    def edit(data: dict[str, Any]) -> None:
        first, last = printed_rows(data, 0)
        rows = {
            "leave out": slice(last - 4, last),
            "begins on it": slice(0, first),
            "ends on it": slice(last + 1, None),
        }
        if fault == "go back":
            data["position"][last - 2] = data["position"][last - 8]
            return
        if fault == "leave out":
            data["position"][last] = data["position"][last - 4]
        for key in ("position", "rotation", "speed", "extrude", "dwell", "kind", "strut", "deviation", "radius"):
            del data[key][rows[fault]]

    change(job, edit)
    said = [str(found) for found in check_job(job, 0).faults]
    words = fault.replace("go back", "mm back over")
    assert said and all(line.startswith("batch 0, strut ") for line in said) and any(words in line for line in said)


def test_the_whole_plan_as_an_assembly_is_beside_the_waypoints(tmp_path: Path) -> None:
    job = plan_job(tmp_path / "job", tower(), PlanOptions(batch_size=8, formats=("json", "assembly")))
    found = check_job(job, 0)
    (look,) = found.looks
    (told,) = (line.told for line in sign_off(job, found).lines if line.name == "files")
    assert "assembly" not in told  # which has no waypoints to compare
    assert set(look.files) == {"batch_000.json", "batch_000_assembly.json"} == set(job.waypoint_summary(0)["files"])


@pytest.mark.parametrize(
    ("format", "line", "other", "said"),
    [
        ("urscript", r"(?s).*", "", "holds no moves"),
        ("urscript", r"(?s)\nend\n.*", "\n", "has no line 'end' in its place"),
        ("urscript", r"end\n.*\n", "end\n", r"has no line 'NAME\(\)' in its place"),
        ("urscript", r"  sleep", "  powerdown()\n  sleep", r"'powerdown\(\)' is not understood"),
        ("urscript", r"out\(0, True\)", "out(5, True)", r"'set_standard_digital_out\(5, True\)' is not understood"),
        ("urscript", r"a=0\.5", "a=50", "is not understood"),
        ("rapid", r"ENDPROC\n", "", "has no line 'ENDPROC' in its place"),
        ("rapid", r"ENDMODULE\n", "ENDMODULE\nENDMODULE\n", "has a line 'ENDMODULE' too many"),
        ("krl", r"BAS\(#TOOL, 1\)\n", "", r"has no line 'BAS\(#TOOL, 1\)' in its place"),
        ("gcode", r"M83\n", "", "does not set M83 before its first move"),
        ("gcode", r"(?s)G0.*", "", "holds no moves"),
    ],
)
def test_a_program_that_is_not_whole_is_refused(job: PrintJob, format: str, line: str, other: str, said: str) -> None:
    path = waypoints(job).parent / waypoint_file(0, format)
    path.write_text(re.sub(line, other, path.read_text(), count=1))
    with pytest.raises(InputError, match=said):
        check_job(job, 0)


def test_an_order_that_cannot_be_printed_is_found(tmp_path: Path) -> None:
    """PrintJob.create takes any order; the waypoints of its first batch alone are planned with it."""
    good = plan_job(tmp_path / "good", tower(), PlanOptions(batch_size=8, allow_contact=True))
    sequence = good.sequence
    turned = PrintSequence(sequence.struts[::-1], sequence.start[::-1], sequence.axis[::-1], sequence.batch)
    job = PrintJob.create(tmp_path / "bad", good.design, turned, good.settings)
    faults = check_job(job).faults
    assert {"in the air", "collision"} <= {fault.kind for fault in faults if fault.batch is None}
    first = int(turned.struts[0])
    assert any(fault.kind == "in the air" and fault.strut == first for fault in faults if fault.batch == 0)


def test_contacts_that_were_allowed_are_those_that_are_found(tmp_path: Path) -> None:
    job = plan_job(tmp_path / "job", tower(), PlanOptions(batch_size=24, max_tilt_deg=0.0, allow_contact=True))
    contacts = job.waypoint_summary(0)["contacts"]
    told = {int(sentence.split()[1].rstrip(":")) for sentence in contacts}
    found = {fault.strut for fault in check_job(job).faults if fault.batch == 0}
    assert told and told == found


def test_a_strut_that_begins_where_no_material_is_is_named(job: PrintJob) -> None:
    """The whole strut is laid three diameters beside its place, where nothing stands."""
    place = next(n for n in range(8) if not job.design.grounded[job.sequence.start[n]])
    strut = int(job.sequence.struts[place])

    def edit(data: dict[str, Any]) -> None:
        low, high = printed_rows(data, place)
        for n in range(low, high + 1):
            data["position"][n][0] += 6.0 * job.design.radius[strut]
            data["position"][n][1] += 6.0 * job.design.radius[strut]

    change(job, edit)
    said = [str(fault) for fault in check_job(job).faults if fault.kind == "gap"]
    assert any(line.startswith(f"batch 0, strut {strut}: it begins ") for line in said)


def test_a_frame_whose_feet_are_in_the_air_is_refused_and_thin_struts_on_the_plate_are_not(tmp_path: Path) -> None:
    """A tower that hangs by its upper corners, and one leg that is thinner than most of its struts."""
    frame = tower()
    top = frame.vertices[:, 2] == frame.vertices[:, 2].max()
    with pytest.raises(InputError, match=r"grounded: joints .*, said to stand on the plate, are up to .* mm above it"):
        plan_job(tmp_path / "hanging", frame.replace(grounded=top))
    assert not (tmp_path / "hanging").exists()
    corners = [[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [60.0, 60.0, 0.0], [0.0, 60.0, 0.0], [30.0, 30.0, 50.0]]
    pyramid = Wireframe.create(corners, [[k, 4] for k in range(4)], radius=[0.8, 2.0, 2.0, 2.0])
    assert check_job(plan_job(tmp_path / "thin", pyramid)).fine


def test_a_strut_that_lies_in_another_one_is_refused(tmp_path: Path) -> None:
    """A leg that is there twice, the other way round and between joints of its own."""
    frame = tower()
    a, b = frame.vertices[frame.edges[5]]
    vertices, edges = (
        [*frame.vertices, b + 0.01, a + 0.01],
        [*frame.edges, [frame.vertex_count, frame.vertex_count + 1]],
    )
    twice = Wireframe.create(vertices, edges, radius=1.0)
    with pytest.raises(
        InputError, match=f"strut {frame.strut_count} lies in strut 5, between joints at the same places"
    ):
        plan_job(tmp_path / "job", twice)


def test_radii_in_another_unit_than_the_joints_are_refused(tmp_path: Path) -> None:
    frame = tower()
    with pytest.raises(InputError, match="radius: of strut [0-9]+ is 0.001 mm.*in the unit of the joints"):
        plan_job(tmp_path / "job", frame.replace(radius=[0.001] * frame.strut_count))
    assert not (tmp_path / "job").exists()


def test_a_tiny_print_is_sound_although_gcode_has_few_digits(tmp_path: Path) -> None:
    frame = tower()
    tiny = Wireframe.create(1e-2 * frame.vertices, frame.edges, radius=1e-2 * frame.radius, grounded=frame.grounded)
    assert check_job(plan_job(tmp_path / "job", tiny, PlanOptions(batch_size=4)), 0).fine


def test_every_fault_of_a_waypoint_names_the_strut_that_is_laid_there(job: PrintJob) -> None:
    struts = job.sequence.in_batch(0).struts.tolist()
    for place in (2, 5):

        def edit(data: dict[str, Any], place: int = place) -> None:
            low, high = printed_rows(data, place)
            data["speed"][high] = 900.0

        data = waypoints(job).read_bytes()
        change(job, edit)
        faults = [fault for fault in check_job(job, 0).faults if fault.kind == "speed"]
        assert {fault.strut for fault in faults} == {struts[place]} and faults[0].waypoint is not None
        waypoints(job).write_bytes(data)


# --- the second look


def test_balls_fill_the_tool_and_stay_inside() -> None:
    nozzle = Nozzle.fitting(tower())
    height, radius = tool_balls(nozzle)
    centres = np.stack([np.zeros_like(height), np.zeros_like(height), height], axis=1)
    rng = np.random.default_rng(2)
    ways = rng.normal(size=(400, 1, 3))
    shells = centres + radius[:, None] * ways / np.linalg.norm(ways, axis=2, keepdims=True)
    assert nozzle.distance(shells).max() < 1e-9
    along = rng.uniform(0.0, nozzle.cone_length, 500)
    slope = (nozzle.cone_radius - nozzle.tip_radius) / nozzle.cone_length
    points = np.stack([0.7 * (nozzle.tip_radius + slope * along), np.zeros(500), along], axis=1)
    covered = (np.linalg.norm(points[:, None] - centres, axis=2) <= radius).any(axis=1)
    assert covered[along > nozzle.tip_radius].mean() > 0.95


def test_the_least_air_is_that_of_a_rod_beside_the_tool() -> None:
    """An upright rod beside an upright tool's body, and one joined to what is laid, which the bead forgives."""
    nozzle = replace(Nozzle.fitting(tower()), bead=3.0)
    x = nozzle.body_radius + 5.0
    rods = np.array([[[x, 0.0, 0.0], [x, 0.0, 30.0], [x, 0.0, 60.0], [x, 0.0, 400.0]]])
    there = StandingPoints(rods, np.array([1.0]), np.array([7]))
    found = there.nearest(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), nozzle, np.array([False]))
    assert found.strut == 7 and found.air == pytest.approx(4.0, abs=0.05)
    lying = bezier.straight(np.array([[0.0, 0.0, 0.0]]), np.array([[2.5, 0.0, 0.0]]))
    beside = StandingPoints(lying, np.array([1.0]), np.array([3]))
    pose = (np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), nozzle)
    assert beside.nearest(*pose, np.array([True])).strut == -1
    assert beside.nearest(*pose, np.array([False])).air < 0.0
    assert beside.gap_to(np.array([5.5, 0.0, 0.0])) == pytest.approx([2.0])


def test_the_second_look_alone_finds_a_way_through_the_print(job: PrintJob, monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the first check blind, collisions would still be found."""
    monkeypatch.setattr(
        "frametwin.printing.job.check.collision_depths", lambda struts, *_: np.zeros((1, len(struts.radius)))
    )
    assert check_job(job).fine
    first = int(job.sequence.struts[0])
    middle = job.design.control_points[first].mean(axis=0)

    def edit(data: dict[str, Any]) -> None:
        _, last = printed_rows(data, 6)
        data["position"][last + 2] = middle.tolist()

    change(job, edit)
    (fault,) = (fault for fault in check_job(job, 0).faults if fault.kind == "collision")
    assert "as the second look alone has found" in str(fault) and fault.depth > 1.0
    assert fault.strut in job.sequence.struts[6:8]


# --- the page


def test_the_page_tells_every_check_and_what_is_left_to_each_limit(job: PrintJob, tmp_path: Path) -> None:
    page = sign_off(job, check_job(job))
    lines = {line.name: line for line in page.lines}
    assert all(line.result == "pass" for line in page.lines) and page.verdict.startswith("sound")
    path = read_tool_path(waypoints(job), "json", job.settings.robot.workspace)
    (look,) = page.check.looks
    assert look.fastest == path.speed.max() and look.struts == tuple(job.sequence.in_batch(0).struts.tolist())
    summary = job.waypoint_summary(0)
    assert look.length == pytest.approx(job.design.lengths[list(look.struts)].sum())
    assert look.seconds == pytest.approx(summary["seconds"], rel=1e-3)
    where = path.position @ np.array(BASE)[:3, :3].T + np.array(BASE)[:3, 3]
    np.testing.assert_allclose(look.lower, where.min(axis=0))
    assert "mm of air where it is least: batch 0, strut" in lines["collisions"].told and look.air > 0.0
    done("print", "check", job.folder, "--quiet", "--out", tmp_path / "check.html")
    text = (tmp_path / "check.html").read_text()
    assert text.count("<td>pass") == len(page.lines) and "Signature" in text and "http" not in text
    change(job, lambda data: data["position"].__setitem__(0, [0.0, 0.0, 5000.0]))
    bad = run("print", "check", job.folder, "--quiet", "--out", tmp_path / "check.json")
    data = json.loads((tmp_path / "check.json").read_text())
    assert bad.exit_code == 1 and data["format"] == "frametwin-print-check" and not data["fine"]
    assert {line["name"] for line in data["lines"] if line["result"] == "FAIL"} >= {"workspace", "files"}
    assert "NOT to be printed as it is" in bad.stdout
    assert "give a name that does" in refused("print", "check", job.folder, "--out", tmp_path / "check.pdf")


# --- the command


def test_the_command_tells_by_its_exit_code(job: PrintJob, tmp_path: Path) -> None:
    text = done("print", "check", job.folder, "--quiet").stdout
    assert text.startswith(f"All is well with {job.folder}: the order and the ")
    data = json.loads(done("print", "check", job.folder, "--json", "--quiet").stdout)
    assert data["fine"] is True and data["faults"] == [] and data["batches"] == [0]
    change(job, lambda data: data["position"].__setitem__(0, [0.0, 0.0, 5000.0]))
    bad = run("print", "check", job.folder, "--quiet")
    first = int(job.sequence.struts[0])
    assert (
        bad.exit_code == 1
        and f"  - batch 0, strut {first}: waypoint 0 is " in bad.stdout
        and "Traceback" not in bad.stderr
    )
    machine = run("print", "check", job.folder, "--quiet", "--json", "--batch", "0")
    faults = json.loads(machine.stdout)["faults"]
    assert machine.exit_code == 1 and "workspace" in {fault["kind"] for fault in faults}
    assert all(fault["sentence"].startswith("batch 0") for fault in faults)
    assert "is no print job" in refused("print", "check", tmp_path)
    waypoints(job).unlink()
    assert waypoint_file(0, "json") in refused("print", "check", job.folder, "--quiet")


def test_settings_that_were_changed_are_told_and_those_of_older_jobs_are_unverified(job: PrintJob) -> None:
    path = job.folder / "job.json"
    planned = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(planned), encoding="utf-8")  # the same, laid out otherwise
    assert json.loads(done("print", "check", job.folder, "--json", "--quiet").stdout)["settings_verified"] is True
    for place in (("waypoints", "speed"), ("nozzle", "cone_length"), ("workspace", "max_speed")):
        changed = json.loads(json.dumps(planned))
        robot = changed["settings"]["robot"]
        inside = robot["waypoints"]["nozzle"] if place[0] == "nozzle" else robot[place[0]]
        inside[place[1]] *= 1.5
        path.write_text(json.dumps(changed), encoding="utf-8")
        assert "job.json: file: is not as the job was planned" in refused("print", "check", job.folder, "--quiet")
    changed.pop("hash")
    path.write_text(json.dumps(changed), encoding="utf-8")
    older = PrintJob(job.folder)
    lines = {line.name: line for line in sign_off(older, check_job(older, batch=0)).lines}
    assert lines["settings"].result == "not looked at" and "unverified" in lines["settings"].told


def test_a_check_can_be_cancelled(job: PrintJob) -> None:
    stages = []

    def stop_at_the_waypoints(progress: Progress) -> bool:
        stages.append(progress.stage)
        return progress.stage != "checking waypoints"

    with pytest.raises(Cancelled):
        check_job(job, progress=stop_at_the_waypoints)
    assert "checking the order for collisions" in stages
