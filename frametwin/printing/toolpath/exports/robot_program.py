"""What programs for robots have in common: the moves in them, blends, and speeds that are never rounded up."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_text
from frametwin.printing.toolpath.waypoints import PRINT, Waypoints
from frametwin.printing.toolpath.workspace import Workspace

BLEND = 0.45
"""Blend radius as a share of the shorter of the two ways at a waypoint. At a bend of 3 degrees and ways of 1.3 mm the
tip passes the waypoint at 0.01 mm."""

LEAST_BLEND = 1e-3
"""mm; shorter ones are stops."""


@dataclass(frozen=True, eq=False)
class RobotProgram:
    """What a program makes the robot do.

    Attributes
    ----------
    position : (N, 3) array, mm
        In the robot's base.
    rotation_vector : (N, 3) array, rad
        Axis times angle.
    speed : (N,) array, mm/s
    extrude : (N,) bool array
        Material flows from the arrival on.
    dwell : (N,) array, s
    blend : (N,) array, mm
        Radius within which the tip cuts the corner; 0 where it stops.
    """

    position: np.ndarray
    rotation_vector: np.ndarray
    speed: np.ndarray
    extrude: np.ndarray
    dwell: np.ndarray
    blend: np.ndarray


@dataclass(eq=False)
class ReadMoves:
    """The moves of a program, as its lines are read one after the other.

    Attributes
    ----------
    rows : list of lists of floats
        What the line of each move says.
    extrude : list of bool
        Whether material flows from the arrival of each move on.
    dwell : list of floats, s
        Waited there.
    around : list of str
        The lines before, between and after the moves that neither move, switch nor wait.
    """

    rows: list[list[float]] = field(default_factory=list)
    extrude: list[bool] = field(default_factory=list)
    dwell: list[float] = field(default_factory=list)
    around: list[str] = field(default_factory=list)
    _flows: bool = False

    def move(self, row: list[float]) -> None:
        """A line that moves."""
        self.rows.append(row)
        self.extrude.append(self._flows)
        self.dwell.append(0.0)

    def switch(self, flows: bool) -> None:
        """A line that lets material flow, or ends that."""
        self._flows = flows
        if self.extrude:
            self.extrude[-1] = flows

    def wait(self, seconds: float) -> None:
        """A line that waits where the last move went."""
        self.dwell[-1] += seconds

    def require_whole(self, path: PathLike, around: Sequence[str]) -> None:
        """Refuse a program without moves, or with other lines around them than it was written with.

        Parameters
        ----------
        path
            Of the program.
        around
            The lines that set the controller up and that end the program, with ``NAME`` for its name.

        Raises
        ------
        InputError
            If the program is cut short, or a line is missing or one too many; the sentence names the first such line.
        """
        problem = "" if self.rows else "holds no moves"
        for wanted, found in zip_longest(around, self.around):
            if wanted is None:
                problem = problem or f"has a line {found!r} too many"
            elif found is None or not re.fullmatch(re.escape(wanted).replace("NAME", r"\w+"), found):
                problem = problem or f"has no line {wanted!r} in its place"
        if problem:
            raise InputError.at(path, "file", problem, "copy it whole, or plan the job again")


@dataclass(frozen=True)
class Lines:
    """Kinds of lines of a language in which a move says all that is to be known of it; patterns of whole lines.

    Attributes
    ----------
    move
        Its groups are numbers, 0 where one is missing.
    switch, on
        Of the output of the extruder, and what its last group is where material flows.
    wait
        Its group is the time in seconds.
    other
        What stands around the moves.
    nothing
        Comments and empty lines.
    """

    move: re.Pattern[str]
    switch: re.Pattern[str]
    on: str
    wait: re.Pattern[str]
    other: re.Pattern[str]
    nothing: re.Pattern[str]


def read_moves(path: PathLike, lines: Lines) -> ReadMoves:
    """Read the moves of a program.

    Raises
    ------
    InputError
        If the file is missing or holds a line of another kind.
    """
    read = ReadMoves()
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = line.strip()
        if match := lines.move.fullmatch(text):
            read.move([float(word or 0.0) for word in match.groups()])
        elif match := lines.switch.fullmatch(text):
            read.switch(match.groups()[-1] == lines.on)
        elif (match := lines.wait.fullmatch(text)) and read.rows:
            read.wait(float(match.group(1)))
        elif lines.other.fullmatch(text):
            read.around.append(text)
        elif not lines.nothing.fullmatch(text):
            raise not_understood(path, number, text)
    return read


def not_understood(path: PathLike, number: int, text: str) -> InputError:
    """What to tell of a line that no program of FrameTwin has."""
    return InputError.at(path, f"line {number}", f"{text[:60]!r} is not understood", "give a program of FrameTwin")


@dataclass(frozen=True)
class Move:
    """A straight move, and what is done after it.

    Attributes
    ----------
    position : list of 3 floats, mm
        In the robot's base.
    rotation : (3, 3) array
        Of the tool in the base; z points out of the nozzle.
    speed : float, mm/s
    blend : float, mm
        0 for a stop.
    switch : bool or None
        Whether material flows from here on, where that changes.
    dwell : float, s
    """

    position: list[float]
    rotation: np.ndarray
    speed: float
    blend: float
    switch: bool | None
    dwell: float


def moves_of(waypoints: Waypoints, limits: Workspace) -> Iterator[Move]:
    """The moves of waypoints in the robot's base, from one without material on."""
    flows = False
    rows = zip(
        limits.positions(waypoints).tolist(),
        limits.rotations(waypoints),
        waypoints.speed.tolist(),
        blend_radii(waypoints).tolist(),
        waypoints.extrude.tolist(),
        waypoints.dwell.tolist(),
        strict=True,
    )
    for position, rotation, speed, blend, extrude, dwell in rows:
        switch = extrude if extrude != flows else None
        yield Move(position, rotation, speed, blend if blend >= LEAST_BLEND else 0.0, switch, dwell)
        flows = extrude


def blend_radii(waypoints: Waypoints) -> np.ndarray:
    """Find blend radii (N,) in mm: within a strut, where nothing is switched or awaited; 0 elsewhere."""
    result = np.zeros(len(waypoints))
    inner, after = np.arange(1, len(waypoints) - 1), np.arange(2, len(waypoints))
    way = np.linalg.norm(np.diff(waypoints.position, axis=0), axis=1)
    passes = (waypoints.kind[inner] == PRINT) & (waypoints.kind[after] == PRINT)
    passes &= (waypoints.strut[inner] == waypoints.strut[after]) & (waypoints.dwell[inner] == 0.0)
    passes &= waypoints.extrude[inner] == waypoints.extrude[inner - 1]
    result[inner] = np.where(passes, BLEND * np.minimum(way[:-1], way[1:]), 0.0)
    return result


def rounded_down(value: float, digits: int) -> str:
    """So many digits after the point, never more than asked for, and never 0."""
    unit = 10**digits
    return f"{max(1, int(value * unit + 1e-6)) / unit:.{digits}f}"


def heading(waypoints: Waypoints) -> list[str]:
    """What a program says about itself, a line each, in words that any comment takes."""
    struts = [str(strut) for strut in waypoints.struts]
    shown = " ".join(struts[:12]) + (" ..." if len(struts) > 12 else "")
    return [
        f"FrameTwin, batch {waypoints.batch}, {len(struts)} struts: {shown}",
        f"{len(waypoints)} waypoints, about {waypoints.seconds:.0f} s; mm in the robot's base",
    ]
