"""What a curve object knows of its frame beyond its splines: a group of custom properties on the curve data.

The group ``frametwin`` holds the graph, what is printed, standing on the base and in which batch, and the frame's
coordinates in double precision, since Blender rounds its own to single.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import idprop
import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

KEY = "frametwin"
FORMAT = "frametwin-curve"
VERSION = 1
COLUMNS = ("vertices", "control_points", "strut", "edges", "radius", "printed", "grounded", "batch")


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """The frame that a curve object was made from.

    Attributes
    ----------
    name
        The frame's.
    mm_per_unit
        Millimetres in a Blender unit when the splines were written.
    bevel_depth
        Strut radius in Blender units at the radius factor 1, when the splines were written.
    vertices, control_points
        (V, 3) and (E, 4, 3) mm, in the object's axes.
    strut
        (E,) the number of each strut in the frame that this one was taken out of; 0, 1, 2 ... in a whole one.
    edges, radius, printed, grounded, batch
        As in `Wireframe`; spline i is row i.
    """

    name: str
    mm_per_unit: float
    bevel_depth: float
    vertices: np.ndarray
    control_points: np.ndarray
    strut: np.ndarray
    edges: np.ndarray
    radius: np.ndarray
    printed: np.ndarray
    grounded: np.ndarray
    batch: np.ndarray

    @classmethod
    def of(cls, frame: Wireframe, unit: float, strut: Any = None) -> FrameRecord:
        """What is recorded of a frame that is drawn at so many mm a Blender unit.

        Raises
        ------
        InputError
            If ``strut``, the (E,) numbers of its struts in a greater frame, has another length.
        """
        numbers = np.arange(frame.strut_count) if strut is None else strut
        return cls(
            name=frame.name,
            mm_per_unit=unit,
            bevel_depth=float(np.median(frame.radius)) / unit,
            strut=checked_array(numbers, "i", (frame.strut_count,), frame.name, "strut"),
            vertices=frame.vertices,
            control_points=frame.control_points,
            edges=frame.edges,
            radius=frame.radius,
            printed=frame.printed,
            grounded=frame.grounded,
            batch=frame.batch,
        )

    def frame(self) -> Wireframe:
        """The frame, to the last bit."""
        return Wireframe(
            vertices=self.vertices,
            edges=self.edges,
            control_points=self.control_points,
            radius=self.radius,
            printed=self.printed,
            grounded=self.grounded,
            batch=self.batch,
            name=self.name,
        )

    def rounded_points(self) -> np.ndarray:
        """(E, 4, 3) float32 control points as Blender has them: in units, in single precision."""
        return (self.control_points / self.mm_per_unit).astype(np.float32)

    def rounded_factors(self) -> np.ndarray:
        """(E,) float32 radius factors as Blender has them."""
        return (self.radius / (self.bevel_depth * self.mm_per_unit)).astype(np.float32)


def store_record(curve: bpy.types.Curve | bpy.types.Curves, record: FrameRecord, key: str = KEY) -> None:
    """Write a record onto its curve, as a custom property of this name."""
    columns = {name: _column(getattr(record, name)) for name in COLUMNS}
    numbers = {"name": record.name, "mm_per_unit": record.mm_per_unit, "bevel_depth": record.bevel_depth}
    curve[key] = {"format": FORMAT, "version": VERSION, **numbers, **columns}


def _column(values: np.ndarray) -> np.ndarray:
    """A flat array of a type that custom properties hold: 32-bit whole numbers, or doubles for greater ones."""
    flat = np.ravel(values)
    if flat.dtype.kind == "f":
        return flat.astype(np.float64)
    fits = not flat.size or -(2**31) <= int(flat.min()) <= int(flat.max()) < 2**31
    return flat.astype(np.int32 if fits else np.float64)


def load_record(curve: bpy.types.Curve | bpy.types.Curves, source: str, key: str = KEY) -> FrameRecord | None:
    """Read the record that the custom property ``key`` holds.

    Returns
    -------
    ``None`` for a curve that has none, or a damaged one.

    Raises
    ------
    InputError
        If it is of a later version.
    """
    group = curve.get(key)
    if not isinstance(group, idprop.types.IDPropertyGroup) or group.get("format") != FORMAT:
        return None
    if group.get("version") != VERSION:
        raise InputError.at(
            source,
            f'custom property "{key}"',
            f"was written in version {group.get('version')!r}, {VERSION} is known here",
            "update FrameTwin, or delete the property to read the curve as it is drawn",
        )
    try:
        record = FrameRecord(
            name=str(group["name"]),
            mm_per_unit=float(group["mm_per_unit"]),
            bevel_depth=float(group["bevel_depth"]),
            vertices=np.array(group["vertices"], dtype=np.float64).reshape(-1, 3),
            control_points=np.array(group["control_points"], dtype=np.float64).reshape(-1, 4, 3),
            strut=np.array(group["strut"]).astype(np.int64),
            radius=np.array(group["radius"], dtype=np.float64),
            edges=np.array(group["edges"]).astype(np.int64).reshape(-1, 2),
            printed=np.array(group["printed"]).astype(bool),
            grounded=np.array(group["grounded"]).astype(bool),
            batch=np.array(group["batch"]).astype(np.int64),
        )
    except (KeyError, TypeError, ValueError):
        return None
    return record if _fits_itself(record) else None


def _fits_itself(record: FrameRecord) -> bool:
    struts, vertices = len(record.edges), len(record.vertices)
    return (
        struts > 0
        and record.control_points.shape == (struts, 4, 3)
        and {getattr(record, name).shape for name in ("strut", "radius", "printed", "batch")} == {(struts,)}
        and record.grounded.shape == (vertices,)
        and 0 <= int(record.edges.min()) <= int(record.edges.max()) < vertices
        and record.mm_per_unit > 0.0
        and record.bevel_depth > 0.0
        and bool(np.isfinite(record.vertices).all() and np.isfinite(record.control_points).all())
    )
