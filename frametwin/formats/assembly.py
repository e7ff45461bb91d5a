"""The JSON of assembly_instances and conmech, in its older and newer dialect.

Older: ``node_list[{point {X, Y, Z}, node_id?, is_grounded}]``, ``element_list[{end_node_ids, layer_id}]``.
Newer: ``nodes[{point [x, y, z], node_ind, is_grounded}]``, ``elements[{end_node_inds, layer_ind}]``.
Both state a ``unit``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import LARGEST, is_plain_text
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe

_MILLIMETRES = {
    "millimeter": 1.0,
    "millimetre": 1.0,
    "mm": 1.0,
    "centimeter": 10.0,
    "centimetre": 10.0,
    "cm": 10.0,
    "meter": 1000.0,
    "metre": 1000.0,
    "m": 1000.0,
    "inch": 25.4,
    "in": 25.4,
    "foot": 304.8,
    "ft": 304.8,
}


@dataclass(frozen=True)
class _Dialect:
    nodes: str
    node_id: str
    elements: str
    ends: str
    layer: str


_DIALECTS = (
    _Dialect("node_list", "node_id", "element_list", "end_node_ids", "layer_id"),
    _Dialect("nodes", "node_ind", "elements", "end_node_inds", "layer_ind"),
)


def is_assembly(data: dict[str, Any]) -> bool:
    """True if the parsed file looks like one of the two dialects."""
    return "format" not in data and any(d.nodes in data or d.elements in data for d in _DIALECTS)


def parse(data: dict[str, Any], path: PathLike) -> Wireframe:
    """Build the frame from the parsed file.

    Node ids need not be indices: where they are given, elements refer to them, otherwise the position
    counts. The layer becomes the batch, by rank. The radius is that of a round section of the stated area,
    where one is stated.

    Raises
    ------
    InputError
        If the unit is missing or unknown, or a field is missing, of a wrong type, or names an unknown node.
    """
    source = str(path)
    dialect = next(d for d in _DIALECTS if d.nodes in data or d.elements in data)
    scale = millimetres(data.get("unit"), source, "unit")
    nodes = _objects(data, dialect.nodes, source)
    elements = _objects(data, dialect.elements, source)
    vertices = [_point(node, f"{dialect.nodes}[{i}].point", source) for i, node in enumerate(nodes)]
    name = data.get("model_name")
    return Wireframe.create(
        np.array(vertices, dtype=np.float64).reshape(-1, 3) * scale,
        _edges(elements, dialect, _node_index(nodes, dialect, source), source),
        radius=_radius(data, source),
        grounded=_grounded(nodes, dialect, source),
        batch=_batch(elements, dialect, source),
        name=str(name) if is_plain_text(name) else Path(path).stem,
        source=source,
    )


def millimetres(unit: Any, source: str, field: str) -> float:
    """Millimetres in one unit."""
    if unit is None:
        raise InputError.at(source, field, "is missing", f'add "{field}": "millimeter" or "meter"')
    word = unit.strip().lower() if isinstance(unit, str) else unit
    if isinstance(word, str):
        word = word if word in _MILLIMETRES else word.removesuffix("s")
        word = "inch" if word == "inche" else "foot" if word == "feet" else word
    if not isinstance(word, str) or word not in _MILLIMETRES:
        raise InputError.at(source, field, f"{unit!r} is not a known unit", "write 'millimeter' or 'meter'")
    return _MILLIMETRES[word]


def _objects(data: dict[str, Any], key: str, source: str) -> list[dict[str, Any]]:
    items = data.get(key)
    if items is None:
        raise InputError.at(source, key, "is missing", "give both the nodes and the elements")
    if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
        raise InputError.at(source, key, "is not a list of objects", "write [{...}, {...}]")
    return items


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _is_index(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _point(node: dict[str, Any], field: str, source: str) -> list[float]:
    point = node.get("point")
    values = [point.get(axis) for axis in "XYZ"] if isinstance(point, dict) else point
    if not isinstance(values, list) or len(values) != 3 or not all(_is_number(value) for value in values):
        raise InputError.at(
            source, field, "is not a point", 'write {"X": number, "Y": number, "Z": number} or three numbers'
        )
    return values


def _node_index(nodes: list[dict[str, Any]], dialect: _Dialect, source: str) -> dict[int, int]:
    """Map node ids to positions."""
    given = [dialect.node_id in node for node in nodes]
    if not any(given):
        return {i: i for i in range(len(nodes))}
    index: dict[int, int] = {}
    for i, node in enumerate(nodes):
        field = f"{dialect.nodes}[{i}].{dialect.node_id}"
        key = node.get(dialect.node_id)
        if not isinstance(key, int) or isinstance(key, bool):
            problem = "is not a whole number" if given[i] else "is missing, while other nodes have it"
            raise InputError.at(source, field, problem, "give every node an id, or none")
        if key in index:
            raise InputError.at(source, field, f"{key} is taken by another node", "give every node its own id")
        index[key] = i
    return index


def _edges(elements: list[dict[str, Any]], dialect: _Dialect, index: dict[int, int], source: str) -> np.ndarray:
    edges = np.zeros((len(elements), 2), dtype=np.int64)
    for i, element in enumerate(elements):
        field = f"{dialect.elements}[{i}].{dialect.ends}"
        ends = element.get(dialect.ends)
        if not isinstance(ends, list) or len(ends) != 2 or not all(_is_index(end) for end in ends):
            raise InputError.at(source, field, "is not a pair of node ids", "write [id, id]")
        unknown = [end for end in ends if end not in index]
        if unknown:
            raise InputError.at(source, field, f"names node {unknown[0]}, which does not exist", "correct the id")
        edges[i] = [index[end] for end in ends]
    return edges


def _optional(
    items: list[dict[str, Any]], key: str, where: str, source: str, good: Callable[[Any], bool], wanted: str
) -> list[Any] | None:
    """Collect a field that all items have or none has."""
    if not any(key in item for item in items):
        return None
    values = [item.get(key) for item in items]
    for i, value in enumerate(values):
        if not good(value):
            problem = f"is not {wanted}" if key in items[i] else "is missing, while others have it"
            raise InputError.at(source, f"{where}[{i}].{key}", problem, f"give {wanted} everywhere, or nowhere")
    return values


def _grounded(nodes: list[dict[str, Any]], dialect: _Dialect, source: str) -> np.ndarray | None:
    values = _optional(
        nodes,
        "is_grounded",
        dialect.nodes,
        source,
        lambda v: isinstance(v, bool) or (_is_index(v) and v in (0, 1)),
        "true or false (or 1 or 0)",
    )
    return None if values is None else np.array(values, dtype=bool)


def _batch(elements: list[dict[str, Any]], dialect: _Dialect, source: str) -> np.ndarray | None:
    values = _optional(elements, dialect.layer, dialect.elements, source, _is_index, "a whole number")
    return None if values is None else np.unique(values, return_inverse=True)[1].astype(np.int64)


def _radius(data: dict[str, Any], source: str) -> float | None:
    """Radius in mm of the one round section that the file states, if it does."""
    material = data.get("material_properties")
    sections = data.get("cross_secs")
    if isinstance(material, dict) and "cross_sec_area" in material:
        field = "material_properties.cross_sec_area"
        found = [(material["cross_sec_area"], material.get("cross_sec_area_unit"))]
    elif isinstance(sections, list) and all(isinstance(section, dict) for section in sections):
        field = "cross_secs.A"
        found = [(section.get("A"), section.get("A_unit")) for section in sections]
    else:
        return None
    if not found or any(other != found[0] for other in found):
        return None  # several sections: which strut has which is a matter of tags that are often empty
    area, unit = found[0]
    if area is None:
        return None
    if not _is_number(area) or area <= 0:
        raise InputError.at(source, field, f"{area!r} is not an area", "give a number above 0, or remove it")
    length = unit.strip().removesuffix("2").removesuffix("^") if isinstance(unit, str) else unit
    return math.sqrt(area / math.pi) * millimetres(length, source, f"{field}_unit")
