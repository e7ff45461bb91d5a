"""What came of a comparison, in the panels and on the legend."""

from __future__ import annotations

import bpy

from frametwin.blender.display.comparing import DIFFERENCE, Compared, comparison_of

from .steps import write_text
from .translations import translated

MOST = 3
"""How many of the struts that moved most are named."""


def draw_comparison(layout: bpy.types.UILayout, context: bpy.types.Context, obj: bpy.types.Object | None) -> None:
    """Draw how far an object is from what it was compared with; nothing if it was not."""
    found = None if obj is None else comparison_of(obj)
    if found is None:
        return
    box = layout.box().column(align=True)
    write_text(box, title_of(found), context, "ARROW_LEFTRIGHT")
    if not found.count:
        write_text(box, translated("No strut is in both."), context)
        return
    _draw_row(box, "Struts", str(found.count))
    _draw_row(box, "Mean", f"{found.mean:.3f} mm")
    _draw_row(box, "Largest", f"{found.largest:.3f} mm")
    for strut, distance in list(zip(found.struts, found.distances, strict=True))[:MOST]:
        _draw_row(box, translated("Strut {}").format(strut), f"{distance:.3f} mm")


def _draw_row(box: bpy.types.UILayout, name: str, figure: str) -> None:
    row = box.row()
    row.label(text=name)
    right = row.row()
    right.alignment = "RIGHT"
    right.label(text=figure, translate=False)


def title_of(found: Compared) -> str:
    """What the distances are from."""
    return translated("Distance from {}").format(found.other)


def title_of_colours(quantity: str, name: str, obj: bpy.types.Object | None) -> str:
    """The title of a legend: the name of the quantity, or from what the distances are that the colours show."""
    found = comparison_of(obj) if obj is not None and quantity == DIFFERENCE else None
    return translated(name) if found is None else title_of(found)


CLASSES = ()
