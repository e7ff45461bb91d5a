"""Inputs of a twin's display in the panels."""

from __future__ import annotations

import bpy

from frametwin.blender.display.display_inputs import display_modifier, input_identifier


def draw_input(layout: bpy.types.UILayout, obj: bpy.types.Object, name: str, text: str = "", **options: bool) -> None:
    """An input of an object's display, by its name; nothing for an object without one."""
    modifier = display_modifier(obj)
    if modifier is None:
        return
    identifier = input_identifier(modifier, name)
    if hasattr(modifier, "properties"):  # from Blender 5.2 on
        layout.prop(getattr(modifier.properties.inputs, identifier), "value", text=text or name, **options)
    else:
        layout.prop(modifier, f'["{identifier}"]', text=text or name, **options)
