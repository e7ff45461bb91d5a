"""Print sequences in files: JSON, format ``frametwin-sequence``, version 1."""

from __future__ import annotations

from typing import Any

from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json
from frametwin.printing.records.sequence import PrintSequence

FORMAT = "frametwin-sequence"
VERSION = 1

_FIELDS = ("struts", "start", "axis", "batch")


def read_sequence(path: PathLike) -> PrintSequence:
    """Read a sequence file.

    Raises
    ------
    InputError
        If the file is missing or damaged, of another format or version, or does not hold a valid sequence.
    """
    return parse_sequence(read_json(path), path)


def parse_sequence(data: dict[str, Any], path: PathLike) -> PrintSequence:
    """Build the sequence from the parsed file; ``path`` is in messages.

    Raises
    ------
    InputError
        As `read_sequence`.
    """
    check_format(data, path, FORMAT, VERSION)
    for field in _FIELDS:
        if field not in data:
            raise InputError.at(path, field, "is missing", f'add "{field}" to the file')
    return PrintSequence(**{field: data[field] for field in _FIELDS}, source=str(path))


def write_sequence(path: PathLike, sequence: PrintSequence) -> None:
    """Write a sequence file, whole or not at all; reading it gives back the same bits.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    fields = {field: getattr(sequence, field) for field in _FIELDS}
    write_json(path, {"format": FORMAT, "version": VERSION, **fields})
