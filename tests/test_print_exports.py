"""What is written for robots and other programs reads back as what was meant."""

from __future__ import annotations

import dataclasses
import json
import sys
from ast import literal_eval
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.errors import InputError
from frametwin.files import dump_json
from frametwin.formats import read_frame
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.toolpath.exports import SUFFIXES, read_waypoints, write_waypoints
from frametwin.printing.toolpath.exports.assembly import write_assembly
from frametwin.printing.toolpath.exports.compas import read_compas_frames
from frametwin.printing.toolpath.exports.gcode import FILAMENT, read_gcode
from frametwin.printing.toolpath.exports.urscript import read_urscript
from frametwin.printing.toolpath.reach import (
    check_reach,
    frames_for_compas_fab,
    unreachable,
    unreachable_by_compas_fab,
    within_reach,
)
from frametwin.printing.toolpath.robot_files import RobotSettings
from frametwin.printing.toolpath.ur_arms import ARMS, Arm
from frametwin.printing.toolpath.waypoints import APPROACH, PRINT, Waypoints, waypoints_of
from frametwin.printing.toolpath.workspace import Workspace

METRE = 1e-6 * 1000.0  # mm


@pytest.fixture(scope="module")
def points() -> Waypoints:
    """Waypoints in the upper half of a tower, with tilted tools among them."""
    frame = tower()
    sequence = plan_sequence(frame, OrderSettings(batch_size=12))
    points = waypoints_of(frame, sequence, 1)
    assert np.ptp(points.axis, axis=0).max() > 0.2
    return points


@pytest.fixture(scope="module")
def limits(points: Waypoints) -> Workspace:
    """The print stands turned and shifted before the robot."""
    base = np.eye(4)
    base[:3, :3] = Rotation.from_euler("z", 35.0, degrees=True).as_matrix()
    base[:3, 3] = [500.0, -120.0, 40.0]
    return Workspace([400.0, -250.0, 39.0], [600.0, 0.0, 250.0], base, max_speed=100.0)


def test_json_reads_back_bit_for_bit(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    back = read_waypoints(write_waypoints(tmp_path / "w.json", points, "json", limits))
    for field in dataclasses.fields(points):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(points, field.name))


