"""Inputs of the node group *FrameTwin Display*, by their names, on the modifiers that use it."""

from __future__ import annotations

from typing import Any

import bpy

from frametwin.blender.display.colours import MAPS

KEY = "frametwin_display"
"""Custom property of all that belongs to the display."""

ATTRIBUTE, UNIT, FIRST, LAST, MAP = "Colour By", "Unit", "Range From", "Range To", "Colour Map"
EXAGGERATION, DASHES, GHOST, HIGHLIGHT, SIDES = "Exaggeration", "Dash Missing", "Ghost of Plan", "Highlight", "Sides"
BATCH, BY_TIME, START, STEP = "Up to Batch", "Batch by Time", "First Frame", "Frames a Batch"
ALL_BATCHES = -1

HIGHLIGHTED = "highlight"
"""Attribute of the struts that *Highlight* shows in full while the others are drawn thin."""

MOST = 20.0
"""Highest exaggeration."""

_INPUTS: tuple[tuple[str, str, Any, dict[str, Any], str], ...] = (
    (ATTRIBUTE, "String", "displacement_mean", {}, "Attribute that the colours show"),
    (UNIT, "Float", 1.0, {}, "Factor from the attribute's values to those of the range"),
    (FIRST, "Float", 0.0, {}, "Value of the first colour, the good end"),
    (LAST, "Float", 1.0, {}, "Value of the last colour, the bad end; may be lower than the first"),
    (MAP, "Menu", MAPS[0], {}, "Colours from the first to the last value"),
    (EXAGGERATION, "Float", 1.0, {"min_value": 1.0, "max_value": MOST}, "Factor of the displacement from the plan"),
    (DASHES, "Bool", True, {}, "Draw what is missing dashed"),
    (GHOST, "Bool", True, {}, "Draw the plan, thin, inside of the struts and where they should be"),
    (HIGHLIGHT, "Bool", False, {}, f"Draw struts thin but for those of the attribute {HIGHLIGHTED}"),
    (SIDES, "Int", 6, {"min_value": 3, "max_value": 32}, "Sides of a strut"),
    (BATCH, "Int", ALL_BATCHES, {}, "Last batch that is drawn; -1 for all"),
    (BY_TIME, "Bool", False, {}, "Take the last batch from the timeline"),
    (START, "Int", 1, {}, "Frame of the timeline at which batch 0 begins"),
    (STEP, "Int", 24, {"min_value": 1}, "Frames of the timeline for each batch"),
)


def display_modifier(obj: bpy.types.Object) -> bpy.types.Modifier | None:
    """The modifier of an object with this group; ``None`` if it has none."""
    for modifier in obj.modifiers:
        if modifier.type == "NODES" and modifier.node_group is not None and KEY in modifier.node_group:
            return modifier
    return None


def sides_for(struts: int) -> int:
    """Sides of struts that are drawn well and soon, by how many there are."""
    return 8 if struts <= 500 else 6 if struts <= 2000 else 5


def set_inputs(obj: bpy.types.Object, inputs: dict[str, Any]) -> None:
    """Change inputs of an object's display, by their names."""
    modifier = display_modifier(obj)
    if modifier is None:
        return
    for name, value in inputs.items():
        identifier = input_identifier(modifier, name)
        if hasattr(modifier, "properties"):  # from Blender 5.2 on
            getattr(modifier.properties.inputs, identifier).value = value
        elif name == MAP:
            modifier[identifier] = MAPS.index(value)
        else:
            modifier[identifier] = value
    obj.update_tag()


def get_input(obj: bpy.types.Object, name: str) -> Any:
    """The present value of an input; ``None`` for an object without the display."""
    modifier = display_modifier(obj)
    if modifier is None:
        return None
    identifier = input_identifier(modifier, name)
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier).value
    value = modifier[identifier]
    return MAPS[value] if name == MAP else value


def input_identifier(modifier: bpy.types.Modifier, name: str) -> str:
    """Blender's own name of an input."""
    for item in modifier.node_group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name:
            return str(item.identifier)
    raise KeyError(name)


def add_interface(group: bpy.types.NodeTree) -> None:
    new = group.interface.new_socket
    new("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    for name, kind, default, limits, description in _INPUTS:
        socket = new(name, description=description, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        if kind != "Menu":
            socket.default_value = default
        for limit, value in limits.items():
            setattr(socket, limit, value)
    new("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")


def set_menu(group: bpy.types.NodeTree) -> None:
    """The default of the menu, whose entries are known once its node is there."""
    for item in group.interface.items_tree:
        if item.item_type == "SOCKET" and item.name == MAP:
            item.default_value = MAPS[0]
