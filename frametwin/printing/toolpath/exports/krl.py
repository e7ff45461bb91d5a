"""Waypoints as a KRL program for controllers of KUKA, and the parser that reads one back.

Lengths are in mm, speeds in m/s, orientations the angles A, B, C in degrees about z, the new y and the newest x, all
in the robot's own base (``$ROBROOT``). Tool number 1 must be set to the nozzle's tip, z out of it, and output 1
switches the extruder. Moves stop at their waypoints but within a strut, where ``C_DIS`` lets the tip pass at the
distance ``$APO.CDIS``; outputs and waits stop the advance run, so that they happen at the waypoint. The first move
stays where the arm is, as KRL asks for a ``PTP`` before the first ``LIN``. The program has the name of its file.

Source: KUKA, "KUKA System Software, Operating and Programming Instructions for System Integrators" (LIN, C_DIS, $APO,
$VEL, WAIT, names of up to 24 characters).
"""

from __future__ import annotations

import re

import numpy as np
from scipy.spatial.transform import Rotation

from frametwin.files import PathLike, read_text
from frametwin.printing.toolpath.exports.robot_program import (
    ReadMoves,
    RobotProgram,
    heading,
    moves_of,
    not_understood,
    rounded_down,
)
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace

TOOL, OUTPUT = 1, 1
"""Numbers of the tool and of the extruder's output."""

ACCELERATION = 0.5
"""m/s^2."""

_NUMBER = r"-?\d+\.\d+"
_MOVE = re.compile(
    r"LIN \{" + ", ".join(rf"{key} ({_NUMBER})" for key in ("X", "Y", "Z", "A", "B", "C")) + r"\}( C_DIS)?"
)
_SPEED = re.compile(rf"\$VEL\.CP = ({_NUMBER})")
_BLEND = re.compile(rf"\$APO\.CDIS = ({_NUMBER})")
_OUTPUT = re.compile(rf"\$OUT\[{OUTPUT}\] = (TRUE|FALSE)")
_WAIT = re.compile(rf"WAIT SEC ({_NUMBER})")
_SETUP = (
    "BAS(#INITMOV, 0)",
    f"BAS(#TOOL, {TOOL})",
    "$BASE = $ROBROOT",
    "$IPO_MODE = #BASE",
    "$ORI_TYPE = #VAR",
    f"$ACC.CP = {ACCELERATION}",
)
_START = "PTP $AXIS_ACT"
_AROUND = ("&ACCESS RVP", "DEF NAME()", *_SETUP, _START, "END")
_NOTHING = re.compile(r";.*|")


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The program's text; positions to a nanometre."""
    name = f"ft_{waypoints.batch:03d}"
    needs = f"needs tool {TOOL} (tip of the nozzle, z out of it) and the extruder at output {OUTPUT}"
    body = [*(f"; {line}" for line in (*heading(waypoints), needs)), *_SETUP, f"$OUT[{OUTPUT}] = FALSE", _START]
    settings: dict[str, str] = {}
    for move in moves_of(waypoints, limits):
        wanted = {"$VEL.CP": rounded_down(move.speed / 1000.0, 6)}
        if move.blend:
            wanted["$APO.CDIS"] = f"{int(move.blend * 1e3) / 1e3:.3f}"
        body += [f"{name} = {value}" for name, value in wanted.items() if settings.get(name) != value]
        settings |= wanted
        place = [f"{key} {value:.6f}" for key, value in zip("XYZ", move.position, strict=True)]
        turn = [f"{key} {value:.9f}" for key, value in zip("ABC", angles_of(move.rotation), strict=True)]
        body.append(f"LIN {{{', '.join([*place, *turn])}}}" + (" C_DIS" if move.blend else ""))
        if move.switch is not None:
            body.append(f"$OUT[{OUTPUT}] = {'TRUE' if move.switch else 'FALSE'}")
        if move.dwell > 0.0:
            body.append(f"WAIT SEC {move.dwell:.3f}")
    body.append(f"$OUT[{OUTPUT}] = FALSE")
    return "\n".join(["&ACCESS RVP", f"DEF {name}()", *(f"  {line}" for line in body), "END"]) + "\n"


def angles_of(rotation: np.ndarray) -> tuple[float, float, float]:
    """A, B, C in degrees of a rotation (3, 3); where B is a right angle and one turn says all, C is 0."""
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    if across > 1e-9:
        a, c = np.arctan2(rotation[1, 0], rotation[0, 0]), np.arctan2(rotation[2, 1], rotation[2, 2])
    else:
        a, c = np.arctan2(-rotation[0, 1], rotation[1, 1]), 0.0
    return float(np.degrees(a)), float(np.degrees(np.arctan2(-rotation[2, 0], across))), float(np.degrees(c))


def read_krl(path: PathLike) -> RobotProgram:
    """Read a program of the kind that `to_text` writes.

    Raises
    ------
    InputError
        If the file is missing, cut short, or holds a line of another kind.
    """
    read, speed, blend = ReadMoves(), 0.0, 0.0
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = line.strip()
        if match := _MOVE.fullmatch(text):
            *pose, passes = match.groups()
            read.move([*(float(word) for word in pose), speed, blend if passes else 0.0])
        elif match := _SPEED.fullmatch(text):
            speed = float(match.group(1))
        elif match := _BLEND.fullmatch(text):
            blend = float(match.group(1))
        elif match := _OUTPUT.fullmatch(text):
            read.switch(match.group(1) == "TRUE")
        elif (match := _WAIT.fullmatch(text)) and read.rows:
            read.wait(float(match.group(1)))
        elif text in _AROUND or re.fullmatch(r"DEF \w+\(\)", text):
            read.around.append(text)
        elif not _NOTHING.fullmatch(text):
            raise not_understood(path, number, text)
    read.require_whole(path, _AROUND)
    table = np.array(read.rows, dtype=np.float64).reshape(-1, 8)
    turns = Rotation.from_euler("ZYX", table[:, 3:6], degrees=True) if len(table) else Rotation.identity(0)
    return RobotProgram(
        position=table[:, :3],
        rotation_vector=turns.as_rotvec(),
        speed=1000.0 * table[:, 6],
        extrude=np.array(read.extrude, dtype=bool),
        dwell=np.array(read.dwell),
        blend=table[:, 7],
    )
