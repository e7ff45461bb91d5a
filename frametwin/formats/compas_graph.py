"""The JSON of COMPAS graphs: ``Graph`` of COMPAS 2, and ``Network`` of the versions before.

COMPAS 2 writes ``{"dtype": "compas.datastructures/Graph", "data": {...}}``, COMPAS 1 ``Network`` and ``value``, its
first versions ``datatype`` and ``data``, or the bare data. The data have ``node``, the attributes of each node by its
key, and ``edge``, those of each edge by the keys of its two nodes. COMPAS itself is not needed.

Source: ``compas.datastructures.Graph`` in COMPAS 2.15, and the changelog of COMPAS.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import LARGEST, is_plain_text
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.formats.assembly import millimetres
from frametwin.geometry.wireframe import Wireframe

_CLASSES = ("Graph", "Network", "FrameGraph")
_NODES = ("node", "vertex")
_DEFAULTS = ("default_node_attributes", "dna", "dva")
_REMEDY = "dump a compas.datastructures.Graph again, by compas.json_dump"


def is_compas(data: dict[str, Any]) -> bool:
    """True if the parsed file looks like something of COMPAS's, a graph or not."""
    kind = _kind(data)
    bare = isinstance(data.get("edge"), dict) and any(isinstance(data.get(key), dict) for key in _NODES)
    return "format" not in data and (kind.startswith("compas") or bare)


def parse(data: dict[str, Any], path: PathLike) -> Wireframe:
    """Build the frame from the parsed file.

    Nodes are joints and edges struts, in the order of the file; an edge and the one back are one strut. The attribute
    ``unit`` of the graph is heeded, where it has one, otherwise lengths are taken to be in mm.

    Raises
    ------
    InputError
        If the file holds something else of COMPAS's, or a node or an edge is damaged.
    """
    content = _content(data, path)
    key = next((key for key in _NODES if isinstance(content.get(key), dict)), None)
    if key is None or not isinstance(content.get("edge"), dict):
        raise InputError.at(path, "node" if key is None else "edge", "is not an object with keys", _REMEDY)
    nodes = content[key]
    default: dict[str, Any] = next((content[name] for name in _DEFAULTS if isinstance(content.get(name), dict)), {})
    vertices = [_place(value, default, f"{key}.{name}", path) for name, value in nodes.items()]
    index = {name: i for i, name in enumerate(nodes)}
    return Wireframe.create(
        np.array(vertices, dtype=np.float64).reshape(-1, 3) * _scale(data, path),
        _edges(content["edge"], index, path),
        name=_name(data, content, path),
        source=str(path),
    )


def unit_of(data: dict[str, Any], path: PathLike) -> str | None:
    """The unit that the graph states, if it does and it is not the millimetre."""
    unit = _attributes(_content(data, path)).get("unit")
    return None if unit is None or _scale(data, path) == 1.0 else str(unit)


def _kind(data: dict[str, Any]) -> str:
    kind = data.get("dtype", data.get("datatype"))
    return kind if isinstance(kind, str) else ""


def _content(data: dict[str, Any], path: PathLike) -> dict[str, Any]:
    kind = _kind(data)
    if not kind:
        return data
    if kind.rpartition("/")[2] not in _CLASSES:
        raise InputError.at(path, "dtype", f"is {kind[:80]!r}, not a graph", _REMEDY)
    content = data.get("data", data.get("value"))
    if not isinstance(content, dict):
        raise InputError.at(path, "data", "is not an object", _REMEDY)
    return content


def _attributes(content: dict[str, Any]) -> dict[str, Any]:
    attributes = content.get("attributes")
    return attributes if isinstance(attributes, dict) else {}


def _scale(data: dict[str, Any], path: PathLike) -> float:
    """Millimetres in one of the graph's units."""
    unit = _attributes(_content(data, path)).get("unit")
    return 1.0 if unit is None else millimetres(unit, str(path), "attributes.unit")


def _name(data: dict[str, Any], content: dict[str, Any], path: PathLike) -> str:
    for name in (data.get("name"), _attributes(content).get("name")):
        if is_plain_text(name) and name not in _CLASSES:  # the class's name is given to graphs without one
            return str(name)
    return Path(path).stem


def _place(value: Any, default: dict[str, Any], field: str, path: PathLike) -> list[float]:
    own = value if isinstance(value, dict) else {}
    place = [own.get(axis, default.get(axis, 0.0)) for axis in "xyz"]
    if (value is not None and not isinstance(value, dict)) or not all(_is_number(item) for item in place):
        raise InputError.at(path, field, "has no place", "give x, y and z as finite numbers")
    return place


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _edges(data: dict[str, Any], index: dict[str, int], path: PathLike) -> np.ndarray:
    """The struts (E, 2), each once."""
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for start, ends in data.items():
        if not isinstance(ends, dict):
            raise InputError.at(path, f"edge.{start}", "is not an object with keys", _REMEDY)
        for end in ends:
            unknown = [name for name in (start, end) if name not in index]
            if unknown:
                problem = f"names the node {unknown[0]}, which does not exist"
                raise InputError.at(path, f"edge.{start}", problem, "add the node, or remove the edge")
            a, b = index[start], index[end]
            if a == b:
                raise InputError.at(path, f"edge.{start}", "leads from a node to itself", "remove it")
            found.setdefault((min(a, b), max(a, b)), (a, b))
    return np.array(list(found.values()), dtype=np.int64).reshape(-1, 2)
