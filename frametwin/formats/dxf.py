"""Lines and polylines of DXF drawings, through ezdxf (imported when needed; the extra ``formats``).

What counts is what can be seen in the model space, blocks included: lines, polylines, and splines of degree 1 or along
a line. Arcs and other curves are refused, since struts of a plan are straight. Texts, dimensions, points, hatches,
faces, and what is on layers that are off or frozen are not looked at.

Source: Autodesk's DXF Reference, "ENTITIES Section" and ``$INSUNITS`` in "HEADER Section".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.formats.chains import (
    BENT,
    DEEPEST,
    ROUNDING,
    Chain,
    Drawing,
    checked_drawing,
    frame_of,
    needs_extra,
    nothing_drawn,
)
from frametwin.geometry.wireframe import Wireframe

UNITS = {
    0: ("", 1.0),
    1: ("in", 25.4),
    2: ("ft", 304.8),
    4: ("mm", 1.0),
    5: ("cm", 10.0),
    6: ("m", 1000.0),
    8: ("microinch", 25.4e-6),
    9: ("mil", 0.0254),
    10: ("yd", 914.4),
    13: ("micron", 1e-3),
    14: ("dm", 100.0),
    21: ("US survey ft", 1200.0 / 3937.0 * 1000.0),
}
"""Units of length by their number in ``$INSUNITS``, each with its millimetres; 0 is none."""

CURVED = ("ARC", "CIRCLE", "ELLIPSE", "HELIX")
_CURVE_FIT, _SPLINE_FIT = 2, 4  # flags of polylines that stand for curves


def read(path: PathLike) -> Wireframe:
    """Read the struts of a DXF drawing; ends that meet are one joint.

    Raises
    ------
    InputError
        If ezdxf is not installed, the file is missing or damaged, holds no lines or a curve, or its unit is not one
        for prints.
    """
    return frame_of(drawing_of(path), path)


def drawing_of(path: PathLike) -> Drawing:
    """What a DXF drawing holds; see `read`."""
    document = _document(path)
    unit, millimetres = _unit(document, path)
    others: list[str] = []
    chains = checked_drawing(_chains(document, path, others), path)
    if not chains:
        raise nothing_drawn(path, others)
    return Drawing(chains, unit, millimetres)


def unit_of(path: PathLike) -> tuple[str, float]:
    """The unit of a drawing and its millimetres."""
    return _unit(_document(path), path)


def _document(path: PathLike) -> Any:
    if not Path(path).is_file():
        raise InputError.at(path, "file", "the file does not exist", "check the name, or put the file there")
    try:
        import ezdxf
    except ImportError as error:
        raise needs_extra(path, "ezdxf") from error
    try:
        return ezdxf.readfile(path)
    except Exception as error:  # the reader raises whatever its parser meets
        problem = f"cannot be read as DXF ({type(error).__name__}: {error})"
        raise InputError.at(path, "file", problem, "export the drawing again") from error


def _unit(document: Any, path: PathLike) -> tuple[str, float]:
    number = document.header.get("$INSUNITS", 0)
    if number not in UNITS:
        raise InputError.at(path, "$INSUNITS", f"{number} is no unit for prints", "write the drawing in mm")
    return UNITS[number]


def _chains(document: Any, path: PathLike, others: list[str]) -> Iterator[Chain]:
    hidden = {layer.dxf.name.lower() for layer in document.layers if layer.is_off() or layer.is_frozen()}
    for entity in document.modelspace():
        yield from _chains_of(entity, path, hidden, others, "", 0)


def _chains_of(
    entity: Any, path: PathLike, hidden: set[str], others: list[str], inside: str, depth: int
) -> Iterator[Chain]:
    """The chains of an entity, ``inside`` of a block or not; the kinds of what has none are added to ``others``."""
    layer, kind = str(entity.dxf.get("layer", "0")), entity.dxftype()
    # What is on layer 0 inside of a block is on the layer of the block's reference.
    if entity.dxf.get("invisible", 0) or (layer.lower() in hidden and not (inside and layer == "0")):
        return
    place = f" in block {inside}" if inside else f" {entity.dxf.handle}" if entity.dxf.get("handle") else ""
    name = f"{kind}{place} on layer {layer}"
    if kind == "INSERT":
        if depth >= DEEPEST:
            raise InputError.at(path, name, f"lies in more than {DEEPEST} blocks", "explode the blocks")
        references = list(entity.multi_insert()) if entity.mcount > 1 else [entity]
        for reference in references:
            for part in _parts(reference, path, name):
                yield from _chains_of(part, path, hidden, others, str(entity.dxf.name), depth + 1)
        return
    if kind in CURVED:
        raise InputError.at(path, name, "is a curve, and struts of a plan are straight", BENT)
    points = _points(entity, kind, path, name)
    if points is None:
        others.append(kind)
    else:
        yield Chain(name, points)


def _parts(reference: Any, path: PathLike, name: str) -> Iterator[Any]:
    try:
        yield from reference.virtual_entities()
    except InputError:
        raise
    except Exception as error:
        problem = f"cannot be resolved ({type(error).__name__}: {error})"
        raise InputError.at(path, name, problem, "explode the blocks") from error


def _points(entity: Any, kind: str, path: PathLike, name: str) -> np.ndarray | None:
    """The corners (N, 3) of an entity along its struts; ``None`` if it is not made of lines."""
    if kind == "LINE":
        return np.array([tuple(entity.dxf.start), tuple(entity.dxf.end)], dtype=np.float64)
    if kind == "LWPOLYLINE":
        points, closed, bent = list(entity.vertices_in_wcs()), entity.closed, entity.has_arc
    elif kind == "POLYLINE" and (entity.is_2d_polyline or entity.is_3d_polyline):
        points, closed = list(entity.points_in_wcs()), entity.is_closed
        bent = entity.has_arc or bool(entity.dxf.flags & (_CURVE_FIT | _SPLINE_FIT))
    elif kind == "SPLINE":
        points, closed = list(entity.control_points), entity.closed
        bent = not points or (entity.dxf.degree != 1 and not _is_line(points))
        points = points if entity.dxf.degree == 1 or not points else [points[0], points[-1]]
    else:
        return None
    if bent:
        raise InputError.at(path, name, "has curved pieces, and struts of a plan are straight", BENT)
    if len(points) < 2:
        raise InputError.at(path, name, "has fewer than two points", "remove it")
    corners = np.array([tuple(point) for point in points], dtype=np.float64)
    return np.concatenate([corners, corners[:1]]) if closed else corners


def _is_line(points: Any) -> bool:
    """Whether the control points of a curve go straight on from the first to the last, so that the curve does."""
    corners = np.array([tuple(point) for point in points], dtype=np.float64)
    along = corners[-1] - corners[0]
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return False
    steps = np.diff(corners, axis=0)
    aside = np.linalg.norm(np.cross(corners - corners[0], along / length), axis=1)
    return bool((aside <= ROUNDING * length).all() and (steps @ along >= 0.0).all())
