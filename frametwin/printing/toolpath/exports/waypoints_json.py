"""Waypoints as JSON: format ``frametwin-waypoints``, version 1; mm, seconds, the coordinates of the print."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, dump_json, read_json
from frametwin.printing.toolpath.waypoints import KINDS, Waypoints
from frametwin.printing.toolpath.workspace import Workspace

FORMAT = "frametwin-waypoints"
VERSION = 1


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The file's text; floats read back bit for bit."""
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "workspace": limits.as_dict()}
    for field in fields(waypoints):
        data[field.name] = getattr(waypoints, field.name)
    data["kind"] = [KINDS[kind] for kind in waypoints.kind.tolist()]
    data["contacts"] = list(waypoints.contacts)
    return dump_json(data)


def read_waypoints(path: PathLike) -> Waypoints:
    """Read a waypoint file.

    Raises
    ------
    InputError
        If the file is missing or damaged, of another format or version, or does not hold valid waypoints.
    """
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    names = [field.name for field in fields(Waypoints)]
    for name in names:
        if name not in data:
            raise InputError.at(path, name, "is missing", f'add "{name}" to the file')
    values = {name: data[name] for name in names}
    if not isinstance(values["kind"], list) or not all(kind in KINDS for kind in values["kind"]):
        raise InputError.at(path, "kind", "holds an unknown kind of move", f"give {', '.join(KINDS)}")
    values["kind"] = np.array([KINDS.index(kind) for kind in values["kind"]], dtype=np.int64)
    if not isinstance(values["contacts"], list) or not all(isinstance(text, str) for text in values["contacts"]):
        raise InputError.at(path, "contacts", "is no list of texts", "give a list")
    values["contacts"] = tuple(values["contacts"])
    if not isinstance(values["position"], list) or not isinstance(values["batch"], int):
        raise InputError.at(path, "batch", "or the positions are of a wrong type", "give a whole number and a list")
    return Waypoints(**values, source=str(path))
