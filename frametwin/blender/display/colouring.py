"""Struts coloured by a quantity: which inputs of the display are set, and what its colours mean."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.display import display_inputs as display
from frametwin.blender.display.colours import DIVERGING, MAPS, SEQUENTIAL, Legend, colour_map
from frametwin.blender.display.quantities import BOTH, LOW, quantity_named, quantity_shown_by
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.frames.records import KEY as RECORD_KEY
from frametwin.blender.scene.placement import label
from frametwin.errors import InputError

AUTOMATIC_KEY = "frametwin_automatic"


def colour_struts(
    obj: bpy.types.Object,
    values: StrutValues,
    low: float | None = None,
    high: float | None = None,
    map_name: str | None = None,
) -> Legend:
    """Colour a Curves object by an attribute of its own; nothing but the inputs of its display is changed.

    Parameters
    ----------
    obj
        Made by `frametwin.blender.frames.strut_curves.strut_curves_steps`, with the display.
    values
        The quantity, for the range.
    low, high
        Of the range; what suits the values by default.
    map_name
        One of `MAPS`; one that suits the quantity by default.

    Raises
    ------
    InputError
        If the range is empty, there is no such map, or the object has no display (any more).
    """
    quantity = quantity_named(values.quantity)
    suits = quantity.automatic_range(values.values)
    start, end = (float(suits[i] if wanted is None else wanted) for i, wanted in enumerate((low, high)))
    if not end > start:
        raise InputError.at(label(obj), "range", f"{start:g} to {end:g} is empty", "give a high above the low")
    chosen = suitable_map(quantity.key) if map_name is None else map_name
    if chosen not in MAPS:
        raise InputError.at(label(obj), "colour map", f"{chosen!r} is not known", f"give one of {', '.join(MAPS)}")
    if display.display_modifier(obj) is None:
        raise InputError.at(label(obj), "modifiers", "lack the display", "import the run again")
    automatic = low is None and high is None
    first, last = (end, start) if quantity.bad == LOW else (start, end)
    unit = float(obj.data[RECORD_KEY]["mm_per_unit"]) if quantity.in_units else 1.0
    inputs = {display.ATTRIBUTE: quantity.attribute, display.UNIT: unit, display.MAP: chosen}
    display.set_inputs(obj, {**inputs, display.FIRST: first, display.LAST: last})
    obj[AUTOMATIC_KEY] = automatic
    falling = quantity.bad == LOW
    return Legend(quantity.key, quantity.unit, start, end, colour_map(chosen), automatic, falling, chosen)


def suitable_map(quantity: str) -> str:
    """The colour map for a quantity, by its key."""
    return DIVERGING if quantity_named(quantity).bad == BOTH else SEQUENTIAL


def legend_of(obj: bpy.types.Object) -> Legend | None:
    """What the colours of a Curves object mean, as its display stands, whoever set it; ``None`` if it has none."""
    if display.display_modifier(obj) is None:
        return None
    first, last = (shortest(display.get_input(obj, name)) for name in (display.FIRST, display.LAST))
    quantity = quantity_shown_by(str(display.get_input(obj, display.ATTRIBUTE)))
    chosen = str(display.get_input(obj, display.MAP))
    return Legend(
        quantity.key,
        quantity.unit,
        min(first, last),
        max(first, last),
        colour_map(chosen if chosen in MAPS else SEQUENTIAL),
        bool(obj.get(AUTOMATIC_KEY, False)),
        first > last,
        chosen,
    )


def shortest(value: float) -> float:
    """The shortest decimal number that Blender keeps as this one: it has single precision, and 0.1 means 0.1."""
    return float(str(np.float32(value)))


def states_of(obj: bpy.types.Object) -> np.ndarray:
    """The states (see `State`) that struts of a Curves object have, rising, each once."""
    there = obj.data.attributes.get("state") if obj.type == "CURVES" else None
    if there is None:
        return np.zeros(0, dtype=np.int32)
    found = np.empty(len(there.data), dtype=np.int32)
    there.data.foreach_get("value", found)
    return np.unique(found)
