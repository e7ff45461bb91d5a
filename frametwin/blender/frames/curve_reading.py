"""Reading curve objects: the frame's own splines by their record, any others as they are drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from frametwin.blender.frames.deformed import deformed_control_points, rest_splines
from frametwin.blender.frames.joints import Drawn, Graph, Reading, joined, looks_straight
from frametwin.blender.frames.records import FrameRecord, load_record
from frametwin.blender.frames.splines import Splines
from frametwin.blender.scene.placement import Placement, current_depsgraph, flush_edits, label
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe


@dataclass(frozen=True, eq=False)
class Match:
    """Which segments of a curve are struts of its record, and where both lie in the world.

    Attributes
    ----------
    place
        How the object lies in the world.
    record
        What is known of the frame it was made from.
    rows
        (N,) row of the record of each segment, -1 if there is none.
    """

    place: Placement
    record: FrameRecord | None
    rows: np.ndarray

    @property
    def old(self) -> np.ndarray:
        """(N,) bool: the segment is a strut of the record."""
        return self.rows >= 0

    def drawn(self, points: np.ndarray) -> Drawn:
        """Segments (N, 4, 3), Blender units of the object, in the world.

        A coordinate that is the recorded one in single precision takes the digits of the recorded one.
        """
        local = points.astype(np.float64) * self.place.unit
        exact = np.zeros(len(points), dtype=bool)
        if self.record is not None and self.old.any():
            same = (self.record.rounded_points()[self.rows] == points) & self.old[:, None, None]
            written = self.record.control_points * (self.place.unit / self.record.mm_per_unit)
            local = np.where(same, written[self.rows], local)
            exact = same.all(axis=(1, 2))
        world = self.place.to_world(local)
        return Drawn(control_points=world, is_straight=~exact & looks_straight(world))

    def radius(self, curve: bpy.types.Curve, splines: Splines) -> np.ndarray | None:
        """(N,) mm, or ``None`` if the curve has no thickness of its own and none is recorded."""
        depth = float(curve.bevel_depth) if curve.bevel_mode != "OBJECT" else 0.0
        size = self.place.unit * self.place.scale
        if self.record is None:
            return splines.segment_radius * depth * size if depth > 0.0 else None
        if depth > 0.0 and np.float32(depth) != np.float32(self.record.bevel_depth):
            return splines.segment_radius * depth * size
        start, end, _ = splines.segments
        factors = self.record.rounded_factors()[self.rows]
        same = self.old & (splines.radius[start] == factors) & (splines.radius[end] == factors)
        written = self.record.radius[self.rows] * (self.place.unit / self.record.mm_per_unit) * self.place.scale
        return np.where(same, written, splines.segment_radius * self.record.bevel_depth * size)

    def recorded_graph(self, drawn: Drawn, radius: np.ndarray | None, source: str, reading: Reading) -> Graph:
        """The graph of the record, for a curve with one segment a row."""
        record = self.record
        assert record is not None and radius is not None  # a record has the radius as well
        return Graph(
            name=record.name,
            source=source,
            struts=np.arange(len(record.edges)),
            vertices=self.place.to_world(record.vertices * (self.place.unit / record.mm_per_unit)),
            edges=record.edges,
            radius=radius,
            printed=record.printed,
            grounded=record.grounded,
            batch=record.batch,
            tolerance=drawn.tolerance(reading.weld),
        )

    def inherited(self, graph: Graph) -> Graph:
        """The graph with what the record says of the struts that are still there, and of their joints."""
        record, rows = self.record, self.rows[graph.struts]
        if record is None:
            return graph
        old = rows >= 0
        grounded = graph.grounded.copy()
        grounded[graph.edges[old]] = record.grounded[record.edges[rows[old]]]
        return replace(
            graph,
            name=record.name,
            printed=np.where(old, record.printed[rows], True),
            batch=np.where(old, record.batch[rows], 0),
            grounded=grounded,
        )


@dataclass(frozen=True, eq=False)
class CurveDrawing:
    """A curve object, read once: its struts at rest, and the way to the deformed ones.

    Attributes
    ----------
    obj, depsgraph
        The object, and where it is evaluated.
    splines
        At rest.
    match
        What is known of its segments.
    graph
        The struts and joints.
    """

    obj: bpy.types.Object
    depsgraph: bpy.types.Depsgraph
    splines: Splines
    match: Match
    graph: Graph

    def plan(self) -> Wireframe:
        """The frame at rest."""
        return self.graph.wireframe(self.match.drawn(self.splines.control_points))

    def deformed(self) -> Wireframe:
        """The frame as evaluated.

        Raises
        ------
        InputError
            If struts are pulled apart, or see `deformed_control_points`.
        """
        drawn = self.match.drawn(deformed_control_points(self.obj, self.splines, self.depsgraph))
        self.graph.refuse_torn(drawn)
        return self.graph.wireframe(drawn)

    def strut_numbers(self) -> np.ndarray:
        """(N,) see `frametwin.blender.frames.curves.strut_numbers`."""
        record, rows = self.match.record, self.match.rows
        return rows if record is None else np.where(rows < 0, -1, record.strut[rows])


def read_curve(
    obj: bpy.types.Object,
    reading: Reading | None = None,
    *,
    depsgraph: bpy.types.Depsgraph | None = None,
    scene: bpy.types.Scene | None = None,
) -> CurveDrawing:
    """Read a curve object at rest.

    Raises
    ------
    InputError
        See `frametwin.blender.frames.curves.wireframe_from_curve`.
    """
    source = label(obj)
    reading = Reading() if reading is None else reading
    if obj.type != "CURVE":
        raise InputError.at(source, "type", f"is {obj.type}, not a curve", "select a curve object")
    flush_edits(obj)
    depsgraph = current_depsgraph(obj, scene) if depsgraph is None else depsgraph
    splines = rest_splines(obj)
    if not len(splines.segments[0]):
        raise InputError.at(source, "splines", "the curve holds no segment", "draw at least one strut")
    place = Placement.of(obj, depsgraph)
    place.refuse_flat(source)
    record = load_record(obj.data, source)
    rows = _still_there(splines.control_points, record)
    if record is not None and _has_its_order(splines, record, rows):
        match = Match(place, record, np.arange(len(record.edges)))
        drawn = match.drawn(splines.control_points)
        graph = match.recorded_graph(drawn, match.radius(obj.data, splines), source, reading)
        apart = graph.open_joint(drawn, graph.tolerance)
        if not apart:
            return CurveDrawing(obj, depsgraph, splines, match, graph)
        if not reading.split:
            raise InputError.at(
                source,
                "joints",
                apart,
                "move the ends together in Edit Mode, or read the frame as it is drawn, with the joint open",
            )
    match = Match(place, record, rows)
    drawn = match.drawn(splines.control_points)
    graph = joined(obj.name, source, drawn, reading=reading, radius=match.radius(obj.data, splines))
    return CurveDrawing(obj, depsgraph, splines, match, match.inherited(graph))


def _has_its_order(splines: Splines, record: FrameRecord, rows: np.ndarray) -> bool:
    """Whether spline i can be row i of the record: as many, and none of those that are unmoved under another number.

    The latter happens when a strut was deleted and another one drawn.
    """
    if not splines.are_struts or len(splines.counts) != len(record.edges):
        return False
    unmoved = (record.rounded_points() == splines.control_points).all(axis=(1, 2))
    return not bool(np.any((rows >= 0) & ~unmoved))


def _still_there(points: np.ndarray, record: FrameRecord | None) -> np.ndarray:
    """(N,) row of the record for each segment (N, 4, 3) that is exactly where it was written, else -1."""
    rows = np.full(len(points), -1, dtype=np.int64)
    if record is not None:
        zero = np.float32(0.0)  # added, it makes 0.0 of -0.0
        places = {strut.tobytes(): i for i, strut in enumerate(record.rounded_points() + zero)}
        rows[:] = [places.get(segment.tobytes(), -1) for segment in points + zero]
    return rows
