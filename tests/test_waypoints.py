"""Waypoints: on the struts, clear of the print on the way, and never outside of the workspace."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp
from small_frames import tower

from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.toolpath.keep_out import tool_rotations
from frametwin.printing.toolpath.waypoints import APPROACH, PRINT, RETREAT, Waypoints, WaypointSettings, waypoints_of
from frametwin.printing.toolpath.workspace import Workspace

BOWL = Path(__file__).resolve().parents[1] / "datasets" / "frames" / "half_bowl.json"


@pytest.fixture(scope="module")
def bowl() -> tuple[Wireframe, PrintSequence]:
    frame = read_frame(BOWL)
    return frame, plan_sequence(frame)


def test_waypoints_lie_on_their_struts(bowl: tuple[Wireframe, PrintSequence]) -> None:
    frame, sequence = bowl
    batch = 3
    points = waypoints_of(frame, sequence, batch, WaypointSettings(spacing=2.0))
    part = sequence.in_batch(batch)
    assert points.struts.tolist() == part.struts.tolist()
    for strut, curve, axis in zip(part.struts.tolist(), part.directed_curves(frame), part.axis, strict=True):
        rows = np.flatnonzero((points.strut == strut) & np.isin(points.kind, (APPROACH, PRINT)))
        np.testing.assert_allclose(points.position[rows[[0, -1]]], curve[[0, 3]], atol=1e-12)
        fine = bezier.evaluate(curve, np.linspace(0.0, 1.0, 4001))
        away = np.linalg.norm(points.position[rows][:, None] - fine, axis=2).min(axis=1)
        assert away.max() < 0.01
        assert np.linalg.norm(np.diff(points.position[rows], axis=0), axis=1).max() < 2.1
        np.testing.assert_allclose(points.axis[rows], np.broadcast_to(axis, (len(rows), 3)), atol=1e-12)
        assert points.extrude[rows].tolist() == [True] * (len(rows) - 1) + [False]
        retreat = points.position[rows[-1] + 1] - points.position[rows[-1]]
        assert points.kind[rows[-1] + 1] == RETREAT
        assert retreat @ axis == pytest.approx(np.linalg.norm(retreat))
    assert not points.extrude[~np.isin(points.kind, (APPROACH, PRINT))].any()
    assert not points.deviation.any()
    assert points.contacts == ()


def test_the_way_between_struts_is_clear(bowl: tuple[Wireframe, PrintSequence]) -> None:
    """Finely sampled poses of all moves off the struts touch nothing that stands, the last strut included."""
    frame, sequence = bowl
    nozzle, checked = Nozzle.fitting(frame), 0
    for batch in (2, sequence.batch_count - 1):
        points = waypoints_of(frame, sequence, batch)
        standing = np.isin(np.arange(frame.strut_count), sequence.struts[sequence.batch < batch])
        for a in range(len(points) - 1):
            b = a + 1
            if points.strut[a] >= 0 and points.kind[a] == RETREAT:
                standing[points.strut[a]] = True
            if points.kind[b] == PRINT:
                continue
            rods = bezier.evaluate(frame.control_points[standing], np.linspace(0.0, 1.0, 25)).reshape(-1, 3)
            thick = np.repeat(frame.radius[standing], 25)
            turns = Slerp([0.0, 1.0], Rotation.from_matrix(points.rotation[[a, b]]))
            for s in np.linspace(0.0, 1.0, 9):
                tip = (1.0 - s) * points.position[a] + s * points.position[b]
                seen = (rods - tip) @ turns(s).as_matrix()
                gap = nozzle.distance(seen * [1.0, 1.0, -1.0]) - thick
                free = np.linalg.norm(seen, axis=1) > nozzle.bead
                assert gap[free].min(initial=np.inf) > 0.0
                checked += free.any()
    assert checked > 500


def test_tool_frames_lean_no_further_between_two_waypoints() -> None:
    rng = np.random.default_rng(4)
    tilt, turn = rng.uniform(0.0, 1.2, 40), rng.uniform(0.0, 2.0 * np.pi, 40)
    axes = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=1)
    frames = tool_rotations(axes)
    np.testing.assert_allclose(frames[:, :, 2], -axes, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0)
    # The roll is that of the smallest turn from the vertical, whatever its axis.
    smallest = np.stack(
        [np.cross([0.0, 0.0, 1.0], a) / max(np.linalg.norm(np.cross([0.0, 0.0, 1.0], a)), 1e-12) for a in axes]
    )
    wanted = Rotation.from_rotvec(smallest * tilt[:, None]).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(frames, wanted, atol=1e-9)
    for a, b in zip(range(39), range(1, 40), strict=True):
        between = Slerp([0.0, 1.0], Rotation.from_matrix(frames[[a, b]]))(np.linspace(0.0, 1.0, 21)).as_matrix()
        assert np.arccos(-between[:, 2, 2]).max() <= max(tilt[a], tilt[b]) + 1e-9


def test_deviation_is_counted_from_the_design(bowl: tuple[Wireframe, PrintSequence]) -> None:
    frame, sequence = bowl
    matrix = np.eye(4)
    matrix[:3, 3] = [0.3, 0.0, 0.4]
    points = waypoints_of(frame.transformed(matrix), sequence, 1, design=frame)
    on_strut = np.isin(points.kind, (APPROACH, PRINT))
    np.testing.assert_allclose(points.deviation[on_strut], 0.5, atol=1e-9)
    assert not points.deviation[~on_strut].any()


def test_axes_are_looked_at_again_on_the_plan() -> None:
    """A printed neighbour that has bent into the tool's way: another axis is found, and none for an upright tool."""
    vertices = [[0, 0, 0], [0, 0, 30], [30, 0, 0], [30, 0, 30]]
    frame = Wireframe.create(vertices, [[2, 3], [0, 1]], radius=1.0)
    up = np.array([0.0, 0.0, 1.0])
    sequence = PrintSequence([0, 1], [2, 0], [up, up], [0, 1])
    np.testing.assert_array_equal(waypoints_of(frame, sequence, 1).axis[0], up)
    curves = frame.control_points.copy()
    curves[0, 3] = curves[0, 2] = [2.0, 0.0, 40.0]
    bent = frame.replace(vertices=[*vertices[:3], [2.0, 0.0, 40.0]], control_points=curves)
    leaning = waypoints_of(bent, sequence, 1)
    assert leaning.axis[2, 0] < -0.1  # away from the neighbour
    assert leaning.contacts == ()
    upright = WaypointSettings(max_tilt_deg=0.0)
    with pytest.raises(InputError, match="strut 1: the nozzle touches strut 0"):
        waypoints_of(bent, sequence, 1, upright)
    touched = waypoints_of(bent, sequence, 1, dataclasses.replace(upright, allow_contact=True))
    assert touched.contacts == ("strut 1: the nozzle touches strut 0",)


