"""Frames of drawn lines: chains of points, as programs for drawing have them, joined where their points meet."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe

ROUNDING = 1e-6
"""Points are one joint within this share of the drawing's extent: what exporting and unit conversion round to."""

LARGEST_TOLERANCE = 1e-4
"""Share of the extent up to which a drawing's own tolerance is believed."""

MOST_PIECES = 1_000_000
"""Struts of a drawing, blocks counted as often as they are placed; what has more is damaged."""

DEEPEST = 32
"""Blocks within blocks."""

BENT = "draw its struts as straight lines or polylines, or turn it into a polyline"


@dataclass(frozen=True)
class Chain:
    """A line or polyline of a drawing.

    Attributes
    ----------
    name : str
        What to call it in messages.
    points : (N, 3) array
        In the drawing's unit; N is at least 2.
    """

    name: str
    points: np.ndarray


@dataclass(frozen=True)
class Drawing:
    """What a drawing holds.

    Attributes
    ----------
    chains : tuple of Chain
    unit : str
        Name of its unit of length; empty where it has none.
    millimetres : float
        Of one unit.
    tolerance : float
        Within which the drawing itself takes points for one, in its unit; 0 where it does not tell.
    """

    chains: tuple[Chain, ...]
    unit: str = ""
    millimetres: float = 1.0
    tolerance: float = 0.0


def frame_of(drawing: Drawing, path: PathLike) -> Wireframe:
    """The frame of a drawing: every piece of a chain is a strut.

    Points that a polyline repeats are left out.

    Raises
    ------
    InputError
        If a number is not finite, a line has no length, or two struts are one.
    """
    for chain in drawing.chains:
        if not np.isfinite(chain.points).all():
            raise InputError.at(path, chain.name, "has a point that is not finite", "draw it again")
    points = np.concatenate([chain.points for chain in drawing.chains]) * drawing.millimetres
    extent = float(np.ptp(points, axis=0).max())
    own = min(drawing.tolerance * drawing.millimetres, LARGEST_TOLERANCE * extent)
    vertices, joint = merged(points, max(ROUNDING * extent, own))
    edges: list[tuple[int, int]] = []
    seen: dict[tuple[int, int], str] = {}
    start = 0
    for chain in drawing.chains:
        joints = joint[start : start + len(chain.points)].tolist()
        start += len(joints)
        pieces = [piece for piece in pairwise(joints) if piece[0] != piece[1]]
        if not pieces:
            raise InputError.at(path, chain.name, "has no length", "remove it")
        for piece in pieces:
            key = (min(piece), max(piece))
            if key in seen:
                raise InputError.at(path, chain.name, f"repeats a strut of {seen[key]}", "remove one of the two")
            seen[key] = chain.name
            edges.append(piece)
    return Wireframe.create(vertices, edges, name=Path(path).stem, source=str(path))


def merged(points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) as joints (V, 3), and the joint of each: the first one within the tolerance, in their order."""
    size = max(tolerance, 1e-12)
    cells = np.floor((points - points.min(axis=0)) / size).astype(np.int64).tolist()
    near = list(product((-1, 0, 1), repeat=3))
    places: dict[tuple[int, int, int], list[int]] = {}
    joints: list[np.ndarray] = []
    joint = np.empty(len(points), dtype=np.int64)
    for n, ((x, y, z), point) in enumerate(zip(cells, points, strict=True)):
        around = (k for a, b, c in near for k in places.get((x + a, y + b, z + c), ()))
        close = [k for k in around if np.linalg.norm(joints[k] - point) <= tolerance]
        if close:
            joint[n] = min(close)
            continue
        joint[n] = len(joints)
        places.setdefault((x, y, z), []).append(len(joints))
        joints.append(point)
    return np.array(joints), joint


def checked_drawing(chains: Iterable[Chain], path: PathLike) -> tuple[Chain, ...]:
    """The chains of a drawing, as many as can be believed.

    Raises
    ------
    InputError
        If there are more than `MOST_PIECES` pieces.
    """
    found, pieces = [], 0
    for chain in chains:
        pieces += len(chain.points) - 1
        if pieces > MOST_PIECES:
            problem = f"holds more than {MOST_PIECES} struts"
            raise InputError.at(path, "file", problem, "remove blocks that are placed again and again")
        found.append(chain)
    return tuple(found)


def needs_extra(path: PathLike, module: str) -> InputError:
    """The error for a format that wants a library which is not installed."""
    return InputError.at(
        path,
        "file",
        f"reading it needs {module}, which is not installed",
        "run: python -m pip install 'frametwin[formats]'",
    )


def nothing_drawn(path: PathLike, others: Iterable[str]) -> InputError:
    """The error for a drawing without lines, which names the kinds of what it holds instead."""
    kinds = sorted(set(others))
    held = f", but {', '.join(kinds[:5])}" if kinds else ""
    return InputError.at(
        path, "file", f"holds no lines or polylines that can be seen{held}", "draw the struts as lines"
    )
