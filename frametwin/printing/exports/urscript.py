"""Waypoints as a URScript program, and the parser that reads one back.

Lengths are in m, speeds in m/s, orientations axis times angle in rad, all in the robot's base; the tool's centre
point is taken to be set to the nozzle's tip, z out of it. A digital output switches the extruder. Each ``movel``
stops at its pose, so the tip passes exactly through the waypoints (Universal Robots, The URScript Programming
Language, e-Series).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_text
from frametwin.printing.waypoints import Waypoints
from frametwin.printing.workspace import Workspace, rotation_vectors

ACCELERATION = 0.5
"""m/s^2."""

OUTPUT = 0
"""Digital output of the extruder."""

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
_MOVE = re.compile(
    rf"movel\(p\[({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER}), ({_NUMBER})\], "
    rf"a=({_NUMBER}), v=({_NUMBER})\)"
)
_OUTPUT = re.compile(r"set_standard_digital_out\((\d+), (True|False)\)")
_SLEEP = re.compile(rf"sleep\(({_NUMBER})\)")


@dataclass(frozen=True, eq=False)
class RobotProgram:
    """What a program makes the robot do.

    Attributes
    ----------
    position
        (N, 3) in mm in the robot's base.
    rotation_vector
        (N, 3) axis times angle, rad.
    speed
        (N,) mm/s.
    extrude
        (N,) bool, from the arrival on.
    dwell
        (N,) s.
    """

    position: np.ndarray
    rotation_vector: np.ndarray
    speed: np.ndarray
    extrude: np.ndarray
    dwell: np.ndarray


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The program's text; positions to a nanometre."""
    name = f"frametwin_batch_{waypoints.batch}"
    lines = [f"def {name}():", f"  set_standard_digital_out({OUTPUT}, False)"]
    poses = np.hstack([limits.positions(waypoints) / 1000.0, rotation_vectors(limits.rotations(waypoints))])
    flows = False
    rows = zip(
        poses.tolist(), waypoints.speed.tolist(), waypoints.extrude.tolist(), waypoints.dwell.tolist(), strict=True
    )
    for pose, speed, extrude, dwell in rows:
        numbers = ", ".join(f"{value:.9f}" for value in pose)
        lines.append(f"  movel(p[{numbers}], a={ACCELERATION}, v={_rounded_down(speed / 1000.0)})")
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
        If the file is missing or holds a line of another kind.
    """
    poses, speeds, extrude, dwell = [], [], [], []
    flows = False
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = line.strip()
        if match := _MOVE.fullmatch(text):
            values = [float(word) for word in match.groups()]
            poses.append(values[:6])
            speeds.append(values[7])
            extrude.append(flows)
            dwell.append(0.0)
        elif match := _OUTPUT.fullmatch(text):
            flows = match.group(2) == "True"
            if extrude:
                extrude[-1] = flows
        elif (match := _SLEEP.fullmatch(text)) and dwell:
            dwell[-1] += float(match.group(1))
        elif not re.fullmatch(r"(def \w+\(\):|end|\w+\(\)|)", text):
            raise InputError.at(
                path, f"line {number}", f"{text[:60]!r} is not understood", "give a program of FrameTwin"
            )
    pose = np.array(poses, dtype=np.float64).reshape(-1, 6)
    return RobotProgram(
        pose[:, :3] * 1000.0, pose[:, 3:], np.array(speeds) * 1000.0, np.array(extrude, dtype=bool), np.array(dwell)
    )


def _rounded_down(speed: float) -> str:
    """Six digits after the point, never faster than asked for, and never still."""
    return f"{max(1, int(speed * 1e6 + 1e-6)) / 1e6:.6f}"
