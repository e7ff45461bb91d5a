"""Measured struts as Blender's own Curves: Bezier curves with handles, and named attributes of points and struts.

Unlike the curve objects of `frametwin.blender.frames.curves`, which are there to be edited and bent, such an object
shows what was found. Its data carry the frame in double precision (`FrameRecord`), and that is what is read from it,
whatever became of the object.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import bpy
import idprop
import numpy as np

from frametwin.blender.frames.records import KEY, FrameRecord, load_record, store_record
from frametwin.blender.frames.splines import FREE
from frametwin.blender.scene.placement import label
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import curve_change
from frametwin.geometry.flattening import chords_needed
from frametwin.geometry.pieces import pieces_needed
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.bent import curves_with

PLAN_KEY = "frametwin_plan_record"
"""Custom property of the data with the record of the plan."""

BENT_KEY = "frametwin_bent"
"""Custom property of the data with the curves of struts that are bent as no cubic can be; absent where none is."""

PIECES = 4
"""Bezier pieces into which a strut is cut without a change of its shape, so that values can differ along it."""

CLOSE = 0.01
"""Radii by which the pieces of a strut that is bent as no cubic can be may be off its curve: it gets more of them."""

ROUGHNESS = 0.1
"""How far the chords that are drawn may be off the curve, in radii."""

FINEST = 4
"""Most chords of a piece."""

_FIELDS = {"FLOAT_VECTOR": "vector"}
_TYPES = {"FLOAT": np.float32, "FLOAT_VECTOR": np.float32, "INT": np.int32, "INT8": np.int8, "BOOLEAN": np.bool_}


@dataclass(frozen=True, eq=False)
class Sampling:
    """Where on the struts the points of their curves are.

    Attributes
    ----------
    pieces
        (E,) pieces of each strut, of equal steps of its parameter.
    strut
        (P,) the strut of each point.
    parameter
        (P,) 0..1 on the strut.
    """

    pieces: np.ndarray
    strut: np.ndarray
    parameter: np.ndarray

    @classmethod
    def of(cls, pieces: np.ndarray) -> Sampling:
        """Points at the ends of all pieces of each strut (E,)."""
        counts = pieces + 1
        strut = np.repeat(np.arange(len(pieces)), counts)
        first = np.cumsum(counts) - counts
        return cls(pieces, strut, (np.arange(len(strut)) - first[strut]) / pieces[strut])

    def points(self, control_points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cut curves (E, n + 1, D) into cubics: points (P, D), and (P, D) from each point to its right handle.

        The left handle lies as far on the other side, since the pieces of a strut are of equal steps. Cubics keep their
        shape; curves of a higher degree, their points and tangents.
        """
        curves, degree = control_points[self.strut], control_points.shape[1] - 1  # (P, n + 1, D)
        point = np.einsum("pk,pkd->pd", bezier.bernstein(degree, self.parameter), curves)
        velocity = np.einsum("pk,pkd->pd", bezier.bernstein(degree - 1, self.parameter), np.diff(curves, axis=1))
        return point, degree / 3.0 * velocity / self.pieces[self.strut, None]

    def between(self, values: np.ndarray) -> np.ndarray:
        """(P,) of values (E, K) in the middle of K equal parts of each strut, interpolated."""
        place = np.clip(self.parameter * values.shape[1] - 0.5, 0.0, values.shape[1] - 1.0)
        left = np.minimum(place.astype(np.int64), max(values.shape[1] - 2, 0))
        share = place - left
        right = np.minimum(left + 1, values.shape[1] - 1)
        return np.asarray((1.0 - share) * values[self.strut, left] + share * values[self.strut, right])


@dataclass(frozen=True, eq=False)
class Attribute:
    """A named attribute: its type as Blender calls it, (P,) or (P, 3) values of points or (E,) of struts."""

    kind: str
    values: np.ndarray
    domain: str = "POINT"


