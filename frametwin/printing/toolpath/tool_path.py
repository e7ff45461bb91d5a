"""The way of the tool as it stands in a file for a robot, whatever its format: read back, to be looked at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from frametwin.printing.toolpath.exports.compas import read_compas_frames, read_compas_moves
from frametwin.printing.toolpath.exports.gcode import read_gcode
from frametwin.printing.toolpath.exports.krl import read_krl
from frametwin.printing.toolpath.exports.rapid import read_rapid
from frametwin.printing.toolpath.exports.urscript import read_urscript
from frametwin.printing.toolpath.exports.waypoints_json import read_waypoints
from frametwin.printing.toolpath.workspace import Workspace

_PROGRAMS = {"urscript": read_urscript, "rapid": read_rapid, "krl": read_krl}

TURN_STEP = np.radians(1.0)
"""Largest turn of the tool between two sampled poses."""


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Where a file sends the tool, in the coordinates of the print.

    Attributes
    ----------
    position : (N, 3) array, mm
        Of the nozzle's tip.
    rotation : (N, 3, 3) array
        Of the tool; z points out of the nozzle. Where a file gives the axis alone (G-code), the roll is of no meaning.
    speed : (N,) array, mm/s
        On the way to each waypoint.
    extrude : (N,) bool array
        Material flows on the way from each waypoint to the next.
    dwell : (N,) array, s
        Pause at each waypoint.
    blend : (N,) array, mm
        Within so much of the waypoint the tip may cut the corner; 0 where it stops, or the file knows no blends.
    filament : (N,) array, mm, or None
        That is pushed on the way to each waypoint, by a file that says so (G-code).
    """

    position: np.ndarray
    rotation: np.ndarray
    speed: np.ndarray
    extrude: np.ndarray
    dwell: np.ndarray
    blend: np.ndarray
    filament: np.ndarray | None = None

    @property
    def axis(self) -> np.ndarray:
        """(N, 3) array: unit vectors along the tool, from the tip upwards."""
        return -self.rotation[:, :, 2]

    def strut_runs(self) -> list[tuple[int, int]]:
        """First and last waypoint of every stretch along which material flows without a break: the struts laid."""
        flows = np.concatenate([[False], self.extrude, [False]])
        steps = np.diff(flows.astype(np.int8))
        last = len(self.extrude) - 1
        return [
            (int(a), min(int(b), last)) for a, b in zip(*(np.flatnonzero(steps == k) for k in (1, -1)), strict=True)
        ]

    def poses(self, first: int, last: int, step: float) -> tuple[np.ndarray, np.ndarray]:
        """Closely spaced poses from one waypoint to another: straight ways of the tip, even turns of the tool.

        Parameters
        ----------
        first, last
            Numbers of the waypoints.
        step
            Largest distance in mm between two poses; between their directions it is `TURN_STEP`.

        Returns
        -------
        tip : (P, 3) array, mm
        axis : (P, 3) array
        """
        turns = Rotation.from_matrix(self.rotation[first : last + 1])
        position = self.position[first : last + 1]
        ways = np.linalg.norm(np.diff(position, axis=0), axis=1)
        angles = (turns[:-1].inv() * turns[1:]).magnitude() if len(position) > 1 else np.zeros(0)
        counts = np.maximum(1, np.ceil(np.maximum(ways / step, angles / TURN_STEP))).astype(np.int64)
        when = np.concatenate([k + np.arange(count) / count for k, count in enumerate(counts)] + [[len(counts)]])
        low = np.minimum(when.astype(np.int64), max(0, len(counts) - 1))
        share = (when - low)[:, None]
        if len(position) == 1:
            return position, self.axis[first : last + 1]
        tip = (1.0 - share) * position[low] + share * position[low + 1]
        axis = -Slerp(np.arange(len(position)), turns)(when).as_matrix()[:, :, 2]
        return tip, axis


def read_tool_path(path: Path, format: str, workspace: Workspace) -> ToolPath:
    """Read a file with waypoints.

    Parameters
    ----------
    path
        As `frametwin.printing.toolpath.exports.write_waypoints` writes it.
    format
        One of `frametwin.printing.toolpath.exports.SUFFIXES`.
    workspace
        Tells where the print stands in the robot's base.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    if format == "json":
        points = read_waypoints(path)
        stops = np.zeros(len(points))
        return ToolPath(points.position, points.rotation, points.speed, points.extrude, points.dwell, stops)
    if format in _PROGRAMS:
        program = _PROGRAMS[format](path)
        turns = Rotation.from_rotvec(program.rotation_vector).as_matrix()
        moved = ToolPath(program.position, turns, program.speed, program.extrude, program.dwell, program.blend)
    elif format == "gcode":
        moves = read_gcode(path)
        flows, stops = np.append(moves.extrusion[1:] > 0.0, False), np.zeros(len(moves.position))
        turns = _smallest_turns(-moves.axis)
        moved = ToolPath(moves.position, turns, moves.speed, flows, moves.dwell, stops, moves.extrusion)
    else:
        position, turns = read_compas_frames(path)
        speed, extrude, dwell = read_compas_moves(path)
        moved = ToolPath(1000.0 * position, turns, 1000.0 * speed, extrude, dwell, np.zeros(len(position)))
    turn, shift = workspace.base[:3, :3], workspace.base[:3, 3]  # from the robot's base to the print
    return replace(moved, position=(moved.position - shift) @ turn, rotation=turn.T @ moved.rotation)


def _smallest_turns(directions: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rotations by the smallest angle that take the tool from straight down to unit vectors (N, 3)."""
    down = np.array([0.0, 0.0, -1.0])
    across = np.cross(np.broadcast_to(down, directions.shape), directions)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.arctan2(size, (directions @ down)[:, None])
    vectors = np.where(size > 1e-12, across / np.maximum(size, 1e-12) * angle, 0.0)
    upside_down = np.diag([1.0, -1.0, -1.0])  # the tool's own axes when it points straight down
    return Rotation.from_rotvec(vectors).as_matrix() @ upside_down
