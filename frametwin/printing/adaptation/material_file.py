"""Materials in files: JSON, format ``frametwin-material``, version 1. Every job writes one after each batch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json
from frametwin.printing.adaptation.material_fit import GLOBAL, GUESS, MaterialEstimate

FORMAT = "frametwin-material"
VERSION = 1
NAME = "material.json"

QUANTITIES = ("weight", "hardening", "rest", "axial")
"""As in `frametwin.printing.process.creep.CreepParameters`; hardening in s."""

PRINT_TO_PRINT = 0.3
"""By how much the logarithm of each differs from one print to the next of the same material (standard deviation):
spools, moisture and rooms differ."""


def write_material(path: PathLike, estimate: MaterialEstimate, more: Mapping[str, Any] | None = None) -> None:
    """Write what a print has told of its material: each quantity with its relative error."""
    content: dict[str, Any] = {"format": FORMAT, "version": VERSION, "prints": estimate.prints}
    for name in QUANTITIES:
        place = GLOBAL.index(name)
        content[name] = {"value": float(np.exp(estimate.mean[place])), "error": estimate.deviation[place]}
    write_json(path, {**content, **(more or {})})


def for_next_print(estimate: MaterialEstimate) -> MaterialEstimate:
    """What is known of the material before the next print of it: a little less."""
    more = [PRINT_TO_PRINT if name in QUANTITIES else 0.0 for name in GLOBAL]
    return replace(estimate, deviation=tuple(np.hypot(estimate.deviation, more).tolist()))


def read_material(path: PathLike) -> MaterialEstimate:
    """Read what prints tell of a material; which way a print leans is its own, and in no file.

    Parameters
    ----------
    path
        A file, or a job, whose last answered batch has one.

    Raises
    ------
    InputError
        If there is none, or it is damaged.
    """
    path = Path(path)
    if path.is_dir():
        found = sorted(path.glob(f"batches/*/{NAME}"))
        if not found:
            raise InputError.at(path, NAME, "is in no batch", "give a job that compensates, with answered batches")
        path = found[-1]
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    mean, deviation = list(GUESS.mean), list(GUESS.deviation)
    for name in QUANTITIES:
        place, entry = GLOBAL.index(name), data.get(name)
        value, error = (_above_zero(entry, key) for key in ("value", "error"))
        if value is None or error is None:
            remedy = "give a value and an error above 0"
            raise InputError.at(path, name, "is not a quantity with its error", remedy)
        mean[place], deviation[place] = float(np.log(value)), error
    prints = data.get("prints")
    if type(prints) is not int or prints < 1:
        raise InputError.at(path, "prints", "is no whole number from 1", "give how many prints it was learnt from")
    return MaterialEstimate(tuple(mean), tuple(deviation), prints)


def _above_zero(entry: object, key: str) -> float | None:
    """A number above 0 out of an object, if it holds one."""
    number = entry.get(key) if isinstance(entry, dict) else None
    return float(number) if isinstance(number, int | float) and number is not True and 0.0 < number < 1e9 else None