def test_urscript_reads_back(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    program = read_urscript(write_waypoints(tmp_path / "w.script", points, "urscript", limits))
    expected = points.position @ limits.base[:3, :3].T + limits.base[:3, 3]
    assert np.abs(program.position - expected).max() < METRE
    turn = Rotation.from_matrix(limits.base[:3, :3]) * Rotation.from_matrix(points.rotation)
    assert (Rotation.from_rotvec(program.rotation_vector).inv() * turn).magnitude().max() < 1e-6
    np.testing.assert_allclose(program.speed, points.speed, atol=1e-3)
    assert (program.speed <= points.speed + 1e-9).all()
    np.testing.assert_array_equal(program.extrude, points.extrude)
    np.testing.assert_allclose(program.dwell, points.dwell, atol=1e-3)


def test_urscript_stops_only_at_the_ends_of_struts(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    blend = read_urscript(write_waypoints(tmp_path / "w.script", points, "urscript", limits)).blend
    way = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    assert (blend[1:] + blend[:-1] <= way).all()  # neighbours' blends do not overlap
    for strut in points.struts:
        printed = np.flatnonzero((points.strut == strut) & (points.kind == PRINT))
        assert (blend[printed[:-1]] > 0.0).all() and blend[printed[-1]] == 0.0
    assert (blend[(points.kind != PRINT) | (points.dwell > 0.0)] == 0.0).all()
    assert (blend > 0.0).sum() > len(points.struts)


def test_gcode_reads_back(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    moves = read_gcode(write_waypoints(tmp_path / "w.gcode", points, "gcode", limits))
    expected = points.position @ limits.base[:3, :3].T + limits.base[:3, 3]
    assert np.abs(moves.position - expected).max() < METRE
    np.testing.assert_allclose(moves.axis, points.axis @ limits.base[:3, :3].T, atol=1e-8)
    np.testing.assert_allclose(moves.speed, points.speed, atol=1e-4)
    np.testing.assert_allclose(moves.dwell, points.dwell, atol=1e-3)
    np.testing.assert_array_equal(moves.extrusion > 0.0, points.kind == PRINT)
    length = sum(
        np.linalg.norm(
            np.diff(points.position[(points.strut == s) & np.isin(points.kind, (APPROACH, PRINT))], axis=0), axis=1
        ).sum()
        for s in points.struts
    )
    assert moves.extrusion.sum() * np.pi * (FILAMENT / 2.0) ** 2 == pytest.approx(length * np.pi * 1.0**2, rel=1e-5)


def test_compas_reads_back(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    path = write_waypoints(tmp_path / "w.json", points, "compas", limits)
    place, turn = read_compas_frames(path)
    expected = points.position @ limits.base[:3, :3].T + limits.base[:3, 3]
    assert np.abs(place - expected / 1000.0).max() < 1e-6
    np.testing.assert_allclose(turn, limits.base[:3, :3] @ points.rotation, atol=1e-9)


def test_compas_graph_is_what_compas_expects(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    """As its Graph of version 2 takes it: keys are literals, every node has a row of edges."""
    data = json.loads(write_waypoints(tmp_path / "w.json", points, "compas", limits).read_text())["graph"]
    assert data["dtype"] == "compas.datastructures/Graph"
    graph = data["data"]
    needed = {"attributes", "default_node_attributes", "default_edge_attributes", "node", "edge", "max_node"}
    assert set(graph) == needed
    nodes = {literal_eval(key) for key in graph["node"]}
    assert nodes == set(range(graph["max_node"] + 1)) == {literal_eval(key) for key in graph["edge"]}
    laid = {
        edge["strut"]: (graph["node"][u], graph["node"][v])
        for u, row in graph["edge"].items()
        for v, edge in row.items()
    }
    assert sorted(laid) == sorted(points.struts.tolist())
    used = {vertex for strut in points.struts.tolist() for vertex in tower().edges[strut].tolist()}
    assert len(nodes) == len(used)


def test_assembly_reads_back_with_its_batches(tmp_path: Path) -> None:
    frame = tower(3)
    frame = frame.replace(radius=np.full(frame.strut_count, 0.7))
    sequence = plan_sequence(frame, OrderSettings(batch_size=9))
    write_assembly(tmp_path / "a.json", frame, sequence)
    back = read_frame(tmp_path / "a.json")
    assert np.abs(back.vertices - frame.vertices).max() < METRE
    np.testing.assert_allclose(back.radius, 0.7, atol=METRE)
    np.testing.assert_array_equal(back.grounded, frame.grounded)
    np.testing.assert_array_equal(back.batch[sequence.struts], sequence.batch)
    np.testing.assert_array_equal(back.edges[sequence.struts, 0], sequence.start)
    np.testing.assert_array_equal(np.sort(back.edges), np.sort(frame.edges))


@pytest.mark.parametrize("name", list(SUFFIXES))
def test_nothing_outside_of_the_limits_is_written(
    tmp_path: Path, points: Waypoints, limits: Workspace, name: str
) -> None:
    """One waypoint of the travel above the print is a micrometre too high."""
    top = float((points.position @ limits.base[:3, :3].T + limits.base[:3, 3])[:, 2].max())
    low = dataclasses.replace(limits, upper=[*limits.upper[:2], top - 1e-3])
    slow = dataclasses.replace(limits, max_speed=59.9)
    for tight in (low, slow):
        with pytest.raises(InputError, match=r"waypoint \d+ \(travel"):
            write_waypoints(tmp_path / "w", points, name, tight)
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_are_refused(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    path = write_waypoints(tmp_path / "w.json", points, "json", limits)
    data = json.loads(path.read_text())
    for change in ({"version": 2}, {"kind": ["jump"]}, {"position": [[0.0, 0.0]]}, {"speed": [1.0]}, {"contacts": 3}):
        path.write_text(json.dumps(data | change))
        with pytest.raises(InputError, match=str(path)):
            read_waypoints(path)
    for suffix, read in (("script", read_urscript), ("gcode", read_gcode)):
        bad = tmp_path / f"bad.{suffix}"
        bad.write_text("movej([0,0,0])\n")
        with pytest.raises(InputError, match="line 1"):
            read(bad)
    with pytest.raises(InputError, match="'stl' is unknown"):
        write_waypoints(tmp_path / "w.stl", points, "stl", limits)


ARM = ARMS["ur10e"]


@pytest.mark.parametrize("arm", ARMS.values(), ids=list(ARMS))
def test_every_pose_of_an_arm_is_within_its_reach_and_none_beyond(arm: Arm) -> None:
    rng = np.random.default_rng(0)
    poses = np.array([arm.flange(q) for q in rng.uniform(-np.pi, np.pi, size=(500, 6))])
    assert within_reach(arm, poses[:, :3, 3], poses[:, :3, :3]).all()
    wrist, shoulder = poses[:, :3, 3] - arm.d6 * poses[:, :3, 2], np.array([0.0, 0.0, arm.d1])
    away = wrist - shoulder
    span = np.hypot(arm.a2 + arm.a3 + arm.d5, arm.d4)  # further than links can span
    away *= (1.001 * span / np.linalg.norm(away, axis=1))[:, None]
    assert not within_reach(arm, shoulder + away + arm.d6 * poses[:, :3, 2], poses[:, :3, :3]).any()
    column = away * [0.0, 0.0, 0.2] + [0.9 * arm.d4, 0.0, arm.d1]  # the wrist inside of the cylinder about the axis
    assert not within_reach(arm, column + arm.d6 * poses[:, :3, 2], poses[:, :3, :3]).any()


def test_reach_of_waypoints(points: Waypoints, limits: Workspace) -> None:
    assert len(unreachable(points, limits, ARM, 150.0)) == 0
    far = dataclasses.replace(limits, base=np.eye(4) + 3000.0 * np.eye(4, k=3))
    assert len(unreachable(points, far, ARM, 150.0)) == len(points)


def test_flanges_are_handed_to_compas_fab_as_it_has_them() -> None:
    """Its UR10eKinematics().forward of these joints, version 2.0.1."""
    pose = ARM.flange(np.array([0.3, -1.0, 1.2, -0.4, 0.9, 0.2]))
    point, axes = frames_for_compas_fab(pose[None, :3, 3], pose[None, :3, :3])
    np.testing.assert_allclose(point[0], [0.886749, 0.532431, 0.483397], atol=1e-6)
    np.testing.assert_allclose(axes[0][:, :2].T, [[0.550, 0.821, 0.156], [0.835, -0.545, -0.074]], atol=6e-4)
    assert np.linalg.det(axes[0]) == pytest.approx(1.0)


def test_compas_fab_agrees_where_it_is_installed(points: Waypoints, limits: Workspace) -> None:
    if find_spec("compas_fab") is None:
        with pytest.raises(InputError, match="compas_fab: is not installed"):
            unreachable_by_compas_fab(points, limits, ARM, 150.0)
        assert check_reach(points, limits, ARM, 150.0) == "built-in"
        return
    for away in np.linspace(0.0, 1200.0, 7):  # from where all can be reached to where nothing can
        base = limits.base.copy()
        base[0, 3] += away
        there = dataclasses.replace(limits, base=base)
        theirs = unreachable_by_compas_fab(points, there, ARM, 150.0).tolist()
        assert theirs == unreachable(points, there, ARM, 150.0).tolist()
    assert check_reach(points, limits, ARM, 150.0) == "compas_fab"


def test_a_compas_fab_that_is_broken_is_not_taken_for_none(
    points: Waypoints, limits: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] in ("compas", "compas_fab")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("compas", "compas_fab"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('of another Python')")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match=r"compas_fab: cannot be imported \(of another Python\)"):
        check_reach(points, limits, ARM, 150.0)


def test_what_the_arm_cannot_reach_is_not_written(tmp_path: Path) -> None:
    options = {"allow_contact": True, "robot": "ur10e", "tool": 150.0, "max_tilt_deg": 30.0}
    near = tuple(map(tuple, np.eye(4) + 600.0 * np.eye(4, k=3)))
    job = plan_job(tmp_path / "near", tower(), PlanOptions(base=near, **options))
    assert job.waypoint_summary(0)["reach"] == ("built-in" if find_spec("compas_fab") is None else "compas_fab")
    assert PrintJob(job.folder).settings.robot.tool == 150.0
    far = tuple(map(tuple, np.eye(4) + 1800.0 * np.eye(4, k=3)))
    with pytest.raises(InputError, match=r"batch 0: waypoint \d+ \(.*strut \d+\): is out of a UR10e's reach"):
        plan_job(tmp_path / "far", tower(), PlanOptions(base=far, **options))
    assert not (tmp_path / "far").exists()


def test_jobs_of_before_there_were_several_arms_are_read() -> None:
    robot = RobotSettings(Workspace([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]), arm="ur5e", tool=90.0)
    again = RobotSettings.from_dict(json.loads(dump_json(robot.as_dict())), "job.json")
    assert (again.arm, again.tool) == ("ur5e", 90.0)
    for tool, arm in ((150.0, "ur10e"), (None, None)):
        old = json.loads(dump_json(robot.as_dict()))
        del old["arm"], old["tool"]
        found = RobotSettings.from_dict({**old, "ur10e_tool": tool}, "job.json")
        assert (found.arm, found.tool) == (arm, tool)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"robot": "ur5e"}, "tool: is missing for the UR5e"),
        ({"tool": 100.0}, "robot: is missing for the tool"),
        ({"robot": "kr10", "tool": 100.0}, "robot: .*kr10"),
        ({"robot": "ur5e", "tool": -1.0}, "tool: "),
    ],
)
def test_an_arm_needs_a_tool_and_a_tool_an_arm(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PlanOptions(**settings)
