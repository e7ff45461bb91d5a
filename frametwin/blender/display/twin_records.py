"""What a collection with a twin remembers of it, so that files that were saved and undone steps still know it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import idprop
import numpy as np

from frametwin.blender.display.statistics import StrutValues
from frametwin.errors import InputError
from frametwin.twin.verdict import Verdict

KEY = "frametwin_twin"
VERDICT_KEY = "frametwin_verdict"
VERSION = 2


def store_values(
    collection: bpy.types.Collection,
    values: Mapping[str, StrutValues],
    missing: np.ndarray,
    uncertain: np.ndarray,
) -> None:
    """Write quantities of every strut and the findings as custom properties."""
    columns = {name: {"unit": column.unit, "values": column.values} for name, column in values.items()}
    found = {"missing": missing, "uncertain": uncertain}
    flagged = {name: struts.astype(np.int32) for name, struts in found.items() if len(struts)}  # none may be empty
    collection[KEY] = {"version": VERSION, "columns": columns, **flagged}


def store_column(collection: bpy.types.Collection, column: StrutValues) -> None:
    """Add a quantity to those that `store_values` wrote, or replace it."""
    collection[KEY]["columns"][column.quantity] = {"unit": column.unit, "values": column.values}


def load_values(collection: bpy.types.Collection) -> tuple[dict[str, StrutValues], np.ndarray, np.ndarray]:
    """What `store_values` wrote: quantities by name, missing and uncertain struts.

    Raises
    ------
    InputError
        If the collection has none, or was written by another version.
    """
    group = collection.get(KEY)
    where = f"collection {collection.name}"
    if not isinstance(group, idprop.types.IDPropertyGroup):
        raise InputError.at(where, "twin", "holds none", "choose the collection of a twin, or import a run")
    if group.get("version") != VERSION:
        raise InputError.at(where, "twin", "was written by another version", "import its run again")
    columns = {
        name: StrutValues(name, str(column["unit"]), np.array(column["values"], dtype=np.float64))
        for name, column in group["columns"].items()
    }
    struts = [np.array(group.get(name, []), dtype=np.int64) for name in ("missing", "uncertain")]
    return columns, struts[0], struts[1]


def store_verdict(collection: bpy.types.Collection, verdict: Verdict) -> None:
    """Remember what the fit thinks of its twin."""
    collection[VERDICT_KEY] = {"status": verdict.status, "reasons": "\n".join(verdict.reasons)}


def load_verdict(collection: bpy.types.Collection) -> Verdict | None:
    """What the fit thinks of its twin; ``None`` if nobody has said."""
    group: Any = collection.get(VERDICT_KEY)
    if not isinstance(group, idprop.types.IDPropertyGroup):
        return None
    reasons = tuple(reason for reason in str(group.get("reasons", "")).split("\n") if reason)
    return Verdict(str(group.get("status", "")), reasons)
