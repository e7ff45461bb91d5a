"""Waypoints for COMPAS, without COMPAS: a list of frames and a graph, as its JSON of version 2 has them.

``compas.json_load`` gives back a dictionary with ``frames``, a ``compas.geometry.Frame`` for each waypoint (the
tool's z out of the nozzle), lists of numbers beside them, and ``graph``, a ``compas.datastructures.Graph`` of the
struts of the batch as they are laid: nodes with x, y, z, directed edges with ``strut`` and ``order``. Lengths are in
m, as compas_fab wants them, in the robot's base.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.files import PathLike, dump_json, read_json
from frametwin.printing.toolpath.waypoints import APPROACH, KINDS, PRINT, Waypoints
from frametwin.printing.toolpath.workspace import Workspace

_FRAME, _GRAPH = "compas.geometry/Frame", "compas.datastructures/Graph"


def to_text(waypoints: Waypoints, limits: Workspace) -> str:
    """The file's text."""
    points = limits.positions(waypoints) / 1000.0
    turns = limits.rotations(waypoints)
    data: dict[str, Any] = {
        "unit": "m",
        "batch": waypoints.batch,
        "frames": [
            {"dtype": _FRAME, "data": {"point": point, "xaxis": turn[0], "yaxis": turn[1]}}
            for point, turn in zip(points.tolist(), np.swapaxes(turns, 1, 2).tolist(), strict=True)
        ],
        "graph": _graph(waypoints, points),
        "speed": waypoints.speed / 1000.0,
        "extrude": waypoints.extrude,
        "dwell": waypoints.dwell,
        "kind": [KINDS[kind] for kind in waypoints.kind.tolist()],
        "strut": waypoints.strut,
    }
    return dump_json(data)


def read_compas_frames(path: PathLike) -> tuple[np.ndarray, np.ndarray]:
    """Read positions (N, 3) in m and rotations (N, 3, 3) of the frames in a file.

    Raises
    ------
    InputError
        If the file is missing or damaged, or holds no frames.
    """
    frames = read_json(path).get("frames")
    try:
        data = [frame["data"] for frame in frames if frame["dtype"] == _FRAME]  # type: ignore[union-attr]
        points, x, y = (np.array([item[key] for item in data]).reshape(-1, 3) for key in ("point", "xaxis", "yaxis"))
    except (TypeError, KeyError, ValueError) as error:
        raise InputError.at(path, "frames", "is no list of COMPAS frames", "give a file of FrameTwin") from error
    return points, np.stack([x, y, np.cross(x, y)], axis=2)


def read_compas_moves(path: PathLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read speeds (N,) in m/s, whether material flows from each waypoint on (N,), and pauses (N,) in s.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    data = read_json(path)
    speed = checked_array(data.get("speed"), "f", (None,), str(path), "speed")
    extrude = checked_array(data.get("extrude"), "b", (len(speed),), str(path), "extrude")
    return speed, extrude, checked_array(data.get("dwell"), "f", (len(speed),), str(path), "dwell")


def _graph(waypoints: Waypoints, points: np.ndarray) -> dict[str, Any]:
    """The laid struts, with the waypoints at their ends as nodes; struts that meet share one."""
    node: dict[str, dict[str, Any]] = {}
    edge: dict[str, dict[str, dict[str, Any]]] = {}
    known: dict[tuple[float, ...], str] = {}

    def key(n: int) -> str:
        place = tuple(np.round(points[n], 9).tolist())
        if place not in known:
            known[place] = str(len(known))
            node[known[place]] = dict(zip("xyz", points[n].tolist(), strict=True))
            edge[known[place]] = {}
        return known[place]

    on_strut = np.isin(waypoints.kind, (APPROACH, PRINT))
    for order, strut in enumerate(waypoints.struts.tolist()):
        rows = np.flatnonzero(on_strut & (waypoints.strut == strut))
        start, end = key(int(rows[0])), key(int(rows[-1]))
        edge[start][end] = {"strut": strut, "order": order}
    attributes = {"name": f"batch {waypoints.batch}"}
    data = {
        "attributes": attributes, "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "default_edge_attributes": {}, "node": node, "edge": edge, "max_node": len(node) - 1,
    }  # fmt: skip
    return {"dtype": _GRAPH, "data": data}
