"""Lines and polylines of Rhino models (``.3dm``), through rhino3dm (imported when needed; the extra ``formats``).

What counts is what can be seen, blocks included: lines, polylines, and curves that are straight or made of straight
pieces. Other curves are refused, since struts of a plan are straight. Points, surfaces, meshes, texts, and what is
hidden or on layers that are off are not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_bytes
from frametwin.formats.chains import (
    BENT,
    DEEPEST,
    LARGEST_TOLERANCE,
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
    "None": ("", 1.0),
    "Microns": ("micron", 1e-3),
    "Millimeters": ("mm", 1.0),
    "Centimeters": ("cm", 10.0),
    "Decimeters": ("dm", 100.0),
    "Meters": ("m", 1000.0),
    "Microinches": ("microinch", 25.4e-6),
    "Mils": ("mil", 0.0254),
    "Inches": ("in", 25.4),
    "Feet": ("ft", 304.8),
    "Yards": ("yd", 914.4),
}
"""Units of length by their names in ``UnitSystem``, each with its millimetres."""


def read(path: PathLike) -> Wireframe:
    """Read the struts of a Rhino model; ends that meet within the model's absolute tolerance are one joint.

    Raises
    ------
    InputError
        If rhino3dm is not installed, the file is missing or damaged, holds no lines or a curve, or its unit is not one
        for prints.
    """
    return frame_of(drawing_of(path), path)


def drawing_of(path: PathLike) -> Drawing:
    """What a Rhino model holds; see `read`."""
    model = _model(path)
    unit, millimetres = _unit(model, path)
    others: list[str] = []
    chains = checked_drawing(_Reader(model, path, others).chains(), path)
    if not chains:
        raise nothing_drawn(path, others)
    return Drawing(chains, unit, millimetres, _tolerance(model))


def unit_of(path: PathLike) -> tuple[str, float]:
    """The unit of a model and its millimetres."""
    return _unit(_model(path), path)


def _model(path: PathLike) -> Any:
    data = read_bytes(path)
    try:
        import rhino3dm
    except ImportError as error:
        raise needs_extra(path, "rhino3dm") from error
    try:
        model = rhino3dm.File3dm.FromByteArray(data)  # type: ignore[arg-type]  # bytes are taken
    except Exception as error:  # whatever the binding raises
        raise InputError.at(path, "file", f"cannot be read as 3dm ({error})", "save the model again") from error
    if model is None:
        raise InputError.at(path, "file", "cannot be read as 3dm", "save the model again")
    return model


def _unit(model: Any, path: PathLike) -> tuple[str, float]:
    name = str(model.Settings.ModelUnitSystem).rpartition(".")[2]
    if name not in UNITS:
        raise InputError.at(path, "units", f"{name} are no unit for prints", "set the model's units to millimetres")
    return UNITS[name]


def _tolerance(model: Any) -> float:
    """The model's absolute tolerance, in its unit; 0 where it is not a distance."""
    tolerance = float(model.Settings.ModelAbsoluteTolerance)
    return tolerance if 0.0 <= tolerance < np.inf else 0.0


class _Reader:
    """Chains of a model, with the kinds of what has none in ``others``."""

    def __init__(self, model: Any, path: PathLike, others: list[str]) -> None:
        self.model, self.path, self.others = model, path, others
        self.layers = {layer.Index: layer for layer in model.Layers}

    def chains(self) -> Iterator[Chain]:
        """Those of all objects that can be seen."""
        for item in self.model.Objects:
            if not item.Attributes.IsInstanceDefinitionObject:
                yield from self._chains_of(item, np.eye(4), 0)

    def _chains_of(self, item: Any, placed: np.ndarray, depth: int) -> Iterator[Chain]:
        attributes, geometry = item.Attributes, item.Geometry
        layer = self.layers.get(attributes.LayerIndex)
        if not attributes.Visible or (layer is not None and not layer.Visible):
            return
        kind = type(geometry).__name__
        name = f"{attributes.Name or kind} {attributes.Id}" + (f" on layer {layer.Name}" if layer is not None else "")
        if kind == "InstanceReference":
            yield from self._block(geometry, placed, name, depth)
            return
        if not hasattr(geometry, "TryGetPolyline"):
            self.others.append(kind)
            return
        yield Chain(name, self._corners(geometry, name) @ placed[:3, :3].T + placed[:3, 3])

    def _block(self, reference: Any, placed: np.ndarray, name: str, depth: int) -> Iterator[Chain]:
        if depth >= DEEPEST:
            raise InputError.at(self.path, name, f"lies in more than {DEEPEST} blocks", "explode the blocks")
        definition = self.model.InstanceDefinitions.FindId(reference.ParentIdefId)
        if definition is None:
            raise InputError.at(self.path, name, "is a block that is not in the file", "embed or explode it")
        motion = reference.Xform
        inner = placed @ np.array([[getattr(motion, f"M{i}{j}") for j in range(4)] for i in range(4)], dtype=np.float64)
        for number in definition.GetObjectIds():
            part = self.model.Objects.FindId(number)
            if part is not None:
                yield from self._chains_of(part, inner, depth + 1)

    def _corners(self, curve: Any, name: str) -> np.ndarray:
        polyline = curve.TryGetPolyline()
        start, end = curve.PointAtStart, curve.PointAtEnd
        chord = float(np.linalg.norm([end.X - start.X, end.Y - start.Y, end.Z - start.Z]))
        if polyline is not None:
            points = [polyline[i] for i in range(len(polyline))]
        elif curve.IsLinear(max(ROUNDING * chord, min(_tolerance(self.model), LARGEST_TOLERANCE * chord))):
            points = [start, end]
        else:
            raise InputError.at(self.path, name, "is a curve, and struts of a plan are straight", BENT)
        return np.array([(point.X, point.Y, point.Z) for point in points], dtype=np.float64)
