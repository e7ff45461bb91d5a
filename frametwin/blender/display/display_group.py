"""The node group *FrameTwin Display*: how Curves with a twin's attributes are drawn, and in which colours.

Colours are worked out in the group and stored as the colour attribute `COLOUR`, which Solid shading shows by
*Color > Attribute* and the one material, an emission, everywhere else. What is changed is the modifier's inputs.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import bpy

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.colours import LOOKS, MAPS, MISSING_COLOUR, PLAN_COLOUR, State, colour_map
from frametwin.blender.display.display_inputs import (
    ATTRIBUTE,
    BATCH,
    BY_TIME,
    DASHES,
    EXAGGERATION,
    FIRST,
    GHOST,
    HIGHLIGHT,
    HIGHLIGHTED,
    KEY,
    LAST,
    MAP,
    SIDES,
    START,
    STEP,
    UNIT,
    add_interface,
    set_inputs,
    set_menu,
)
from frametwin.blender.rendering.versions import node_tree
from frametwin.blender.scene.node_graph import NodeGraph, find_socket, first_output

NAME = "FrameTwin Display"
VERSION = 1
COLOUR = "colour"

_Building = Generator[None, None, bpy.types.NodeSocket]
"""Some nodes, made in steps of a few milliseconds: each link that is made costs more, the more there are."""

DASH = 10
"""Dashes on a strut that is missing all along."""


def add_display(obj: bpy.types.Object, **inputs: Any) -> bpy.types.Modifier:
    """Draw a Curves object by the group; see `set_inputs` for the rest."""
    modifier = obj.modifiers.new(NAME, "NODES")
    modifier.node_group = display_group()
    modifier.show_group_selector = False
    set_inputs(obj, inputs)
    return modifier


def display_group() -> bpy.types.NodeTree:
    """The group, made when there is none."""
    return run_steps(display_group_steps())


def display_group_steps() -> Generator[None, None, bpy.types.NodeTree]:
    """Do as `display_group` in steps of some milliseconds; if they are not gone on with, no half of it is left."""
    for group in bpy.data.node_groups:
        if group.library is None and group.get(KEY) == VERSION:
            return group
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    try:
        yield from _build(group)
        group[KEY] = VERSION
    finally:
        if KEY not in group:
            bpy.data.node_groups.remove(group)
            remove_unused_display()
    return group


def _build(group: bpy.types.NodeTree) -> Generator[None, None, None]:
    group.is_modifier = True
    group.description = "Draws the struts of a twin by their attributes"
    add_interface(group)
    graph = NodeGraph(group)
    given = graph.node("NodeGroupInput").outputs
    yield
    kept = yield from _without_later_batches_steps(graph, given)
    exaggerated = yield from _exaggerated_steps(graph, given, kept)
    coloured = yield from _coloured_steps(graph, given, exaggerated)
    radius = yield from _scale_steps(graph, given)
    broken = graph.node("GeometryNodeSeparateGeometry", {0: coloured, 1: graph.attribute("missing")}, domain="CURVE")
    whole = _tubes(graph, broken.outputs[1], radius, given)
    yield
    parts = _tubes(graph, broken.outputs[0], radius, given)
    yield
    dashed = yield from _dashed_steps(graph, parts)
    parts = graph.switch("GEOMETRY", given[DASHES], parts, dashed)
    ghost = yield from _ghost_steps(graph, given, kept)
    shown = graph.switch("GEOMETRY", given[GHOST], None, ghost)
    yield
    carrier = _carrier(graph, given)
    yield
    drawn = _joined(graph, [carrier, whole, parts, shown])
    yield
    smooth = graph.node("GeometryNodeSetShadeSmooth", {0: drawn})
    drawn = graph.node("GeometryNodeSetMaterial", {"Geometry": smooth, "Material": display_material()})
    graph.node("NodeGroupOutput", {"Geometry": drawn})
    yield
    set_menu(group)


def display_material() -> bpy.types.Material:
    """The material of all struts: it shows the colour attribute as it is, unlit."""
    for material in bpy.data.materials:
        if material.library is None and material.get(KEY) == VERSION:
            return material
    material = bpy.data.materials.new(NAME)
    material[KEY] = VERSION
    graph = NodeGraph(node_tree(material))
    colour = graph.node("ShaderNodeAttribute", attribute_name=COLOUR)
    shader = graph.node("ShaderNodeEmission", {"Color": colour.outputs["Color"]})
    graph.node("ShaderNodeOutputMaterial", {"Surface": shader})
    return material


def remove_unused_display() -> None:
    """Remove group, material and carrier if nothing is drawn by them any more."""
    for group in [group for group in bpy.data.node_groups if KEY in group and not group.users]:
        bpy.data.node_groups.remove(group)
    if any(KEY in group for group in bpy.data.node_groups):
        return
    bpy.data.batch_remove([material for material in bpy.data.materials if KEY in material and not material.users])
    bpy.data.batch_remove([obj for obj in bpy.data.objects if KEY in obj])
    bpy.data.batch_remove([mesh for mesh in bpy.data.meshes if KEY in mesh and not mesh.users])


def _without_later_batches_steps(graph: NodeGraph, given: Any) -> _Building:
    frame = graph.node("GeometryNodeInputSceneTime").outputs["Frame"]
    past = graph.math("FLOOR", graph.math("DIVIDE", graph.math("SUBTRACT", frame, given[START]), given[STEP]))
    last = graph.switch("FLOAT", given[BY_TIME], given[BATCH], past)
    yield
    later = graph.math("GREATER_THAN", graph.attribute("batch"), last)
    inputs = {"Geometry": given["Geometry"], "Selection": later}
    fewer = first_output(graph.node("GeometryNodeDeleteGeometry", inputs, domain="CURVE"))
    all_of_it = graph.math("LESS_THAN", last, -0.5)
    kept = graph.switch("GEOMETRY", all_of_it, fewer, given["Geometry"])
    yield
    return kept


def _exaggerated_steps(graph: NodeGraph, given: Any, curves: Any) -> _Building:
    factor = graph.math("SUBTRACT", given[EXAGGERATION], 1.0)
    more = graph.math("GREATER_THAN", factor, 0.0)
    moved = yield from _moved_steps(graph, curves, factor)
    return graph.switch("GEOMETRY", more, curves, moved)


def _moved_steps(graph: NodeGraph, curves: Any, factor: Any) -> _Building:
    """Curves with points and handles moved on by a multiple of their displacement."""
    points = graph.node(
        "GeometryNodeSetPosition",
        {"Geometry": curves, "Offset": graph.vector_math("SCALE", graph.attribute("displacement", _VECTOR), factor)},
    )
    moved = first_output(points)
    yield
    for side in ("left", "right"):
        difference = graph.vector_math(
            "SUBTRACT", graph.attribute(f"displacement_{side}", _VECTOR), graph.attribute("displacement", _VECTOR)
        )
        inputs = {"Curve": moved, "Offset": graph.vector_math("SCALE", difference, factor)}
        moved = first_output(graph.node("GeometryNodeSetCurveHandlePositions", inputs, mode=side.upper()))
        yield
    return moved


_VECTOR = "FLOAT_VECTOR"


def _as_drawn(graph: NodeGraph, curves: Any) -> bpy.types.NodeSocket:
    """The points at which curves are drawn."""
    node = graph.node("GeometryNodeResampleCurve", {"Curve": curves})
    if hasattr(node, "mode"):
        node.mode = "EVALUATED"
    else:  # from Blender 5.0 on
        find_socket(node.inputs, "Mode").default_value = "Evaluated"
    return first_output(node)


def _coloured_steps(graph: NodeGraph, given: Any, curves: Any) -> _Building:
    """The points at which curves are drawn, with their colours."""
    value = graph.math("MULTIPLY", graph.attribute(given[ATTRIBUTE]), given[UNIT])
    share = graph.math(
        "DIVIDE", graph.math("SUBTRACT", value, given[FIRST]), graph.math("SUBTRACT", given[LAST], given[FIRST])
    )
    yield
    menu = graph.node("GeometryNodeMenuSwitch", data_type="RGBA")
    while len(menu.enum_items) < len(MAPS):
        menu.enum_items.new("")
    for item, name in zip(menu.enum_items, MAPS, strict=True):
        item.name = name
    graph.tree.links.new(given[MAP], menu.inputs[0])
    yield
    for name in MAPS:
        ramp = yield from _ramp_steps(graph, share, name)
        graph.tree.links.new(ramp, find_socket(menu.inputs, name))
        yield
    known = graph.node("FunctionNodeCompare", {"A": value, "B": value, "Epsilon": 0.0}, operation="EQUAL")
    state = graph.attribute("state", "INT")
    colours = [(*LOOKS[kind].colour, 1.0) for kind in State]
    plain = graph.pick("RGBA", state, colours)
    yield
    measured = graph.math("MULTIPLY", known, graph.math("LESS_THAN", state, 0.5))
    colour = graph.switch("RGBA", measured, plain, first_output(menu))
    colour = graph.switch("RGBA", graph.attribute("missing", "BOOLEAN"), colour, (*MISSING_COLOUR, 1.0))
    yield
    inputs = {"Geometry": _as_drawn(graph, curves), "Name": COLOUR, "Value": colour}
    stored = graph.node("GeometryNodeStoreNamedAttribute", inputs, data_type="FLOAT_COLOR", domain="POINT")
    return first_output(stored)


def _ramp_steps(graph: NodeGraph, share: Any, name: str) -> _Building:
    node = graph.node("ShaderNodeValToRGB", {0: share})
    colours = colour_map(name)
    elements = node.color_ramp.elements
    for i, colour in enumerate(colours.tolist()):
        place = i / (len(colours) - 1)
        element = elements[0] if i == 0 else elements[-1] if i == len(colours) - 1 else elements.new(place)
        element.position, element.color = place, (*colour, 1.0)
        if i % 4 == 3:
            yield
    return first_output(node)


def _scale_steps(graph: NodeGraph, given: Any) -> _Building:
    """The radius of the struts as drawn."""
    share = graph.pick("FLOAT", graph.attribute("state", "INT"), [LOOKS[kind].radius for kind in State])
    yield
    stands_out = graph.switch("FLOAT", graph.attribute(HIGHLIGHTED, "BOOLEAN"), 0.2, 1.2)
    share = graph.math("MULTIPLY", share, graph.switch("FLOAT", given[HIGHLIGHT], 1.0, stands_out))
    yield
    return graph.math("MULTIPLY", share, graph.attribute("radius"))


def _tubes(graph: NodeGraph, curves: Any, radius: Any, given: Any) -> bpy.types.NodeSocket:
    circle = graph.node("GeometryNodeCurvePrimitiveCircle", {"Resolution": given[SIDES], "Radius": 1.0})
    inputs = {"Curve": curves, "Profile Curve": circle, "Scale": radius, "Fill Caps": True}
    return first_output(graph.node("GeometryNodeCurveToMesh", inputs))


def _dashed_steps(graph: NodeGraph, tubes: Any) -> _Building:
    """Tubes without every other piece of what is missing."""
    place = graph.math("FRACT", graph.math("MULTIPLY", graph.attribute("parameter"), float(DASH)))
    gap = graph.math("GREATER_THAN", place, 0.5)
    yield
    gone = graph.math("MULTIPLY", gap, graph.attribute("missing"))
    inputs = {"Geometry": tubes, "Selection": graph.math("GREATER_THAN", gone, 0.5)}
    left = first_output(graph.node("GeometryNodeDeleteGeometry", inputs, domain="FACE"))
    yield
    return left


def _ghost_steps(graph: NodeGraph, given: Any, curves: Any) -> _Building:
    look = LOOKS[State.PLAN]
    planned = yield from _moved_steps(graph, curves, -1.0)
    inputs = {
        "Geometry": _as_drawn(graph, planned),
        "Name": COLOUR,
        "Value": (*PLAN_COLOUR, 1.0),
    }
    coloured = graph.node("GeometryNodeStoreNamedAttribute", inputs, data_type="FLOAT_COLOR", domain="POINT")
    yield
    circle = graph.node("GeometryNodeCurvePrimitiveCircle", {"Resolution": 3, "Radius": 1.0})
    share = graph.switch("FLOAT", given[HIGHLIGHT], look.radius, 0.4 * look.radius)
    radius = graph.math("MULTIPLY", graph.attribute("radius"), share)
    yield
    inputs = {"Curve": coloured, "Profile Curve": circle, "Scale": radius, "Fill Caps": True}
    return first_output(graph.node("GeometryNodeCurveToMesh", inputs))


def _joined(graph: NodeGraph, parts: list[Any]) -> bpy.types.NodeSocket:
    """One geometry of several; what is said of the whole is that of the first."""
    node = graph.node("GeometryNodeJoinGeometry")
    for part in reversed(parts):  # Blender has the last link first
        graph.tree.links.new(part, node.inputs[0])
    return first_output(node)


def _carrier(graph: NodeGraph, given: Any) -> bpy.types.NodeSocket:
    """A mesh of one loose vertex, on a strut, that makes `COLOUR` the active attribute of all that is joined to it.

    A mesh that nodes make of curves has none, and Solid shading would not know which attribute to show.
    """
    info = graph.node("GeometryNodeObjectInfo", {"Object": _carrier_object()})
    position = graph.node("GeometryNodeInputPosition")
    first = graph.node("GeometryNodeSampleIndex", {"Geometry": given["Geometry"], "Value": position}, data_type=_VECTOR)
    inputs = {"Geometry": info.outputs["Geometry"], "Position": first_output(first)}
    return first_output(graph.node("GeometryNodeSetPosition", inputs))


def _carrier_object() -> bpy.types.Object:
    mesh = bpy.data.meshes.new(NAME)
    mesh.vertices.add(1)
    mesh.color_attributes.new(COLOUR, "FLOAT_COLOR", "POINT")
    mesh.color_attributes.active_color_index = mesh.color_attributes.render_color_index = 0
    obj = bpy.data.objects.new(NAME, mesh)
    mesh[KEY] = obj[KEY] = VERSION
    return obj