@dataclass(frozen=True, eq=False)
class StrutCurves:
    """What a Curves object is made of, without Blender.

    Attributes
    ----------
    frame
        The struts as they are, mm.
    plan
        The same struts as planned; of those the displacement is told.
    sampling
        The points.
    attributes
        By name, beyond those that are made of the rest. Lengths are in mm.
    strut
        (E,) the number of each strut in the frame that these were taken out of.
    radius
        (P,) mm, along the struts; that of ``frame`` by default.
    bent
        Curves (n + 1, 3) in mm by strut, of those that are bent as no cubic can be; see `frametwin.twin.twin.Twin`.
    """

    frame: Wireframe
    plan: Wireframe
    sampling: Sampling
    attributes: Mapping[str, Attribute]
    strut: np.ndarray
    radius: np.ndarray | None = None
    bent: Mapping[int, np.ndarray] = field(default_factory=dict)

    @property
    def curves(self) -> np.ndarray:
        """(E, n + 1, 3) mm, at the highest degree of any strut."""
        return curves_with(self.frame.control_points, self.bent)

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(P, 3) mm each: points, what lies from them to their right handles, and the displacement of both.

        Worked out once, where there is time for it.
        """
        moved = curve_change(self.plan.control_points, self.curves)
        return *self.sampling.points(self.curves), *self.sampling.points(moved)


def pieces_of(struts: int, bent: Mapping[int, np.ndarray], radius: np.ndarray) -> np.ndarray:
    """(E,) pieces of struts of radius (E,) mm: `PIECES`, and more where one is ``bent`` (n + 1, 3) and needs them."""
    pieces = np.full(struts, PIECES)
    for strut, curve in bent.items():
        pieces[strut] = pieces_needed(curve, CLOSE * float(radius[strut]), PIECES)
    return pieces


def strut_curves_steps(
    content: StrutCurves, name: str, collection: bpy.types.Collection, unit: float
) -> Generator[None, None, bpy.types.Object]:
    """Make a Curves object in a collection, at the origin and locked there; nothing is left if it is not gone on with.

    Each strut is one Bezier curve, cut into `Sampling.pieces`. Points have ``displacement`` from the plan, and
    ``displacement_left`` and ``displacement_right`` of their handles, in Blender units like ``position`` and
    ``radius``; struts have ``strut``, ``batch`` and ``printed``.

    Parameters
    ----------
    content
        What to show.
    name
        Of object and data.
    collection
        Where to link it.
    unit
        Millimetres in a Blender unit.
    """
    data = bpy.data.hair_curves.new(name)
    try:
        data.add_curves((content.sampling.pieces + 1).tolist())
        data.set_types(type="BEZIER")
        yield
        for key, attribute in {**_own_attributes(content, unit), **content.attributes}.items():
            write_attribute(data, key, attribute)
            yield
        store_record(data, FrameRecord.of(content.frame, unit, content.strut))
        store_record(data, FrameRecord.of(content.plan, unit, content.strut), PLAN_KEY)
        if content.bent:
            data[BENT_KEY] = {str(strut): np.ravel(curve) for strut, curve in content.bent.items()}
        yield
    except BaseException:
        bpy.data.hair_curves.remove(data)
        raise
    obj = bpy.data.objects.new(name, data)
    lock(obj)
    collection.objects.link(obj)
    return obj


def _own_attributes(content: StrutCurves, unit: float) -> dict[str, Attribute]:
    frame, sampling = content.frame, content.sampling
    point, reach, moved, turned = (each / unit for each in content.points)
    free = np.full(len(point), FREE, dtype=np.int8)
    radius = frame.radius[sampling.strut] if content.radius is None else content.radius
    return {
        "position": Attribute("FLOAT_VECTOR", point),
        "handle_left": Attribute("FLOAT_VECTOR", point - reach),
        "handle_right": Attribute("FLOAT_VECTOR", point + reach),
        "handle_type_left": Attribute("INT8", free),
        "handle_type_right": Attribute("INT8", free),
        "radius": Attribute("FLOAT", radius / unit),
        "displacement": Attribute("FLOAT_VECTOR", moved),
        "displacement_left": Attribute("FLOAT_VECTOR", moved - turned),
        "displacement_right": Attribute("FLOAT_VECTOR", moved + turned),
        "parameter": Attribute("FLOAT", sampling.parameter),
        "resolution": Attribute("INT", _chords(content), "CURVE"),
        "strut": Attribute("INT", content.strut, "CURVE"),
        "batch": Attribute("INT", np.clip(frame.batch, -(2**31), 2**31 - 1), "CURVE"),
        "printed": Attribute("BOOLEAN", frame.printed, "CURVE"),
    }


def _chords(content: StrutCurves) -> np.ndarray:
    """(E,) chords with which each piece of a strut is drawn: a bent strut takes more."""
    wanted = chords_needed(content.curves, ROUGHNESS * np.maximum(content.frame.radius, 1e-9))
    return np.clip(np.ceil(wanted / content.sampling.pieces), 1, FINEST).astype(np.int32)


def write_attribute(data: bpy.types.Curves, name: str, attribute: Attribute) -> None:
    """Write a named attribute, which is made where there is none."""
    there = data.attributes.get(name) or data.attributes.new(name, attribute.kind, attribute.domain)
    values = np.ascontiguousarray(attribute.values, dtype=_TYPES[attribute.kind]).ravel()
    there.data.foreach_set(_FIELDS.get(attribute.kind, "value"), values)


def read_attribute(data: bpy.types.Curves, name: str) -> np.ndarray:
    """The values of a named attribute, (P,), (P, 3) or (E,).

    Raises
    ------
    InputError
        If there is none.
    """
    there = data.attributes.get(name)
    if there is None:
        raise InputError.at(f"curves {data.name}", name, "is no attribute", "import the run again")
    width = 3 if there.data_type == "FLOAT_VECTOR" else 1
    found = np.empty(width * len(there.data), dtype=_TYPES[there.data_type])
    there.data.foreach_get(_FIELDS.get(there.data_type, "value"), found)
    return found.reshape(-1, 3) if width == 3 else found


def first_points(data: bpy.types.Curves) -> np.ndarray:
    """(E + 1,) number of the first point of each strut, and behind them that of all points."""
    found = np.empty(len(data.curve_offset_data), dtype=np.int32)
    data.curve_offset_data.foreach_get("value", found)
    return found


def struts_where(data: bpy.types.Curves, name: str) -> np.ndarray:
    """Rising numbers of the struts for which, or at any point of which, a boolean attribute is set; none without it."""
    there = data.attributes.get(name)
    if there is None:
        return np.zeros(0, dtype=np.int64)
    found = read_attribute(data, name)
    if there.domain == "POINT":
        found = np.logical_or.reduceat(found, first_points(data)[:-1])
    return np.flatnonzero(found)


def lock(obj: bpy.types.Object) -> None:
    """Keep an object where it is: what was measured is not to be moved by accident."""
    obj.lock_location = obj.lock_rotation = obj.lock_scale = (True, True, True)
    obj.lock_rotation_w = True


def recorded_frame(obj: bpy.types.Object, plan: bool = False) -> Wireframe:
    """The struts that an object was made to show, or their plan: mm, to the last bit, wherever the object is now.

    Those that are bent as no cubic can be are the cubics nearest to them; see `recorded_curves`.

    Raises
    ------
    InputError
        If the object was not made by `strut_curves_steps`.
    """
    record = load_record(obj.data, label(obj), PLAN_KEY if plan else KEY) if obj.type == "CURVES" else None
    if record is None:
        raise InputError.at(label(obj), "struts", "are not those of a twin", "import the run again")
    return record.frame()


def recorded_curves(obj: bpy.types.Object) -> np.ndarray:
    """(E, n + 1, 3) mm: the curves of the struts that an object was made to show, at the highest degree of any.

    Raises
    ------
    InputError
        If the object was not made by `strut_curves_steps`.
    """
    cubics, group = recorded_frame(obj).control_points, obj.data.get(BENT_KEY)
    if not isinstance(group, idprop.types.IDPropertyGroup):
        return cubics
    bent = {int(strut): np.array(points, dtype=np.float64).reshape(-1, 3) for strut, points in group.items()}
    return curves_with(cubics, bent)


def recorded_struts(obj: bpy.types.Object) -> np.ndarray:
    """(E,) the numbers of an object's struts in the frame that they were taken out of; see `recorded_frame`.

    Raises
    ------
    InputError
        If the object was not made by `strut_curves_steps`.
    """
    record = load_record(obj.data, label(obj)) if obj.type == "CURVES" else None
    if record is None:
        raise InputError.at(label(obj), "struts", "are not those of a twin", "import the run again")
    return record.strut
