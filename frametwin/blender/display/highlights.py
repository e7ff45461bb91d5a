"""Struts of a twin that are shown in full while the others are drawn thin."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.display.display_inputs import HIGHLIGHT, HIGHLIGHTED, set_inputs
from frametwin.blender.frames.strut_curves import Attribute, read_attribute, write_attribute
from frametwin.blender.scene.placement import label
from frametwin.errors import InputError


def highlight_struts(obj: bpy.types.Object, struts: np.ndarray) -> None:
    """Highlight struts of a Curves object, by index, in the place of those that are highlighted.

    Raises
    ------
    InputError
        If the object is linked from another file, or is not seen although its own switches are on.
    """
    if not (obj.is_editable and obj.data.is_editable):
        raise InputError.at(label(obj), "object", "is linked from another file", "make it local (Object > Relations)")
    if not obj.visible_get():
        raise InputError.at(label(obj), "collection", "is hidden", "show it in the outliner")
    chosen = np.zeros(len(obj.data.curves), dtype=bool)
    chosen[struts] = True
    write_attribute(obj.data, HIGHLIGHTED, Attribute("BOOLEAN", chosen, "CURVE"))
    obj.data.update_tag()
    set_inputs(obj, {HIGHLIGHT: True})


def highlighted_struts(obj: bpy.types.Object) -> np.ndarray:
    """Rising indices of the struts that are highlighted."""
    if obj.data.attributes.get(HIGHLIGHTED) is None:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(read_attribute(obj.data, HIGHLIGHTED))


def clear_highlight(obj: bpy.types.Object) -> None:
    """Show all struts in full again."""
    if highlighted_struts(obj).size and obj.data.is_editable:
        write_attribute(obj.data, HIGHLIGHTED, Attribute("BOOLEAN", np.zeros(len(obj.data.curves)), "CURVE"))
        obj.data.update_tag()
    set_inputs(obj, {HIGHLIGHT: False})
