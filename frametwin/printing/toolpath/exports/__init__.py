"""Waypoints for robots and for other programs.

============  =============  =============================================================================
format        file           what
============  =============  =============================================================================
``json``      ``.json``      everything, in the coordinates of the print, mm; read back by `read_waypoints`
``urscript``  ``.script``    a program for controllers of Universal Robots: m, m/s, axis times angle
``gcode``     ``.gcode``     mm, relative extrusion; the tool's axis in comments
``rapid``     ``.mod``       a module for controllers of ABB: mm, mm/s, quaternions
``krl``       ``.src``       a program for controllers of KUKA: mm, m/s, angles A, B, C
``compas``    ``.json``      COMPAS frames, a graph of what is laid, m
============  =============  =============================================================================

`frametwin.printing.toolpath.exports.assembly` writes a whole frame with its batches, and no waypoints.
"""

from __future__ import annotations

from pathlib import Path

from frametwin.errors import InputError
from frametwin.files import PathLike, write_text
from frametwin.printing.toolpath.exports import compas, gcode, krl, rapid, urscript, waypoints_json
from frametwin.printing.toolpath.exports.waypoints_json import read_waypoints
from frametwin.printing.toolpath.waypoints import Waypoints
from frametwin.printing.toolpath.workspace import Workspace

__all__ = ["SUFFIXES", "read_waypoints", "write_waypoints"]

_FORMATTERS = {
    "json": waypoints_json.to_text, "urscript": urscript.to_text, "gcode": gcode.to_text, "rapid": rapid.to_text,
    "krl": krl.to_text, "compas": compas.to_text,
}  # fmt: skip
SUFFIXES = {
    "json": ".json", "urscript": ".script", "gcode": ".gcode", "rapid": ".mod", "krl": ".src", "compas": ".json",
}  # fmt: skip


def write_waypoints(path: PathLike, waypoints: Waypoints, format: str, limits: Workspace) -> Path:
    """Write waypoints in one of the formats above, whole or not at all.

    Parameters
    ----------
    path
        The file.
    waypoints
        What to write.
    format
        One of `SUFFIXES`.
    limits
        Where the robot may go, how fast, and where the print stands in its base.

    Raises
    ------
    InputError
        If anything is outside of the limits, the format is unknown, or the file cannot be written.
    """
    if format not in _FORMATTERS:
        raise InputError.at(path, "format", f"{format!r} is unknown", f"give one of {', '.join(_FORMATTERS)}")
    limits.check(waypoints)
    write_text(path, _FORMATTERS[format](waypoints, limits))
    return Path(path)
