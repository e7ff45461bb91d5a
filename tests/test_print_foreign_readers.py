"""What is written for robots, read by programs of others: COMPAS, the kinematics of compas_fab, a parser of G-code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from print_cases import turned_workspace
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.toolpath.exports import write_waypoints
from frametwin.printing.toolpath.reach import frames_for_compas_fab, within_reach
from frametwin.printing.toolpath.ur_arms import ARMS, Arm
from frametwin.printing.toolpath.waypoints import KINDS, PRINT, Waypoints, waypoints_of
from frametwin.printing.toolpath.workspace import Workspace

FILAMENT = 1.75
"""mm, the usual diameter, which the documentation of the G-code names."""

METRES = 1e-3


@pytest.fixture(scope="module")
def printed() -> tuple[Wireframe, PrintSequence]:
    frame = tower(curved=True)
    return frame, plan_sequence(frame, OrderSettings(batch_size=12, allow_contact=True))


@pytest.fixture(scope="module")
def points(printed: tuple[Wireframe, PrintSequence]) -> Waypoints:
    """Waypoints in the upper half of a tower, with tilted tools among them."""
    frame, sequence = printed
    points = waypoints_of(frame, sequence, 1, design=frame)
    assert np.ptp(points.axis, axis=0).max() > 0.2
    return points


@pytest.fixture(scope="module")
def limits() -> Workspace:
    return turned_workspace()


def in_base(points: Waypoints, limits: Workspace) -> np.ndarray:
    return points.position @ limits.base[:3, :3].T + limits.base[:3, 3]


# --- COMPAS


def test_compas_reads_a_frame_for_every_waypoint(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    compas = pytest.importorskip("compas", reason="compas is not installed")
    geometry = pytest.importorskip("compas.geometry")
    data: dict[str, Any] = compas.json_load(str(write_waypoints(tmp_path / "w.json", points, "compas", limits)))
    frames = data["frames"]
    assert all(isinstance(frame, geometry.Frame) for frame in frames) and data["unit"] == "m"
    np.testing.assert_allclose([list(f.point) for f in frames], METRES * in_base(points, limits), atol=1e-9)
    axes = np.array([[list(f.xaxis), list(f.yaxis), list(f.zaxis)] for f in frames])  # rows, of a right-handed frame
    np.testing.assert_allclose(np.swapaxes(axes, 1, 2), limits.base[:3, :3] @ points.rotation, atol=1e-9)
    np.testing.assert_allclose(data["speed"], METRES * points.speed)
    np.testing.assert_allclose(data["dwell"], points.dwell)
    assert data["extrude"] == points.extrude.tolist() and data["strut"] == points.strut.tolist()
    assert [KINDS.index(kind) for kind in data["kind"]] == points.kind.tolist()


def test_compas_reads_the_struts_as_a_graph(
    tmp_path: Path, printed: tuple[Wireframe, PrintSequence], points: Waypoints, limits: Workspace
) -> None:
    """Its edges are the struts of the batch in their order and direction; struts that meet share a node."""
    compas = pytest.importorskip("compas", reason="compas is not installed")
    frame, sequence = printed
    graph = compas.json_load(str(write_waypoints(tmp_path / "w.json", points, "compas", limits)))["graph"]
    laid = sorted(graph.edges(data=True), key=lambda edge: edge[1]["order"])
    part = sequence.in_batch(1)
    assert [attributes["strut"] for _, attributes in laid] == part.struts.tolist()
    joints = np.stack([part.start, part.end_in(frame)], axis=1)
    for ends, (nodes, _) in zip(joints, laid, strict=True):
        where = frame.vertices[ends] @ limits.base[:3, :3].T + limits.base[:3, 3]
        np.testing.assert_allclose([graph.node_coordinates(node) for node in nodes], METRES * where, atol=1e-9)
    assert graph.number_of_nodes() == len(np.unique(joints))
    assert graph.number_of_edges() == len(part)


# --- the arm


IN_COMPAS_FAB = ("UR3", "UR3e", "UR5", "UR5e", "UR10", "UR10e")


@pytest.fixture(scope="module", params=list(ARMS))
def arm(request: pytest.FixtureRequest) -> Arm:
    return ARMS[request.param]


@pytest.fixture(scope="module")
def solver(arm: Arm) -> Any:
    """compas_fab's own kinematics of an arm; its general one with the project's lengths where it has not the arm."""
    solvers = pytest.importorskip("compas_fab.backends.kinematics.solvers", reason="compas_fab is not installed")
    metres = METRES * np.array([arm.d1, -arm.a2, -arm.a3, arm.d4, arm.d5, arm.d6])
    if arm.name not in IN_COMPAS_FAB:
        return solvers.offset_wrist_kinematics.OffsetWristKinematics(metres.tolist())
    own = getattr(solvers, f"{arm.name}Kinematics")()
    np.testing.assert_allclose(own.params, metres, atol=1e-12)
    return own


def test_both_arms_stand_the_same_in_hundreds_of_poses(arm: Arm, solver: Any) -> None:
    for joints in np.random.default_rng(0).uniform(-np.pi, np.pi, size=(100, 6)):
        pose = arm.flange(joints)
        point, axes = frames_for_compas_fab(pose[None, :3, 3], pose[None, :3, :3])
        theirs = solver.forward(joints.tolist())
        np.testing.assert_allclose(list(theirs.point), point[0], atol=1e-9)
        np.testing.assert_allclose([list(theirs.xaxis), list(theirs.yaxis)], axes[0].T[:2], atol=1e-9)


def test_reach_in_closed_form_is_that_of_compas_fab(arm: Arm, solver: Any) -> None:
    """Random flanges in a ball that the arm fills in part; where there are solutions, the arm goes there."""
    from compas.geometry import Frame

    rng, count = np.random.default_rng(1), 800 if arm.name == "UR10e" else 200
    span = arm.a2 + arm.a3 + arm.d4 + arm.d5 + arm.d6
    position = rng.normal(size=(count, 3))
    position *= (1.07 * span * rng.random(count) ** (1.0 / 3.0) / np.linalg.norm(position, axis=1))[:, None]
    rotation = Rotation.random(count, random_state=1).as_matrix()
    ours = within_reach(arm, position, rotation)
    assert count / 6 < ours.sum() < 5 * count / 6
    for n, (point, axes) in enumerate(zip(*frames_for_compas_fab(position, rotation), strict=True)):
        try:
            solutions = solver.inverse(Frame(point.tolist(), axes[:, 0].tolist(), axes[:, 1].tolist()))
        except ValueError:
            solutions = []
        found = [np.array(joints) for joints in solutions if joints is not None]
        assert bool(found) == ours[n]
        for joints in found:
            pose = arm.flange(joints)
            np.testing.assert_allclose(pose[:3, 3], position[n], atol=1e-6)
            np.testing.assert_allclose(pose[:3, :3], rotation[n], atol=1e-9)


# --- G-code


def test_a_public_parser_reads_the_gcode(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    """A machine that does what it reads goes where the waypoints are, as fast, and lays strands of their thickness."""
    parser = pytest.importorskip("gcodeparser", reason="gcodeparser is not installed")
    text = write_waypoints(tmp_path / "w.gcode", points, "gcode", limits).read_text()
    modes: list[str] = []
    moves: list[tuple[str, dict[str, float]]] = []
    dwell: list[float] = []
    for line in parser.parse_gcode_lines(text, include_comments=False):
        if line.command_str in ("G0", "G1"):
            moves.append((line.command_str, line.params))
            dwell.append(0.0)
        elif line.command_str == "G4":
            dwell[-1] += line.params["P"] / 1000.0
        else:
            assert not moves
            modes.append(line.command_str)
    assert {"G21", "G90", "M83"} <= set(modes)  # mm, absolute positions, relative extrusion
    position = np.array([[params[axis] for axis in "XYZ"] for _, params in moves])
    np.testing.assert_allclose(position, in_base(points, limits), atol=1e-6)
    feed = np.array([params["F"] for _, params in moves])
    np.testing.assert_allclose(feed / 60.0, points.speed, atol=1e-4)
    assert (feed / 60.0 <= points.speed + 1e-9).all()
    np.testing.assert_allclose(dwell, points.dwell, atol=5e-4)
    flows = points.kind == PRINT
    assert [command for command, _ in moves] == np.where(flows, "G1", "G0").tolist()
    pushed = np.array([params.get("E", 0.0) for _, params in moves])
    way = np.linalg.norm(np.diff(points.position, axis=0, prepend=points.position[:1]), axis=1)
    strand = np.where(flows, way * points.radius**2 / (FILAMENT / 2.0) ** 2, 0.0)
    np.testing.assert_allclose(pushed, strand, atol=1e-6)
