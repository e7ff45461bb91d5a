"""Shards that an export has finished, so that it goes on there when it was stopped.

A shard is written under another name, renamed when it is whole, and then noted. Samples are always cut into shards in
the same way, so an export that went on has the same bytes as one that was never stopped.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from frametwin.errors import InputError
from frametwin.files import read_json, write_json

LEDGER = "shards.json"
"""Lies in the folder while shards are written."""

FORMAT = "frametwin-export-shards"
VERSION = 1
WRITING = "shard.writing"
"""Name of the shard that is not whole yet."""


@dataclass(frozen=True)
class Shard:
    """A file that is whole.

    Attributes
    ----------
    part : str
        Of the dataset: ``train``, ``validation`` or ``test``.
    name : str
        Of the file.
    samples : sequence of int
        Indices of the samples in it.
    columns : sequence of str
        Of the table in it, where it holds one.
    """

    part: str
    name: str
    samples: Sequence[int]
    columns: Sequence[str] = ()


class Ledger:
    """The shards of an export in the order in which they were finished.

    Parameters
    ----------
    folder : Path
        Of the shards, which `open_ledger` has seen.

    Attributes
    ----------
    shards : list of Shard
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._notes = read_json(folder / LEDGER)
        self.shards = [Shard(**shard) for shard in self._notes["shards"]]

    def add(self, shard: Shard) -> None:
        """Note a shard that is whole."""
        self.shards.append(shard)
        write_json(self.folder / LEDGER, {**self._notes, "shards": [asdict(shard) for shard in self.shards]})

    @property
    def samples(self) -> set[int]:
        """Indices of the samples that need not be written again."""
        return {index for shard in self.shards for index in shard.samples}

    def names(self) -> dict[str, list[str]]:
        """Names of the files by part."""
        names: dict[str, list[str]] = {}
        for shard in self.shards:
            names.setdefault(shard.part, []).append(shard.name)
        return names

    def counts(self) -> dict[str, int]:
        """Numbers of samples by part."""
        counts: dict[str, int] = {}
        for shard in self.shards:
            counts[shard.part] = counts.get(shard.part, 0) + len(shard.samples)
        return counts


def open_ledger(folder: Path, conditions: Mapping[str, Any], *, anew: bool) -> None:
    """Begin a ledger in a folder, or go on with the one that lies there.

    Parameters
    ----------
    folder
        In which the shards are written.
    conditions
        What the shards depend on, as for a JSON file.
    anew
        Whether shards of other conditions are thrown away.

    Raises
    ------
    InputError
        If shards of other conditions lie there and are not to be thrown away, or other files.
    """
    path = folder / LEDGER
    begun = {"format": FORMAT, "version": VERSION, "conditions": dict(conditions), "shards": []}
    if _is_foreign(folder):
        raise InputError.at(folder, "folder", "holds files that are not of an export", "move them elsewhere")
    if has_shards(folder):
        if read_json(path).get("conditions") == begun["conditions"]:
            (folder / WRITING).unlink(missing_ok=True)
            return
        if not anew:
            problem = "has shards of another export, of another dataset or with other options"
            raise InputError.at(folder, "shards", problem, "finish that one, remove the folder, or allow overwriting")
    shutil.rmtree(folder)
    folder.mkdir()
    write_json(path, begun)


def has_shards(folder: Path) -> bool:
    """Whether a folder holds a ledger with a shard that can be used again."""
    try:
        notes = read_json(folder / LEDGER)
    except InputError:
        return False
    return notes.get("format") == FORMAT and notes.get("version") == VERSION and bool(notes.get("shards"))


def is_to_be_kept(folder: Path) -> bool:
    """Whether a folder in which an export was stopped must stay: it has shards, or was not ours to begin with."""
    return has_shards(folder) or _is_foreign(folder)


def _is_foreign(folder: Path) -> bool:
    return not (folder / LEDGER).is_file() and folder.is_dir() and any(folder.iterdir())
