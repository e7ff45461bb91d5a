"""What has a colour of its own beside the map: the entries of a legend, for what is really there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from frametwin.blender.display.colouring import states_of
from frametwin.blender.display.colours import LOOKS, MISSING_COLOUR, UNKNOWN_COLOUR, State
from frametwin.blender.display.display_inputs import ATTRIBUTE, DASHES, GHOST, get_input
from frametwin.blender.frames.strut_curves import first_points

SOLID, DASHED, THIN = "solid", "dashed", "thin"


@dataclass(frozen=True)
class Entry:
    """Words of the legend, scene-linear colour, and how it is drawn: `SOLID`, `DASHED` or `THIN`."""

    words: str
    colour: tuple[float, float, float]
    manner: str = SOLID


def legend_entries(objects: Iterable[bpy.types.Object]) -> list[Entry]:
    """The entries for Curves objects that are shown together, each once."""
    found: dict[str, Entry] = {}
    for obj in objects:
        for entry in _entries_of(obj):
            found.setdefault(entry.words, entry)
    return list(found.values())


def _entries_of(obj: bpy.types.Object) -> list[Entry]:
    states = states_of(obj)
    entries = []
    if _values(obj, "missing").any():
        entries.append(Entry("missing", MISSING_COLOUR, DASHED if get_input(obj, DASHES) else SOLID))
    for state in states.tolist():
        if state != State.PRINTED:
            look = LOOKS[State(state)]
            entries.append(Entry(look.words, look.colour, THIN if look.radius < 0.5 else SOLID))
    if State.PRINTED in states and _lack_values(obj):
        entries.append(Entry("no value", UNKNOWN_COLOUR))
    if get_input(obj, GHOST):
        entries.append(Entry(LOOKS[State.PLAN].words, LOOKS[State.PLAN].colour, THIN))
    return entries


def _lack_values(obj: bpy.types.Object) -> bool:
    """Whether printed struts have no value of what the colours show."""
    there = obj.data.attributes.get(get_input(obj, ATTRIBUTE) or "")
    if there is None or there.data_type != "FLOAT":
        return False
    unknown, printed = np.isnan(_values(obj, there.name)), _values(obj, "state") == State.PRINTED
    if there.domain == "CURVE":
        return bool(unknown[printed].any())
    if not unknown.any():
        return False
    missing = _values(obj, "missing")
    if len(missing):
        unknown &= ~missing  # which has a colour of its own
    return bool(unknown[np.repeat(printed, np.diff(first_points(obj.data)))].any())


def _values(obj: bpy.types.Object, name: str) -> np.ndarray:
    there = obj.data.attributes.get(name) if obj.type == "CURVES" else None
    if there is None:
        return np.zeros(0)
    types = {"BOOLEAN": np.bool_, "INT": np.int32, "FLOAT": np.float32}
    found = np.empty(len(there.data), dtype=types[there.data_type])
    there.data.foreach_get("value", found)
    return found