def test_time_is_way_over_speed_and_pauses() -> None:
    frame = Wireframe.create([[0, 0, 0], [0, 0, 30]], [[0, 1]], radius=1.0)
    settings = WaypointSettings(
        speed=3.0, approach_speed=10.0, travel_speed=50.0, start_dwell=1.0, end_dwell=4.0, clearance=7.0
    )
    points = waypoints_of(frame, PrintSequence([0], [0], [[0, 0, 1]], [0]), 0, settings)
    top = 31.0 + 7.0
    low, high = points.position[1, 2], points.position[-2, 2]
    assert low >= top and high >= top
    hover = points.position[0, 2]
    expected = 10.0 + 5.0 + (low + high - 30.0) / 10.0 + (2.0 * hover - low - high) / 50.0
    assert points.seconds == pytest.approx(expected)


@pytest.mark.parametrize("field", ["spacing", "speed", "clearance", "start_dwell", "max_tilt_deg"])
def test_impossible_settings_are_refused(field: str) -> None:
    with pytest.raises(InputError, match=field):
        WaypointSettings(**{field: -1.0})


def test_wrong_batches_and_designs_are_refused() -> None:
    frame = tower()
    sequence = plan_sequence(frame, OrderSettings(batch_size=12))
    with pytest.raises(InputError, match="batch: 2 of 2 does not exist"):
        waypoints_of(frame, sequence, 2)
    with pytest.raises(InputError, match="not those of the plan"):
        waypoints_of(frame, sequence, 0, design=tower(1))


def damaged(points: Waypoints, **changes: np.ndarray) -> Waypoints:
    return dataclasses.replace(points, source="waypoints", **changes)


def test_limits_of_the_workspace() -> None:
    frame = tower()
    points = waypoints_of(frame, plan_sequence(frame), 1)
    low, high = points.position.min(axis=0), points.position.max(axis=0)
    Workspace(low, high, max_speed=60.0).check(points)
    worst = int(np.argmax(points.position[:, 1]))
    with pytest.raises(InputError, match=rf"waypoint {worst} .*strut {points.strut[worst]}.* 0.25 mm outside .* in y"):
        Workspace(low, high - [0.0, 0.25, 0.0]).check(points)
    with pytest.raises(InputError, match="10 mm/s faster"):
        Workspace(low, high, max_speed=50.0).check(points)
    lean = float(np.degrees(np.arccos(points.axis[:, 2])).max())
    with pytest.raises(InputError, match="degrees more than the allowed 1"):
        Workspace(low, high, max_tilt_deg=1.0).check(
            damaged(points, rotation=tool_rotations(np.tile([0.6, 0.0, 0.8], (len(points), 1))))
        )
    assert lean <= 60.0 + 1e-9
    base = np.eye(4)
    base[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    base[:3, 3] = [100.0, 0.0, 0.0]
    corners = np.array([low, high]) @ base[:3, :3].T + base[:3, 3]
    Workspace(corners.min(axis=0), corners.max(axis=0), base).check(points)
    with pytest.raises(InputError, match="outside of the workspace"):
        Workspace(low, high, base).check(points)


@pytest.mark.parametrize(
    "fields",
    [
        {"upper": [0.0, 1.0, 1.0]},
        {"base": np.diag([1.0, 1.0, 2.0, 1.0])},
        {"base": np.diag([1.0, 1.0, -1.0, 1.0])},
        {"max_speed": 0.0},
        {"max_tilt_deg": np.nan},
    ],
)
def test_impossible_workspaces_are_refused(fields: dict) -> None:
    with pytest.raises(InputError, match=next(iter(fields))):
        Workspace(**{"lower": np.zeros(3), "upper": np.ones(3), **fields})
