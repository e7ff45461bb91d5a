"""FrameTwin's own frame file, ``frame.json`` (format ``frametwin-frame``, version 1): z up, lengths in mm.

A file may state another ``unit``; it is converted when it is read, and never written.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json
from frametwin.geometry.wireframe import Wireframe, straight_control_points

FORMAT = "frametwin-frame"
VERSION = 1

_REQUIRED = ("vertices", "edges", "radius")
_OPTIONAL = ("control_points", "printed", "grounded", "batch", "name")
_LENGTHS = {"vertices": (None, 3), "control_points": (None, 4, 3), "radius": (None,)}
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Millimetres in each of the units of length that a file may state."""

_REMARKS = ("format", "version", "comment", "source", "license", "provenance")  # not interpreted


def read(path: PathLike) -> Wireframe:
    """Read a frame file.

    Raises
    ------
    InputError
        If the file is missing or damaged, of another format or version, or does not hold a valid frame.
    """
    return parse(read_json(path), path)


def parse(data: dict[str, Any], path: PathLike) -> Wireframe:
    """Build the frame from the parsed file; ``path`` gives it its name, unless the file does, and is in
    messages.

    Raises
    ------
    InputError
        As `read`.
    """
    check_format(data, path, FORMAT, VERSION)
    for key in _REQUIRED:
        if data.get(key) is None:
            raise InputError.at(path, key, "is missing", f'add "{key}" to the file')
    known = (*_REQUIRED, *_OPTIONAL, "unit", *_REMARKS)
    for key, value in data.items():
        if key not in known:
            near = difflib.get_close_matches(key, known, 1)
            remedy = f"write '{near[0]}', or remove it" if near else "remove it, or put it under 'comment'"
            raise InputError.at(path, key, "is not a field of a frame file", remedy)
        if value is None:
            raise InputError.at(path, key, "is null", "give it a value, or remove it")
    name = data.get("name", _default_name(Path(path)))
    fields = {key: data[key] for key in (*_REQUIRED, *_OPTIONAL) if key in data and key != "name"}
    return Wireframe.create(**_in_millimetres(fields, unit_of(data, path), path), name=name, source=str(path))


def unit_of(data: Mapping[str, Any], path: PathLike) -> str:
    """Unit of the lengths in a parsed file, one of `UNITS`.

    Raises
    ------
    InputError
        If it is another one.
    """
    unit = data.get("unit", "mm")
    if not isinstance(unit, str) or unit not in UNITS:
        raise InputError.at(path, "unit", f"{unit!r} is not known", "write 'mm', 'cm', 'm' or 'in'")
    return unit


def _in_millimetres(fields: dict[str, Any], unit: str, path: PathLike) -> dict[str, Any]:
    if unit == "mm":
        return fields  # bit by bit as they are
    converted = dict(fields)
    for key in _LENGTHS.keys() & fields.keys():
        shape = _LENGTHS[key] if isinstance(fields[key], list) else ()
        converted[key] = UNITS[unit] * checked_array(fields[key], "f", shape, str(path), key)
    return converted


def _default_name(path: Path) -> str:
    """Take the name of the file, or of its folder where the file has a name that every capture has."""
    if path.stem in ("frame", "truth"):
        return path.resolve().parent.name or "frame"
    return path.stem


def to_dict(frame: Wireframe) -> dict[str, Any]:
    """Return the content of a frame file; fields with their default value are left out."""
    data: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": frame.name,
        "vertices": frame.vertices,
        "edges": frame.edges,
        "radius": float(frame.radius[0]) if np.all(frame.radius == frame.radius[0]) else frame.radius,
    }
    if not np.array_equal(frame.control_points, straight_control_points(frame.vertices, frame.edges)):
        data["control_points"] = frame.control_points
    if not frame.printed.all():
        data["printed"] = frame.printed
    data["grounded"] = frame.grounded
    if frame.batch.any():
        data["batch"] = frame.batch
    return data


def write(path: PathLike, frame: Wireframe) -> None:
    """Write a frame file; reading it gives back the same bits.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_json(path, to_dict(frame))
