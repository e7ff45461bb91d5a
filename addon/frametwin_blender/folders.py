"""Where captures and runs are written."""

from __future__ import annotations

from pathlib import Path

import bpy

from frametwin.errors import InputError

from .steps import settings_of


def work_folder(context: bpy.types.Context) -> Path:
    """The chosen folder; else one beside the .blend file, or in the user's home where that was not saved."""
    chosen = settings_of(context).render.folder
    if chosen:
        return given_folder(chosen, "Folder")
    if bpy.data.filepath:
        file = Path(bpy.data.filepath)
        return file.with_name(f"{file.stem}-frametwin")
    return Path.home() / "FrameTwin"


def fresh_folder(parent: Path, kind: str) -> Path:
    """A folder in ``parent`` that does not exist yet, such as ``capture-003``."""
    taken = {path.name for path in parent.glob(f"{kind}-*")} if parent.is_dir() else set()
    number = 1
    while f"{kind}-{number:03d}" in taken:
        number += 1
    return parent / f"{kind}-{number:03d}"


def given_folder(text: str, field: str) -> Path:
    """The folder that a field of the panel names.

    Raises
    ------
    InputError
        If it is empty, or relative to a file that was not saved.
    """
    if not text:
        raise InputError(f"{field} is empty: choose a folder.")
    if text.startswith("//") and not bpy.data.filepath:
        raise InputError(f"{field} {text} is beside a file that was not saved: save the file, or give a whole path.")
    return Path(bpy.path.abspath(text)).absolute()
