"""Fields and buttons that can be read however narrow the sidebar is."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import bpy

from .translations import CONTEXT, translated

CHARACTER = 6.6
"""Width of a character of a label in pixels, at a resolution scale of 1; labels that are wrapped by it fit."""

ICON = 24
"""Width of an icon, as well."""

BUTTON = 24
"""Width of a button with an icon alone, as well."""

PADDING = 4
"""Width of a button besides text and icon, as well."""

BESIDES = 64
"""What a sidebar has besides its panels' contents, as well: tabs and margins."""

USUAL = 260
"""Width of a region that is not there, as in tests."""

NARROW = 180
"""Room for contents from which on names stand beside their fields."""


def room(context: bpy.types.Context) -> float:
    """Pixels for the contents of a panel, at a resolution scale of 1."""
    width: float = context.region.width if context.region else USUAL
    return width / context.preferences.system.ui_scale - BESIDES


def is_narrow(context: bpy.types.Context) -> bool:
    """Whether names have no place beside their fields."""
    return room(context) < NARROW


@lru_cache(maxsize=1000)
def text_width(text: str, points: float = 11.0) -> float:
    """How many pixels a text takes on a button, at a resolution scale of 1."""
    import blf

    blf.size(0, points)
    return float(blf.dimensions(0, text)[0])


def _needed(context: bpy.types.Context, text: str) -> float:
    """Pixels of a button with a text."""
    styles = getattr(context.preferences, "ui_styles", None)
    points = styles[0].widget.points if styles else 11.0
    return PADDING + text_width(translated(text), points)


def begin(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Set a panel up: names beside fields where there is room for them."""
    layout.use_property_split, layout.use_property_decorate = not is_narrow(context), False


def field(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    data: bpy.types.bpy_struct,
    name: str,
    text: str | None = None,
) -> None:
    """A property; in a narrow sidebar with its name inside of it, or above it where that does not fit."""
    described = data.bl_rna.properties[name]
    shown = described.name if text is None else text
    beside = {} if text is None else {"text": text}
    if not is_narrow(context) or described.type == "BOOLEAN" or _fits_inside(described, shown, context):
        layout.prop(data, name, **beside)
    else:
        layout.label(text=shown, text_ctxt=CONTEXT)
        layout.prop(data, name, text="")


def _fits_inside(described: bpy.types.Property, shown: str, context: bpy.types.Context) -> bool:
    """Whether a number and its name fit into one field."""
    if described.type not in ("INT", "FLOAT") or described.is_array:
        return False
    return _needed(context, f"{translated(shown)} 000.00") + BUTTON / 2 < room(context)


def fit(context: bpy.types.Context, *texts: str, more: float = 0.0) -> bool:
    """Whether buttons with these texts fit side by side.

    ``more`` is what each has besides its text, such as an icon, or its share of a further button; in pixels.
    """
    width = room(context) / len(texts)
    return all(_needed(context, text) + more <= width for text in texts)


def buttons(layout: bpy.types.UILayout, context: bpy.types.Context, *texts: str, more: float = 0.0) -> Any:
    """A row for buttons with these texts, or a column where one of them would be cut off; see `fit`."""
    return layout.row(align=True) if fit(context, *texts, more=more) else layout.column(align=True)


def button(
    layout: bpy.types.UILayout, context: bpy.types.Context, operator: str, text: str, icon: str, short: str = ""
) -> Any:
    """A button as wide as the panel; where it is narrow, without its icon, or with a shorter text."""
    width = _needed(context, text)
    icon = icon if width + ICON < room(context) else "NONE"
    return layout.operator(operator, text=short if short and width > room(context) else text, icon=icon)
