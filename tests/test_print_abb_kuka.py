"""Programs for robots of ABB and KUKA: read back, and parsed by a grammar that is not the project's."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from print_cases import turned_workspace
from scipy.spatial.transform import Rotation
from small_frames import tower

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.toolpath.exports import write_waypoints
from frametwin.printing.toolpath.exports.krl import angles_of, read_krl
from frametwin.printing.toolpath.exports.rapid import read_rapid
from frametwin.printing.toolpath.exports.robot_program import RobotProgram, blend_radii
from frametwin.printing.toolpath.robot_files import waypoint_file
from frametwin.printing.toolpath.waypoints import Waypoints, waypoints_of
from frametwin.printing.toolpath.workspace import Workspace

READERS: dict[str, Callable[[PathLike], RobotProgram]] = {"rapid": read_rapid, "krl": read_krl}

PER_WAYPOINT = ("position", "rotation", "speed", "extrude", "dwell", "kind", "strut", "deviation", "radius")


@pytest.fixture(scope="module")
def points() -> Waypoints:
    """Waypoints in the upper half of a tower with curved struts, with tilted tools, blends and pauses among them."""
    frame = tower(curved=True)
    sequence = plan_sequence(frame, OrderSettings(batch_size=12, allow_contact=True))
    points = waypoints_of(frame, sequence, 1, design=frame)
    assert np.ptp(points.axis, axis=0).max() > 0.2 and points.dwell.max() > 0.0 and blend_radii(points).max() > 0.0
    return points


@pytest.fixture(scope="module")
def limits() -> Workspace:
    return turned_workspace()


def in_base(points: Waypoints, limits: Workspace) -> tuple[np.ndarray, Rotation]:
    turn = Rotation.from_matrix(limits.base[:3, :3]) * Rotation.from_matrix(points.rotation)
    return points.position @ limits.base[:3, :3].T + limits.base[:3, 3], turn


@pytest.mark.parametrize("format", READERS)
def test_a_program_reads_back(tmp_path: Path, points: Waypoints, limits: Workspace, format: str) -> None:
    program = READERS[format](write_waypoints(tmp_path / "w", points, format, limits))
    position, turn = in_base(points, limits)
    assert np.abs(program.position - position).max() <= 5.1e-7
    assert (Rotation.from_rotvec(program.rotation_vector).inv() * turn).magnitude().max() < 1e-8
    assert (program.speed <= points.speed + 1e-9).all() and np.abs(program.speed - points.speed).max() < 1.1e-3
    np.testing.assert_array_equal(program.extrude, points.extrude)
    np.testing.assert_allclose(program.dwell, points.dwell, atol=5.1e-4)
    wanted = blend_radii(points)
    assert (program.blend <= wanted + 1e-12).all() and np.abs(program.blend - wanted).max() < 1e-3


@pytest.mark.parametrize(("format", "name"), [("rapid", "ft_007.mod"), ("krl", "ft_007.src")])
def test_names_are_short_and_those_of_the_files(
    tmp_path: Path, points: Waypoints, limits: Workspace, format: str, name: str
) -> None:
    assert waypoint_file(7, format) == name
    program = Path(waypoint_file(points.batch, format)).stem
    text = write_waypoints(tmp_path / "w", points, format, limits).read_text()
    assert re.search(rf"^(MODULE|DEF) {program}\b", text, re.MULTILINE)
    names = re.findall(r"\b(?:MODULE|DEF|PROC) (\w+)", text)
    assert len(program) <= 8 and all(len(name) <= 24 for name in names) and len(set(names)) == len(names)
    assert f"batch {points.batch}" in text and text.isascii() and "nan" not in text and "inf" not in text.lower()
    assert max(map(len, text.splitlines())) < 255


# --- RAPID, by the grammar of rapidchecker


@pytest.fixture(scope="module")
def few(points: Waypoints) -> Waypoints:
    """Those of one strut, since that parser takes a tenth of a second for each waypoint."""
    keep = np.flatnonzero(np.isin(points.strut, points.struts[:1]))
    return dataclasses.replace(points, **{name: getattr(points, name)[keep] for name in PER_WAYPOINT})


def rapid_tokens(text: str) -> list[Any]:
    """The words of a module, if it follows the grammar."""
    pytest.importorskip("rapidchecker", reason="rapidchecker is not installed")
    from rapidchecker.parser.grammar import module
    from rapidchecker.parser.indent import reset_level

    reset_level()
    return list(module.parse_string(text, parse_all=True))


def test_rapid_by_the_grammar_of_others(tmp_path: Path, few: Waypoints, limits: Workspace) -> None:
    """Statements of the parsed module, executed: where the tip is, how fast, and when material flows."""
    words = rapid_tokens(write_waypoints(tmp_path / "w.mod", few, "rapid", limits).read_text())
    body = words[words.index(")") + 1 : words.index("ENDPROC")]
    statements: list[list[Any]] = [[]]
    for word in body:
        statements.append([]) if word == ";" else statements[-1].append(word)
    poses, speeds, zones, flows, waits, on = [], [], [], [], [], False
    for statement in statements[:-1]:
        numbers = [word for word in statement if isinstance(word, int | float)]
        if statement[0] == "MoveL":
            assert numbers[7:11] == [0, 0, 0, 0] and numbers[11:17] == [9e9] * 6  # nothing known, no external axes
            poses.append(numbers[:7])
            speeds.append(numbers[17])
            zones.append(0.0 if "fine" in statement else numbers[21])
            flows.append(on)
            waits.append(0.0)
            assert statement[-3:] == ["\\WObj", ":=", "wobj0"] and statement[-4] == "ft_tool"
        elif statement[0] == "SetDO":
            on = bool(numbers[0])
            if flows:
                flows[-1] = on
        elif statement[0] == "WaitTime":
            waits[-1] += numbers[0]
        else:
            assert statement in (["ConfL", "\\Off"], ["SingArea", "\\Wrist"])
    position, turn = in_base(few, limits)
    found = np.array(poses)
    np.testing.assert_allclose(found[:, :3], position, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found[:, 3:], axis=1), 1.0, atol=1e-8)
    assert (Rotation.from_quat(found[:, [4, 5, 6, 3]]).inv() * turn).magnitude().max() < 1e-8
    np.testing.assert_allclose(speeds, few.speed, atol=1.1e-3)
    np.testing.assert_allclose(waits, few.dwell, atol=5.1e-4)
    np.testing.assert_allclose(zones, blend_radii(few), atol=1e-3)
    assert flows == few.extrude.tolist() and True in flows and not on


def test_the_grammar_of_others_refuses_what_is_no_rapid(tmp_path: Path, few: Waypoints, limits: Workspace) -> None:
    pyparsing = pytest.importorskip("pyparsing")
    short = dataclasses.replace(few, **{name: getattr(few, name)[:1] for name in PER_WAYPOINT})
    text = write_waypoints(tmp_path / "w.mod", short, "rapid", limits).read_text()
    assert rapid_tokens(text)[-1] == "ENDMODULE"
    for old, new in (("ENDPROC", "END"), ("Off;", "Off"), ("[0,0,0,0]", "[0,0,0,0"), ("MODULE", "MODUL")):
        with pytest.raises(pyparsing.ParseBaseException):
            rapid_tokens(text.replace(old, new, 1))


# --- KRL: nobody offers a parser for it, so by a strict grammar of what KUKA's manual has, independent of the reader

REAL = r"[+-]?\d+\.\d+"
KRL = re.compile(
    "|".join(
        (
            r"(?P<lin>LIN \{X (?P<X>@), Y (?P<Y>@), Z (?P<Z>@), A (?P<A>@), B (?P<B>@), C (?P<C>@)\}(?P<dis> C_DIS)?)",
            r"(?P<set>\$(VEL\.CP|APO\.CDIS|ACC\.CP)) = (?P<value>@)",
            r"\$OUT\[(?P<out>\d+)\] = (?P<state>TRUE|FALSE)",
            r"WAIT SEC (?P<wait>@)",
            r"(?P<setup>BAS\(#(INITMOV|TOOL), \d+\)|\$BASE = \$ROBROOT|\$IPO_MODE = #BASE|\$ORI_TYPE = #VAR)",
            r"(?P<ptp>PTP \$AXIS_ACT)",
            r"(?P<comment>;.*)",
        )
    ).replace("@", REAL)
)


def test_krl_by_a_strict_grammar(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    lines = write_waypoints(tmp_path / "w.src", points, "krl", limits).read_text().splitlines()
    assert lines[0] == "&ACCESS RVP" and re.fullmatch(r"DEF \w{1,24}\(\)", lines[1]) and lines[-1] == "END"
    poses, speeds, zones, flows, waits = [], [], [], [], []
    values: dict[str, float] = {}
    on = None
    for line in lines[2:-1]:
        found = KRL.fullmatch(line.strip())
        assert found is not None, line
        if found["lin"]:
            assert values["ptp"] and on is not None  # set up, and at rest, before the first move
            poses.append([float(found[key]) for key in "XYZABC"])
            speeds.append(1000.0 * values["$VEL.CP"])
            zones.append(values["$APO.CDIS"] if found["dis"] else 0.0)
            flows.append(on)
            waits.append(0.0)
        elif found["set"]:
            values[found["set"]] = float(found["value"])
        elif found["out"]:
            assert found["out"] == "1"
            on = found["state"] == "TRUE"
            if flows:
                flows[-1] = on
        elif found["wait"]:
            waits[-1] += float(found["wait"])
        elif found["ptp"]:
            values["ptp"] = 1.0
    position, turn = in_base(points, limits)
    table = np.array(poses)
    np.testing.assert_allclose(table[:, :3], position, atol=1e-6)
    a, b, c = np.radians(table[:, 3:].T)
    for angles, wanted in zip(zip(a, b, c, strict=True), turn.as_matrix(), strict=True):
        np.testing.assert_allclose(about_z(angles[0]) @ about_y(angles[1]) @ about_x(angles[2]), wanted, atol=1e-8)
    np.testing.assert_allclose(speeds, points.speed, atol=1.1e-3)
    np.testing.assert_allclose(waits, points.dwell, atol=5.1e-4)
    np.testing.assert_allclose(zones, blend_radii(points), atol=1e-3)
    assert flows == points.extrude.tolist() and on is False


def about_z(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])


def about_y(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])


def about_x(angle: float) -> np.ndarray:
    return np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])


def test_angles_also_where_one_of_them_is_a_right_angle() -> None:
    turns = [Rotation.random(random_state=k).as_matrix() for k in range(50)]
    turns += [about_z(0.3) @ about_y(side * np.pi / 2.0) @ about_x(0.8) for side in (1.0, -1.0)]
    turns += [np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0])]
    for turn in turns:
        a, b, c = np.radians(angles_of(turn))
        np.testing.assert_allclose(about_z(a) @ about_y(b) @ about_x(c), turn, atol=1e-9)


# --- damage


@pytest.mark.parametrize("format", READERS)
def test_other_programs_are_refused_by_line(tmp_path: Path, points: Waypoints, limits: Workspace, format: str) -> None:
    file = write_waypoints(tmp_path / "w", points, format, limits)
    text = file.read_text()
    for bad in ("MoveJ p10, v100, z10, tool0;", "PTP HOME", "LIN {X nan}", "WAIT FOR TRUE", "\0"):
        file.write_text(text.replace("\n", f"\n{bad}\n", 1))
        with pytest.raises(InputError, match="line 2: "):
            READERS[format](file)
    with pytest.raises(InputError, match="does not exist"):
        READERS[format](tmp_path / "none")


def test_a_quaternion_that_is_none_is_refused(tmp_path: Path, points: Waypoints, limits: Workspace) -> None:
    file = write_waypoints(tmp_path / "w.mod", points, "rapid", limits)
    text = file.read_text()
    file.write_text(re.sub(r"\],\[(-?[\d.]+),(-?[\d.]+),", r"],[0.9,0.9,", text, count=1))
    with pytest.raises(InputError, match="no unit quaternion"):
        read_rapid(file)
