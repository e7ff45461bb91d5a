"""The pairs of text files of RL3DPToolpathPlanner (Huang et al., ACM TOG 43(6), 2024).

``Node*.txt`` has ``x y z`` on each line, ``Edge*.txt`` two 0-based vertex indices; no header, no unit (mm).
"""

from __future__ import annotations

import math
from pathlib import Path

from frametwin.errors import InputError
from frametwin.files import PathLike, read_text
from frametwin.geometry.wireframe import Wireframe

_OTHER = {"node": "edge", "edge": "node"}


def is_name(name: str) -> bool:
    """True if a file is named like one of a pair: ``Node*.txt`` or ``Edge*.txt``, in any case."""
    return name[:4].lower() in _OTHER and name.lower().endswith(".txt")


def sibling(path: Path) -> Path:
    """Name the other file of the pair, in the same style of capitals.

    Raises
    ------
    InputError
        If there is no such file.
    """
    word = path.name[:4]
    other = _OTHER[word.lower()]
    other = other.upper() if word.isupper() else other.capitalize() if word[0].isupper() else other
    result = path.with_name(other + path.name[4:])
    if not result.is_file():
        raise InputError.at(path, "file", f"its other half {result.name} is missing", "put it in the same folder")
    return result


def read_pair(first: PathLike, second: PathLike) -> Wireframe:
    """Read the two files of a pair, given in either order.

    Raises
    ------
    InputError
        If their names do not say which is which, or either is missing, damaged, or does not fit the other.
    """
    pair = {Path(path).name[:4].lower(): Path(path) for path in (first, second)}
    if set(pair) != set(_OTHER):
        raise InputError.at(
            first,
            "file",
            "the two files are not named Node*.txt and Edge*.txt",
            "rename them, or give another pair",
        )
    vertices = _read_rows(pair["node"], 3, float, "a number")
    edges = _read_rows(pair["edge"], 2, int, "a vertex index")
    name = pair["node"].stem[4:].strip("_- ").removesuffix("_wireframe") or "frame"
    return Wireframe.create(vertices, edges, name=name, source=str(pair["edge"]))


def _read_rows(path: Path, width: int, convert: type, what: str) -> list[list[float]]:
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words:
            continue
        field = f"line {number}"
        if len(words) != width:
            raise InputError.at(
                path,
                field,
                f"has {len(words)} values instead of {width}",
                f"write {width} numbers on each line",
            )
        try:
            row = [convert(word) for word in words]
        except ValueError as error:
            raise InputError.at(path, field, f"{line.strip()!r} is not {what} {width} times", "correct it") from error
        if not all(abs(value) < math.inf for value in row):
            raise InputError.at(path, field, "holds a number that is not finite", "replace it by a finite number")
        rows.append(row)
    if not rows:
        raise InputError.at(path, "file", "is empty", "give a file with a row for each node or edge")
    return rows
