"""Results as files: one for each case, written whole, and looked up again by the conditions that it was made under."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from frametwin import __version__
from frametwin.errors import InputError
from frametwin.files import read_json, write_json
from scripts.evidence.cases import Case

FORMAT = "frametwin-evidence"

BINS = [0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0]
"""Edges in mm of the histogram of the struts' mean errors; the last class has all that is beyond."""

Record = dict[str, Any]
"""``conditions`` of a case, its ``result``, and the ``machine`` and version that it was made with."""


def path_of(out: Path, case: Case) -> Path:
    """Where the result of a case belongs."""
    return out / ("quick" if case.quick else "full") / case.experiment / f"{case.name}.json"


def write_record(out: Path, case: Case, result: dict[str, Any]) -> None:
    """Write the result of a case, whole or not at all."""
    path = path_of(out, case)
    path.parent.mkdir(parents=True, exist_ok=True)
    machine = {"system": platform.system(), "processor": platform.machine(), "cores": os.cpu_count()}
    head = {"format": FORMAT, "version": 1, "frametwin": __version__, "machine": machine}
    write_json(path, {**head, "conditions": case.conditions, "result": result})


def is_done(out: Path, case: Case) -> bool:
    """Whether the result of a case is there, made under the very same conditions."""
    path = path_of(out, case)
    if not path.is_file():
        return False
    try:
        return read_json(path).get("conditions") == case.conditions
    except InputError:  # spoilt by others than us: it is made again
        return False


def read_records(out: Path) -> list[Record]:
    """All results in a folder, in the order of their paths.

    Raises
    ------
    InputError
        If a file there is no result.
    """
    return [_read(path) for path in sorted(out.glob("*/*/*.json"))]


def _read(path: Path) -> Record:
    record = read_json(path)
    if record.get("format") != FORMAT:
        raise InputError.at(path, "format", f"is not {FORMAT}", "move files of other kinds elsewhere")
    return record


def best(records: Iterable[Record], experiment: str) -> dict[str, Record]:
    """Results of an experiment by the names of their cases; those of full size count where there are both."""
    found: dict[str, Record] = {}
    for record in records:
        conditions = record["conditions"]
        if conditions["experiment"] == experiment and (conditions["name"] not in found or not conditions["quick"]):
            found[conditions["name"]] = record
    return found
