"""Plans and prints with named attributes, as twins have them.

They are curve objects of Blender's older kind, since only these are bent by modifiers, and such data hold no
attributes. A modifier, always the last one, gives them to what Blender draws: it looks every strut up in a mesh with a
vertex for each, which is in no scene. Once there are more or fewer struts than were put there, numbers mean nothing any
more, and it does nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from frametwin.blender.frames.strut_curves import Attribute
from frametwin.blender.scene.node_graph import NodeGraph, first_output
from frametwin.blender.scene.units import mm_per_unit
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import RADIUS_SHARE, Wireframe

DESCRIBES = "frametwin_describes"
"""Custom property of the node groups, and of the objects that hold the values."""

NAME = "FrameTwin Attributes"
VERSION = 1
STRUTS = "Struts"
"""Input of the modifier: the object with a vertex for each strut."""

_SAMPLES = np.linspace(0.0, 1.0, 17)


def describe_plan(obj: bpy.types.Object, frame: Wireframe, scene: bpy.types.Scene) -> None:
    """Give a plan's curve object the attributes ``strut``, ``batch``, ``printed``, ``radius``, ``radius_guessed``."""
    _describe(obj, _of_frame(frame, mm_per_unit(scene)))


def describe_print(
    obj: bpy.types.Object, truth: Wireframe, plan: Wireframe, present: np.ndarray, scene: bpy.types.Scene
) -> None:
    """Give a print's curve object the attributes of a plan, ``completeness`` and how far it is from its plan as made.

    Parameters
    ----------
    obj
        As `frametwin.blender.frames.curves.wireframe_to_curve` made it of ``truth``.
    truth, plan
        The struts as they are and as planned, mm.
    present : (E, 2) array
        From where to where each strut is there, 0..1.
    scene
        Whose unit scale holds.
    """
    moved = np.linalg.norm(bezier.evaluate(truth.control_points - plan.control_points, _SAMPLES), axis=-1)  # (E, S)
    columns = {
        "completeness": np.where(truth.printed, present[:, 1] - present[:, 0], 0.0),
        "displacement_mean": moved.mean(axis=1),
        "displacement_max": moved.max(axis=1),
    }
    own = {name: Attribute("FLOAT", values) for name, values in columns.items()}
    _describe(obj, {**_of_frame(truth, mm_per_unit(scene)), **own})


def has_guessed_radius(frame: Wireframe) -> np.ndarray:
    """(E,) whether a frame's radius is what `Wireframe.create` takes where none is given, by the struts' length."""
    default = RADIUS_SHARE * float(np.median(bezier.arc_length(frame.control_points)))
    return np.full(frame.strut_count, bool(np.allclose(frame.radius, default, rtol=1e-9, atol=0.0)))


def _of_frame(frame: Wireframe, unit: float) -> dict[str, Attribute]:
    return {
        "strut": Attribute("INT", np.arange(frame.strut_count)),
        "batch": Attribute("INT", np.clip(frame.batch, -(2**31), 2**31 - 1)),
        "printed": Attribute("BOOLEAN", frame.printed),
        "radius": Attribute("FLOAT", frame.radius / unit),
        "radius_guessed": Attribute("BOOLEAN", has_guessed_radius(frame)),
    }


def _describe(obj: bpy.types.Object, attributes: dict[str, Attribute]) -> None:
    mesh = bpy.data.meshes.new(f".{obj.name} struts")
    mesh.vertices.add(len(obj.data.splines))
    for name, attribute in attributes.items():
        there = mesh.attributes.new(name, attribute.kind, "POINT")
        there.data.foreach_set("value", np.ascontiguousarray(attribute.values, dtype=_TYPES[attribute.kind]))
    holder = bpy.data.objects.new(mesh.name, mesh)
    holder[DESCRIBES] = True
    modifier = obj.modifiers.new(NAME, "NODES")
    modifier.node_group = _group({name: attribute.kind for name, attribute in attributes.items()})
    modifier.use_pin_to_last = True
    modifier.show_group_selector = modifier.show_expanded = False
    _look_up_in(modifier, holder)


