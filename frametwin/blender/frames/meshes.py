"""The edges of mesh objects as struts."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from frametwin.blender.frames.joints import Drawn, Graph, Reading, joined
from frametwin.blender.scene.placement import Placement, current_depsgraph, evaluated_object, flush_edits, label
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

RADIUS_ATTRIBUTE = "radius"
"""Name of the attribute of vertices or edges that gives the struts' radius, in the object's units."""


@dataclass(frozen=True, eq=False)
class MeshDrawing:
    """A mesh object, read once: its edges at rest, and the way to the deformed ones.

    Attributes
    ----------
    obj, depsgraph
        The object, and where it is evaluated.
    place
        How it lies in the world.
    points
        (P, 3) vertices in the object's units, at rest.
    edges
        (N, 2) their edges.
    graph
        The struts and joints.
    """

    obj: bpy.types.Object
    depsgraph: bpy.types.Depsgraph
    place: Placement
    points: np.ndarray
    edges: np.ndarray
    graph: Graph

    def plan(self) -> Wireframe:
        """The frame at rest."""
        return self.graph.wireframe(_drawn(self.points, self.edges, self.place))

    def deformed(self) -> Wireframe:
        """The frame as evaluated.

        Raises
        ------
        InputError
            If the object is not evaluated, or modifiers change the edges or pull welded vertices apart.
        """
        points, edges, _ = _evaluated_mesh(self.obj, self.depsgraph)
        if not np.array_equal(edges, self.edges):
            raise InputError.at(
                label(self.obj),
                "modifiers",
                f"they make {len(edges)} edges of the {len(self.edges)}, or number them anew",
                "apply or disable those that add or remove geometry, such as Mirror, Array or Subdivision",
            )
        drawn = _drawn(points, edges, self.place)
        self.graph.refuse_torn(drawn)
        return self.graph.wireframe(drawn)


def read_mesh(
    obj: bpy.types.Object,
    reading: Reading | None = None,
    *,
    evaluated: bool = False,
    scene: bpy.types.Scene | None = None,
) -> MeshDrawing:
    """Read the edges of a mesh object.

    Parameters
    ----------
    obj
        The object.
    reading
        Tolerance of joints, and the radius where there is no attribute `RADIUS_ATTRIBUTE`.
    evaluated
        Take for "at rest" what the modifiers make of the mesh, such as the whole of a mirrored half.
    scene
        Whose unit scale holds; see `scene_of`.

    Raises
    ------
    InputError
        If the object is no mesh, holds no edges, is scaled to nothing, or see `joined`.
    """
    source = label(obj)
    if obj.type != "MESH":
        raise InputError.at(source, "type", f"is {obj.type}, not a mesh", "select a mesh object")
    flush_edits(obj)
    depsgraph = current_depsgraph(obj, scene)
    points, edges, radius = _evaluated_mesh(obj, depsgraph) if evaluated else _rest_mesh(obj)
    if not len(edges):
        raise InputError.at(source, "edges", "the mesh holds none", "draw an edge for every strut")
    place = Placement.of(obj, depsgraph)
    place.refuse_flat(source)
    graph = joined(
        obj.name,
        source,
        _drawn(points, edges, place),
        reading=Reading() if reading is None else reading,
        radius=None if radius is None else radius * place.unit * place.scale,
        points=place.to_world(points * place.unit),
        ends=edges,
    )
    return MeshDrawing(obj, depsgraph, place, points, edges, graph)


def _drawn(points: np.ndarray, edges: np.ndarray, place: Placement) -> Drawn:
    ends = place.to_world(points * place.unit)[edges]  # (N, 2, 3)
    return Drawn(bezier.straight(ends[:, 0], ends[:, 1]), np.ones(len(edges), dtype=bool))


def _rest_mesh(obj: bpy.types.Object) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, edges and radius of the mesh without modifiers; with shape keys, of the basis."""
    points, edges, radius = _arrays(obj.data)
    keys = obj.data.shape_keys
    if keys is not None and len(keys.reference_key.data) == len(points):
        flat = np.empty(points.size, dtype=np.float32)
        keys.reference_key.data.foreach_get("co", flat)
        points = flat.reshape(-1, 3).astype(np.float64)
    return points, edges, radius


def _evaluated_mesh(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    evaluated = evaluated_object(obj, depsgraph)
    try:
        return _arrays(evaluated.to_mesh())
    finally:
        evaluated.to_mesh_clear()


def _arrays(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices (P, 3), edges (N, 2) and radius (N,), the latter ``None`` without the attribute; in units."""
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    edges = np.empty(2 * len(mesh.edges), dtype=np.int32)
    mesh.edges.foreach_get("vertices", edges)
    pairs = edges.reshape(-1, 2).astype(np.int64)
    return points.reshape(-1, 3).astype(np.float64), pairs, _radius(mesh, pairs)


def _radius(mesh: bpy.types.Mesh, edges: np.ndarray) -> np.ndarray | None:
    """(N,) the attribute of the edges, or the mean of that of their two vertices."""
    attribute = mesh.attributes.get(RADIUS_ATTRIBUTE)
    if attribute is None or attribute.data_type != "FLOAT" or attribute.domain not in ("POINT", "EDGE"):
        return None
    values = np.empty(len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get("value", values)
    if len(values) != (len(edges) if attribute.domain == "EDGE" else len(mesh.vertices)):
        return None  # Edit Mode holds it elsewhere until it is left
    values = values.astype(np.float64)
    return values if attribute.domain == "EDGE" else values[edges].mean(axis=1)
