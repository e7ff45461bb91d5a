"""Node trees made by code: nodes with their inputs in one call, sockets by their names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy


class NodeGraph:
    """A node tree that is being built.

    Parameters
    ----------
    tree
        To which nodes are added, from left to right in the order in which they are made.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, inputs: Mapping[Any, Any] | None = None, **properties: Any) -> bpy.types.Node:
        """Add a node.

        Parameters
        ----------
        kind
            Blender's name of its type.
        inputs
            What its inputs get, by name or place: a socket or node to be linked (of a node, its first output), a value,
            or ``None`` for what Blender has there.
        properties
            Set first, since the sockets depend on them.
        """
        made = self.tree.nodes.new(kind)
        made.location = (220.0 * (len(self.tree.nodes) // 6), -180.0 * (len(self.tree.nodes) % 6))
        for name, value in properties.items():
            setattr(made, name, value)
        for key, value in (inputs or {}).items():
            if value is None:
                continue
            socket = made.inputs[key] if isinstance(key, int) else find_socket(made.inputs, key)
            if isinstance(value, bpy.types.Node):
                value = first_output(value)
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return made

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """A scalar operation on sockets or numbers."""
        return first_output(self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation))

    def vector_math(self, operation: str, first: Any, second: Any) -> bpy.types.NodeSocket:
        """An operation on two vectors; ``SCALE`` takes a number second."""
        inputs = {0: first, ("Scale" if operation == "SCALE" else 1): second}
        return first_output(self.node("ShaderNodeVectorMath", inputs, operation=operation))

    def switch(self, kind: str, condition: Any, otherwise: Any, then: Any) -> bpy.types.NodeSocket:
        """One of two values of a type such as ``RGBA``."""
        inputs = {"Switch": condition, "False": otherwise, "True": then}
        return first_output(self.node("GeometryNodeSwitch", inputs, input_type=kind))

    def attribute(self, name: Any, kind: str = "FLOAT") -> bpy.types.NodeSocket:
        """A named attribute; 0 where there is none."""
        return first_output(self.node("GeometryNodeInputNamedAttribute", {"Name": name}, data_type=kind))

    def pick(self, kind: str, index: Any, values: list[Any]) -> bpy.types.NodeSocket:
        """One of several values, by a whole number."""
        made = self.tree.nodes.new("GeometryNodeIndexSwitch")
        made.data_type = kind
        while len(made.index_switch_items) < len(values):
            made.index_switch_items.new()
        self.tree.links.new(index, made.inputs["Index"])
        for i, value in enumerate(values):
            made.inputs[i + 1].default_value = value
        return first_output(made)


def find_socket(sockets: bpy.types.NodeInputs, name: str) -> bpy.types.NodeSocket:
    """The socket of a name that is in use: those of the data types that were not chosen have the same name."""
    return next(socket for socket in sockets if socket.enabled and socket.name == name)


def first_output(node: bpy.types.Node) -> bpy.types.NodeSocket:
    """The first output that is in use."""
    return next(socket for socket in node.outputs if socket.enabled)
