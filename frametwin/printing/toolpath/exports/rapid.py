"""Waypoints as a RAPID module for controllers of ABB, and the parser that reads one back.

Lengths are in mm, speeds in mm/s, orientations unit quaternions (w, x, y, z), all in the world's axes, which are taken
to be the robot's base. The module asks for two things that the system must have: the tool ``ft_tool``, whose centre
point is the nozzle's tip, z out of it, and the digital output ``ft_extruder``. Moves stop at their waypoints but within
a strut, where a zone lets the tip pass; nothing is switched in a zone, since an output is set as soon as that is
entered. The arm's configuration is not watched (``ConfL \\Off``), and near a singular wrist the tool may lean a little
while the tip keeps to its way (``SingArea \\Wrist``).

Source: ABB, Technical reference manual "RAPID Instructions, Functions and Data types" (MoveL, robtarget, speeddata,
zonedata, SetDO, WaitTime, ConfL) and "RAPID Overview" (names of up to 32 characters).
"""

from __future__ import annotations

import re

import numpy as np
from scipy.spatial.transform import Rotation

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.printing.toolpath.exports.robot_program import (
    Lines,
    RobotProgram,
    heading,
    moves_of,
    read_moves,
    rounded_down,
)
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace

TOOL, OUTPUT = "ft_tool", "ft_extruder"
"""Names of the tool and of the extruder's digital output in the robot's system."""

TURN_SPEED = 500.0
"""degrees/s, the fastest turn of the tool; the tip's speed is what limits moves."""

_AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"  # no external ones
_NUMBER = r"-?\d+\.\d+"
_MOVE = re.compile(
    rf"MoveL \[\[({_NUMBER}),({_NUMBER}),({_NUMBER})\],\[({_NUMBER}),({_NUMBER}),({_NUMBER}),({_NUMBER})\],"
    rf"\[0,0,0,0\],{re.escape(_AXES)}\], \[({_NUMBER}),{_NUMBER},5000,1000\], "
    rf"(?:fine|\[FALSE,({_NUMBER}),{_NUMBER},{_NUMBER},{_NUMBER},{_NUMBER},{_NUMBER}\]), {TOOL} \\WObj:=wobj0;"
)
_OUTPUT = re.compile(rf"SetDO {OUTPUT}, ([01]);")
_WAIT = re.compile(rf"WaitTime \\InPos, ({_NUMBER});")
_SETUP = ("ConfL \\Off;", "SingArea \\Wrist;")
_AROUND = ("MODULE NAME", "PROC NAME()", *_SETUP, "ENDPROC", "ENDMODULE")
_OTHER = re.compile("|".join([r"MODULE \w+", r"PROC \w+\(\)", "ENDPROC", "ENDMODULE", *map(re.escape, _SETUP)]))
_NOTHING = re.compile(r"!.*|")


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The module's text; positions to a nanometre."""
    name = f"ft_{waypoints.batch:03d}"
    says = [*heading(waypoints), f"needs tooldata {TOOL} (tip of the nozzle, z out of it) and signal {OUTPUT}"]
    lines = [f"MODULE {name}", *(f"  ! {line}" for line in says), f"  PROC {name}_run()"]
    body = [*_SETUP, f"SetDO {OUTPUT}, 0;"]
    for move in moves_of(waypoints, limits):
        x, y, z, w = Rotation.from_matrix(move.rotation).as_quat()
        place = ",".join(f"{value:.6f}" for value in move.position)
        turn = ",".join(f"{value:.9f}" for value in (w, x, y, z))
        speed = f"[{rounded_down(move.speed, 3)},{TURN_SPEED:.1f},5000,1000]"
        target = f"[[{place}],[{turn}],[0,0,0,0],{_AXES}]"
        body.append(f"MoveL {target}, {speed}, {_zone(move.blend)}, {TOOL} \\WObj:=wobj0;")
        if move.switch is not None:
            body.append(f"SetDO {OUTPUT}, {int(move.switch)};")
        if move.dwell > 0.0:
            body.append(f"WaitTime \\InPos, {move.dwell:.3f};")
    body.append(f"SetDO {OUTPUT}, 0;")
    lines += [f"    {line}" for line in body]
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE"]) + "\n"


def read_rapid(path: PathLike) -> RobotProgram:
    """Read a module of the kind that `to_text` writes.

    Raises
    ------
    InputError
        If the file is missing, cut short, or holds a line of another kind.
    """
    lines = Lines(move=_MOVE, switch=_OUTPUT, on="1", wait=_WAIT, other=_OTHER, nothing=_NOTHING)
    read = read_moves(path, lines)
    read.require_whole(path, _AROUND)
    table = np.array(read.rows, dtype=np.float64).reshape(-1, 9)
    if (np.abs(np.linalg.norm(table[:, 3:7], axis=1) - 1.0) > 1e-6).any():
        raise InputError.at(path, "robtarget", "an orientation is no unit quaternion", "give a program of FrameTwin")
    turns = Rotation.from_quat(table[:, [4, 5, 6, 3]]) if len(table) else Rotation.identity(0)
    return RobotProgram(
        position=table[:, :3],
        rotation_vector=turns.as_rotvec(),
        speed=table[:, 7],
        extrude=np.array(read.extrude, dtype=bool),
        dwell=np.array(read.dwell),
        blend=table[:, 8],
    )


def _zone(radius: float) -> str:
    """A zone whose parts for the tip and for turns are the same, in mm and degrees; ``fine`` for a stop."""
    if radius == 0.0:
        return "fine"
    size = f"{int(radius * 1e3) / 1e3:.3f}"
    return f"[FALSE,{size},{size},{size},0.100,{size},0.100]"
