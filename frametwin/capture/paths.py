"""Names of files in a folder that lead nowhere else."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

from frametwin.arrays import is_plain_text
from frametwin.errors import InputError

LONGEST, LONGEST_PART = 4000, 255
"""Bytes of a path, and of a name in it, that file systems take."""


def path_inside(root: Path, name: str, file: Path, field: str) -> Path:
    """Return ``root / name`` unless it leads out of the folder; the name stands in ``field`` of ``file``.

    Raises
    ------
    InputError
        If it does, or is no name.
    """
    remedy = "put the file into the capture and write its path relative to the folder, with forward slashes"
    if not is_plain_text(name):
        raise InputError.at(file, field, f"{name!r} is not a file name", remedy)
    if len(os.fsencode(name)) > LONGEST or any(len(os.fsencode(part)) > LONGEST_PART for part in name.split("/")):
        raise InputError.at(file, field, f"the file name {name[:40]!r}... is too long", remedy)
    if "\\" in name:
        raise InputError.at(file, field, f"{name!r} is not written with forward slashes", remedy)
    windows = PureWindowsPath(name)
    if PurePosixPath(name).is_absolute() or windows.drive or windows.root:
        raise InputError.at(file, field, f"{name!r} is an absolute path", remedy)
    if ".." in PurePosixPath(name).parts:
        raise InputError.at(file, field, f"{name!r} leaves the folder of the capture", remedy)
    path = root / name
    try:
        leads_out = not path.resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError) as error:  # a link to itself
        raise InputError.at(file, field, f"{name!r} is a link that leads nowhere", remedy) from error
    if leads_out:
        raise InputError.at(file, field, f"{name!r} is a link that leaves the folder of the capture", remedy)
    return path
