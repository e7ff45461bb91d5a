"""Waypoints as G-code, and the parser that reads it back.

Coordinates are in mm in the machine's base (the workspace's), absolute; extrusion is relative (``M83``), in mm of
filament pushed through a round inlet. ``G0`` moves without material, ``G1`` with it, ``G4 P`` pauses in ms. Machines
with three axes know no tilt, those with more write it in ways of their own: the tool's axis stands in a comment
behind each move, as ``;axis i j k``, for a post-processor to use; an order planned with ``max_tilt_deg=0`` needs
none.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_text
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace

FILAMENT = 1.75
"""Diameter of the filament, mm."""

_WORD = re.compile(r"([XYZEF])([-+]?\d+(?:\.\d+)?)")
_SETUP = ("G21", "G90", "M83", "G92 E0")


@dataclass(frozen=True, eq=False)
class GcodeMoves:
    """What a file makes the machine do.

    Attributes
    ----------
    position : (N, 3) array, mm
        In the machine's base.
    axis : (N, 3) array
        Unit vectors along the tool, from the tip upwards.
    speed : (N,) array, mm/s
    extrusion : (N,) array, mm
        Filament that is pushed on the way to the waypoint.
    dwell : (N,) array, s
    """

    position: np.ndarray
    axis: np.ndarray
    speed: np.ndarray
    extrusion: np.ndarray
    dwell: np.ndarray


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The file's text; positions to a nanometre."""
    push = (2.0 * waypoints.radius / FILAMENT) ** 2  # filament for each mm of strand
    position = limits.positions(waypoints)
    axis = waypoints.axis @ limits.base[:3, :3].T
    length = np.linalg.norm(np.diff(position, axis=0, prepend=position[:1]), axis=1)
    lines = [f"; frametwin batch {waypoints.batch}, struts {' '.join(str(s) for s in waypoints.struts)}", *_SETUP]
    for n in range(len(waypoints)):
        flows = n > 0 and bool(waypoints.extrude[n - 1])
        x, y, z = position[n]
        feed = math.floor(60.0 * waypoints.speed[n] * 1e3 + 1e-6) / 1e3
        move = f"{'G1' if flows else 'G0'} X{x:.6f} Y{y:.6f} Z{z:.6f}"
        move += f" E{push[n] * length[n]:.6f}" if flows else ""
        lines.append(f"{move} F{feed:.3f} ;axis " + " ".join(f"{value:.9f}" for value in axis[n]))
        if waypoints.dwell[n] > 0.0:
            lines.append(f"G4 P{round(1000.0 * waypoints.dwell[n])}")
    return "\n".join(lines) + "\n"


def read_gcode(path: PathLike) -> GcodeMoves:
    """Read a file of the kind that `to_text` writes.

    Raises
    ------
    InputError
        If the file is missing, holds a line of another kind, or does not begin with the modes that its numbers need.
    """
    rows, dwell, modes = [], [], []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        command, _, comment = line.partition(";")
        command = command.strip()
        if re.fullmatch(r"G[01]( [XYZEF][-+]?\d+(\.\d+)?)+", command) and comment.startswith("axis "):
            words = {key: float(value) for key, value in _WORD.findall(command)}
            tail = [float(word) for word in comment.split()[1:]]
            if {"X", "Y", "Z", "F"} <= set(words) and len(tail) == 3:
                rows.append([words["X"], words["Y"], words["Z"], *tail, words["F"] / 60.0, words.get("E", 0.0)])
                dwell.append(0.0)
                continue
        if (match := re.fullmatch(r"G4 P(\d+)", command)) and dwell:
            dwell[-1] += float(match.group(1)) / 1000.0
        elif command in _SETUP and not rows:
            modes.append(command)
        elif command:
            raise InputError.at(path, f"line {number}", f"{line[:60]!r} is not understood", "give a file of FrameTwin")
    missing = [mode for mode in _SETUP if mode not in modes]
    if missing or not rows:
        problem = f"does not set {missing[0]} before its first move" if missing else "holds no moves"
        raise InputError.at(path, "file", problem, "copy it whole, or plan the job again")
    table = np.array(rows, dtype=np.float64).reshape(-1, 8)
    return GcodeMoves(table[:, :3], table[:, 3:6], table[:, 6], table[:, 7], np.array(dwell))
