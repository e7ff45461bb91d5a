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

ABOUT_USUAL = PRINT_TO_PRINT / np.sqrt(2.0)
"""The same from what is usual for the material: then any two prints differ by `PRINT_TO_PRINT`."""


def write_material(
    path: PathLike,
    estimate: MaterialEstimate,
    more: Mapping[str, Any] | None = None,
    usual: MaterialEstimate | None = None,
) -> None:
    """Write what a print has told of its material, and what is ``usual`` for that, with relative errors."""
    content: dict[str, Any] = {"format": FORMAT, "version": VERSION, "prints": estimate.prints}
    for name in QUANTITIES:
        place = GLOBAL.index(name)
        content[name] = {"value": float(np.exp(estimate.mean[place])), "error": estimate.deviation[place]}
        if usual is not None:
            told = {"usual": float(np.exp(usual.mean[place])), "usual_error": usual.deviation[place]}
            content[name].update(told)
    write_json(path, {**content, **(more or {})})


def usual_after(known: MaterialEstimate, found: MaterialEstimate) -> MaterialEstimate:
    """What is usual for a material, by a print and those before it.

    Prints differ from what is usual by `ABOUT_USUAL`, each on its own. What one tells of itself is told of the usual as
    well, as far as both were unknown before (the smoother of H. Rauch, F. Tung, C. Striebel, AIAA J. 3(8), 1965, in one
    step): after many prints the last one counts no more than the others.

    Parameters
    ----------
    known
        What was known before the print, of the print; see `for_next_print`.
    found
        What it has told of itself.
    """
    mean, deviation = np.array(known.mean), np.array(known.deviation)
    for place in (GLOBAL.index(name) for name in QUANTITIES):
        before = deviation[place] ** 2
        usual = max(before - ABOUT_USUAL**2, 0.0)
        gain = usual / before
        mean[place] += gain * (found.mean[place] - mean[place])
        deviation[place] = np.sqrt(max(usual - gain**2 * (before - found.deviation[place] ** 2), 0.0))
    return MaterialEstimate(tuple(mean.tolist()), tuple(deviation.tolist()), found.prints)


def for_next_print(usual: MaterialEstimate) -> MaterialEstimate:
    """What is known of the next print of a material, given what is usual for it: a little less."""
    more = [ABOUT_USUAL if name in QUANTITIES else 0.0 for name in GLOBAL]
    return replace(usual, deviation=tuple(np.hypot(usual.deviation, more).tolist()))


def read_material(path: PathLike) -> MaterialEstimate:
    """Read what a print has told of its material; which way it leans is its own, and in no file.

    Parameters
    ----------
    path
        A file, or a job, whose last answered batch has one.

    Raises
    ------
    InputError
        If there is none, or it is damaged.
    """
    data, path = _data(path)
    return _estimate(data, path, ("value", "error"))


def read_usual(path: PathLike) -> MaterialEstimate:
    """Read what is usual for a material, by all prints that a file knows of; see `read_material`.

    Files that have nothing of the kind tell of one print, from which the usual differs by `ABOUT_USUAL`.
    """
    data, path = _data(path)
    alone = _estimate(data, path, ("value", "error"))  # what is damaged there may be so elsewhere, too
    if not any(isinstance(data.get(name), dict) and "usual" in data[name] for name in QUANTITIES):
        return for_next_print(alone)
    return _estimate(data, path, ("usual", "usual_error"))


def _data(path: PathLike) -> tuple[dict[str, Any], Path]:
    """What is in a file, or in the last one of a job, and which that is."""
    path = Path(path)
    if path.is_dir():
        found = sorted(path.glob(f"batches/*/{NAME}"))
        if not found:
            raise InputError.at(path, NAME, "is in no batch", "give a job that compensates, with answered batches")
        path = found[-1]
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    return data, path


def _estimate(data: Mapping[str, Any], path: Path, keys: tuple[str, str]) -> MaterialEstimate:
    """The estimate under two keys of each quantity: its value and its error."""
    mean, deviation = list(GUESS.mean), list(GUESS.deviation)
    for name in QUANTITIES:
        place, entry = GLOBAL.index(name), data.get(name)
        value, error = (_above_zero(entry, key) for key in keys)
        if value is None or error is None:
            remedy = f"give {keys[0]!r} and {keys[1]!r}, numbers above 0"
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
