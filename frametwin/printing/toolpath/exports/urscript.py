"""Waypoints as a URScript program, and the parser that reads one back.

Lengths are in m, speeds in m/s, orientations axis times angle in rad, all in the robot's base; the tool's centre
point is taken to be set to the nozzle's tip, z out of it. A digital output switches the extruder. A ``movel`` stops at
its pose, so that the tip passes exactly through it, but for waypoints within a strut: these are blended, as a tip that
stood still would leave a blob (Universal Robots, The URScript Programming Language, e-Series: blend radii of
neighbours must not overlap). Blends stay inside of the corner that they cut, and so in the workspace.
"""

from __future__ import annotations

import re

import numpy as np

from frametwin.files import PathLike
from frametwin.printing.toolpath.exports.robot_program import (
    Lines,
    RobotProgram,
    blend_radii,
    read_moves,
    rounded_down,
)
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace, rotation_vectors

ACCELERATION = 0.5
"""m/s^2."""

OUTPUT = 0
"""Digital output of the extruder."""

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
_MOVE = re.compile(
    rf"movel\(p\[({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER})\], "
    rf"a={ACCELERATION}, v=({_NUMBER})(?:, r=({_NUMBER}))?\)"
)
_OUTPUT = re.compile(rf"set_standard_digital_out\({OUTPUT}, (True|False)\)")
_SLEEP = re.compile(rf"sleep\(({_NUMBER})\)")
_OTHER = re.compile(r"def \w+\(\):|end|frametwin_batch_\d+\(\)")
_NOTHING = re.compile(r"#.*|")
_AROUND = ("def NAME():", "end", "NAME()")


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The program's text; positions to a nanometre."""
    name = f"frametwin_batch_{waypoints.batch}"
    lines = [f"def {name}():", f"  set_standard_digital_out({OUTPUT}, False)"]
    poses = np.hstack([limits.positions(waypoints) / 1000.0, rotation_vectors(limits.rotations(waypoints))])
    flows = False
    rows = zip(
        poses.tolist(),
        waypoints.speed.tolist(),
        waypoints.extrude.tolist(),
        waypoints.dwell.tolist(),
        blend_radii(waypoints).tolist(),
        strict=True,
    )
    for pose, speed, extrude, dwell, blend in rows:
        numbers = ", ".join(f"{value:.9f}" for value in pose)
        rounded = f", r={int(blend * 1e3) / 1e6:.6f}" if blend >= 1e-3 else ""
        lines.append(f"  movel(p[{numbers}], a={ACCELERATION}, v={rounded_down(speed / 1000.0, 6)}{rounded})")
        if extrude != flows:
            lines.append(f"  set_standard_digital_out({OUTPUT}, {extrude})")
            flows = extrude
        if dwell > 0.0:
            lines.append(f"  sleep({dwell:.3f})")
    lines += [f"  set_standard_digital_out({OUTPUT}, False)", "end", f"{name}()"]
    return "\n".join(lines) + "\n"


def read_urscript(path: PathLike) -> RobotProgram:
    """Read a program of the kind that `to_text` writes.

    Raises
    ------
    InputError
        If the file is missing, cut short, or holds a line of another kind.
    """
    lines = Lines(move=_MOVE, switch=_OUTPUT, on="True", wait=_SLEEP, other=_OTHER, nothing=_NOTHING)
    read = read_moves(path, lines)
    read.require_whole(path, _AROUND)
    table = np.array(read.rows, dtype=np.float64).reshape(-1, 8)
    return RobotProgram(
        position=table[:, :3] * 1000.0,
        rotation_vector=table[:, 3:6],
        speed=table[:, 6] * 1000.0,
        extrude=np.array(read.extrude, dtype=bool),
        dwell=np.array(read.dwell),
        blend=table[:, 7] * 1000.0,
    )