def _look_up_in(modifier: bpy.types.Modifier, holder: bpy.types.Object | None) -> None:
    identifier = next(item.identifier for item in modifier.node_group.interface.items_tree if item.name == STRUTS)
    if hasattr(modifier, "properties"):  # from Blender 5.2 on
        getattr(modifier.properties.inputs, identifier).value = holder
    else:
        modifier[identifier] = holder


_TYPES = {"FLOAT": np.float32, "INT": np.int32, "BOOLEAN": np.bool_}


def only_describes(modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier gives attributes and bends nothing."""
    return modifier.type == "NODES" and modifier.node_group is not None and DESCRIBES in modifier.node_group


def take_description(obj: bpy.types.Object) -> None:
    """Take the modifier from an object."""
    for modifier in [modifier for modifier in obj.modifiers if only_describes(modifier)]:
        _look_up_in(modifier, None)  # Blender 5.2 would count it as a user still
        obj.modifiers.remove(modifier)


def forget_description(obj: bpy.types.Object) -> None:
    """Take the modifier from an object, with all that nobody else uses."""
    take_description(obj)
    unused = [holder for holder in bpy.data.objects if DESCRIBES in holder and not holder.users]
    meshes = [holder.data for holder in unused]
    bpy.data.batch_remove([*unused, *meshes])
    bpy.data.batch_remove([group for group in bpy.data.node_groups if DESCRIBES in group and not group.users])


def _group(kinds: dict[str, str]) -> bpy.types.NodeTree:
    """The node group that stores attributes of these names and types, made when there is none."""
    key = f"{VERSION}: {', '.join(kinds)}"
    for group in bpy.data.node_groups:
        if group.library is None and group.get(DESCRIBES) == key:
            return group
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.description = "Gives the struts of a plan or print their named attributes"
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket(STRUTS, in_out="INPUT", socket_type="NodeSocketObject")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    graph = NodeGraph(group)
    given = graph.node("NodeGroupInput").outputs
    known = graph.node("GeometryNodeObjectInfo", {"Object": given[STRUTS]}).outputs["Geometry"]
    graph.node("NodeGroupOutput", {"Geometry": _described(graph, given["Geometry"], known, kinds.items())})
    group[DESCRIBES] = key
    return group


def _described(
    graph: NodeGraph, shape: bpy.types.NodeSocket, known: bpy.types.NodeSocket, kinds: Iterable[tuple[str, str]]
) -> bpy.types.NodeSocket:
    """The tubes of struts with what is known of each.

    A strut is an island of the mesh, in the order of the struts; before them come their caps, two each, from the last
    strut to the first.
    """
    islands = graph.node("GeometryNodeInputMeshIsland").outputs
    inputs = {"Geometry": shape, "Value": islands["Island Count"]}
    count = first_output(graph.node("GeometryNodeSampleIndex", inputs, data_type="INT"))
    struts = graph.node("GeometryNodeAttributeDomainSize", {"Geometry": known}).outputs["Point Count"]
    parts = graph.math("DIVIDE", count, struts)
    alone, capped = (graph.math("COMPARE", parts, wanted, 1e-6) for wanted in (1.0, 3.0))
    tube = graph.math("SUBTRACT", islands["Island Index"], graph.math("SUBTRACT", count, struts))
    pair = graph.math("FLOOR", graph.math("DIVIDE", islands["Island Index"], 2.0))
    of_cap = graph.math("SUBTRACT", graph.math("SUBTRACT", struts, 1.0), pair)
    strut = graph.switch("FLOAT", graph.math("LESS_THAN", tube, -0.5), tube, of_cap)
    described = shape
    for name, kind in kinds:
        inputs = {"Geometry": known, "Value": graph.attribute(name, kind), "Index": strut}
        value = graph.node("GeometryNodeSampleIndex", inputs, data_type=kind)
        stored = {"Geometry": described, "Name": name, "Value": value}
        described = first_output(graph.node("GeometryNodeStoreNamedAttribute", stored, data_type=kind, domain="POINT"))
    return graph.switch("GEOMETRY", graph.math("ADD", alone, capped), shape, described)
