"""Wavefront OBJ: struts as ``l`` lines, or the edges of polygons (``f``). No unit: taken to be mm, z up."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_text, write_text
from frametwin.geometry import bezier
from frametwin.geometry.flattening import ROUNDING, is_straight
from frametwin.geometry.wireframe import Wireframe

CURVE_SEGMENTS = 16
"""Straight pieces that a curved strut is written with."""


@dataclass
class _Content:
    """What an OBJ file holds: positions, and chains of vertex indices with the number of their line."""

    vertices: list[list[float]] = field(default_factory=list)
    lines: list[tuple[int, list[int]]] = field(default_factory=list)
    faces: list[tuple[int, list[int]]] = field(default_factory=list)
    curves: bool = False


def read(path: PathLike) -> Wireframe:
    """Read the struts of an OBJ file.

    Polylines are split into struts, one for each piece. A file without ``l`` lines gives the edges of its
    polygons, each once. Vertices at the same place are merged, since many programs write each line with
    vertices of its own.

    Raises
    ------
    InputError
        If the file is missing or damaged, or holds neither lines nor faces.
    """
    content = _parse(Path(path))
    if not content.lines and not content.faces:
        if not content.vertices:
            problem = "holds no vertices"
        elif content.curves:
            problem = "holds free-form curves and no lines"
        else:
            problem = "holds points but neither lines nor faces, such as the control points of a single curve"
        raise InputError.at(path, "file", problem, "write every strut as an 'l' line between two vertices")
    vertices, merged = _merge(content.vertices)
    edges = _line_edges(content.lines, merged, path) if content.lines else _face_edges(content.faces, merged)
    name = Path(path).stem
    return Wireframe.create(vertices, edges, name=name, source=str(path))


def _parse(path: Path) -> _Content:
    content = _Content()
    for number, line in enumerate(read_text(path).replace("\\\n", " ").splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        keyword, values = words[0], words[1:]
        if keyword == "v":
            content.vertices.append(_position(values, path, number))
        elif keyword == "l":
            content.lines.append((number, _chain(values, 2, len(content.vertices), path, number)))
        elif keyword == "f":
            content.faces.append((number, _chain(values, 3, len(content.vertices), path, number)))
        elif keyword in ("curv", "curv2", "surf"):
            content.curves = True
    return content


def _position(words: list[str], path: Path, number: int) -> list[float]:
    try:
        position = [float(word) for word in words[:3]]
    except ValueError:
        position = []
    if len(position) != 3 or not np.isfinite(position).all():
        raise InputError.at(path, f"line {number}", "is not a vertex", "write 'v x y z' with finite numbers")
    return position


def _chain(words: list[str], least: int, known: int, path: Path, number: int) -> list[int]:
    """Read vertex references: from 1, or negative from the latest vertex back; ``v/vt/vn`` is allowed."""
    try:
        indices = [int(word.split("/")[0]) for word in words]
    except ValueError:
        indices = []
    if len(indices) < least:
        raise InputError.at(
            path,
            f"line {number}",
            f"does not name {least} or more vertices",
            "write their numbers, counted from 1",
        )
    chain = [index - 1 if index > 0 else known + index for index in indices]
    for index, position in zip(indices, chain, strict=True):
        if index == 0 or not 0 <= position < known:
            raise InputError.at(
                path,
                f"line {number}",
                f"names vertex {index}, which is not above it",
                f"use numbers from 1 to {known}",
            )
    return chain


def _merge(vertices: list[list[float]]) -> tuple[np.ndarray, np.ndarray]:
    """Merge vertices at exactly the same place: the distinct ones in order, and the new index of each."""
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3) + 0.0  # -0.0 is the same place as 0.0
    _, first, group = np.unique(points, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return points[np.sort(first)], rank[group.ravel()]


def _line_edges(lines: list[tuple[int, list[int]]], merged: np.ndarray, path: PathLike) -> list[list[int]]:
    seen: dict[tuple[int, int], int] = {}
    edges = []
    for number, chain in lines:
        places = [int(merged[i]) for i in chain]
        for a, b in pairwise(places):
            key = (min(a, b), max(a, b))
            if a == b:
                raise InputError.at(path, f"line {number}", "holds a strut without length", "remove it")
            if key in seen:
                raise InputError.at(
                    path, f"line {number}", f"repeats a strut of line {seen[key]}", "remove one of the two"
                )
            seen[key] = number
            edges.append([a, b])
    return edges


def _face_edges(faces: list[tuple[int, list[int]]], merged: np.ndarray) -> list[list[int]]:
    """List each side of the polygons once, in the order of the file."""
    seen: dict[tuple[int, int], None] = {}
    for _, chain in faces:
        places = [int(merged[i]) for i in chain]
        for a, b in zip(places, places[1:] + places[:1], strict=True):
            if a != b:
                seen.setdefault((min(a, b), max(a, b)))
    return [list(key) for key in seen]


def write(path: PathLike, frame: Wireframe, unit: str = "mm", curves: np.ndarray | None = None) -> None:
    """Write the struts as ``l`` lines: two vertices for a straight strut, a polyline for a curved one.

    Radius, print state and batches have no place in this format.

    Parameters
    ----------
    path
        The file.
    frame
        The frame.
    unit
        What a comment calls its lengths.
    curves : (E, n + 1, 3) array, optional
        Its struts by curves of a higher degree, such as a twin's; those of ``frame`` by default.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    curves = frame.control_points if curves is None else curves
    words = frame.name.replace("\\", " ").split()  # of one line: readers take a last backslash for a line that goes on
    lines = [f"# {' '.join(words)}: {frame.strut_count} struts, {unit}, z up", f"o {'_'.join(words) or 'frame'}"]
    lines += [_vertex_line(point) for point in frame.vertices]
    count = frame.vertex_count
    u = np.linspace(0.0, 1.0, CURVE_SEGMENTS + 1)[1:-1]
    struts = []
    straight = is_straight(curves, ROUNDING * frame.chord_lengths)
    for (a, b), curve, plain in zip(frame.edges.tolist(), curves, straight, strict=True):
        chain = [a + 1]
        if not plain:
            lines += [_vertex_line(point) for point in bezier.evaluate(curve, u)]
            chain += range(count + 1, count + len(u) + 1)
            count += len(u)
        struts.append("l " + " ".join(str(i) for i in [*chain, b + 1]))
    write_text(path, "\n".join(lines + struts) + "\n")


def _vertex_line(point: np.ndarray) -> str:
    return "v " + " ".join(repr(value) for value in point.tolist())
