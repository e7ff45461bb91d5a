"""Folders that are written whole or not at all."""

from __future__ import annotations

import contextlib
import glob
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from frametwin.errors import FrameTwinError, InputError
from frametwin.whole_files import FULL, PathLike, not_written, temporary_name

PART = ".part"
"""Behind the name of a folder that is not whole yet and will be gone on with."""


def remove_leftovers(path: PathLike) -> None:
    """Remove what a process that was killed while it wrote ``path`` has left beside it; only its own caller knows."""
    target = Path(os.path.realpath(path))
    for rest in target.parent.glob(f".{glob.escape(target.name)}.*.part"):
        if rest.is_dir():
            shutil.rmtree(rest, ignore_errors=True)
        else:
            rest.unlink(missing_ok=True)


def missing_parents(path: Path) -> list[Path]:
    """Folders above ``path`` that do not exist, deepest first."""
    missing = []
    for parent in path.parents:
        if parent.exists():
            break
        missing.append(parent)
    return missing


def _refuse_taken(target: Path, path: PathLike, overwrite: bool) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError.at(path, "folder", "is the name of a file", "choose another name for the output folder")
    if not any(target.iterdir()):
        return
    if overwrite and Path.cwd().is_relative_to(target):
        raise InputError.at(path, "folder", "holds the working folder", "choose another output folder")
    if not overwrite:
        raise InputError.at(
            path, "folder", "exists and is not empty", "choose another output folder, or allow overwriting"
        )


def swap_in(staged: Path, target: Path) -> None:
    """Put the finished folder in the place of ``target``, which may exist; the old one is deleted last."""
    if not target.exists():
        os.rename(staged, target)
        return
    old = temporary_name(target)
    os.rename(target, old)
    try:
        os.rename(staged, target)
    except BaseException:
        os.rename(old, target)
        raise
    shutil.rmtree(old)


@contextlib.contextmanager
def _naming(path: PathLike, staged: Path) -> Iterator[None]:
    """Let errors name ``path``, which the user gave, and not the folder that stands in for it."""
    hidden, shown = str(staged), os.fspath(path)
    try:
        yield
    except FrameTwinError as error:
        error.rename(hidden, shown)
        raise
    except OSError as error:
        inside = next((str(name) for name in (error.filename, error.filename2) if hidden in str(name)), None)
        if inside is not None:
            raise not_written(inside.replace(hidden, shown), "file", error) from error
        if error.errno in FULL:
            raise not_written(path, "folder", error) from error
        raise


@contextlib.contextmanager
def staged_directory(
    path: PathLike, overwrite: bool = False, *, keep: Callable[[Path], bool] | None = None
) -> Iterator[Path]:
    """Write a folder whole or not at all.

    Yields a new empty folder beside ``path``. When the block ends well it is renamed to ``path``; when the
    block raises (interrupts too) it is removed, with any parent folders that were made for it.

    Parameters
    ----------
    path
        The folder to be. Its parents are created.
    overwrite
        Replace an existing folder: the new one is swapped in first, then the old one is deleted.
    keep
        Asked about the new folder when the block raises: where it says yes the folder stays, as ``path`` with ``.part``
        behind it, and is yielded again, with what is in it, the next time.

    Raises
    ------
    InputError
        If ``path`` is a file, or a folder with something in it and ``overwrite`` is false, or cannot be made; if the
        disk is full. Errors of `FrameTwinError` that the block raises name ``path`` where they named the new folder,
        of which nobody has heard.
    """
    target = Path(os.path.realpath(path))
    _refuse_taken(target, path, overwrite)
    made = missing_parents(target)
    staged = temporary_name(target) if keep is None else target.with_name(target.name + PART)
    try:
        try:
            staged.mkdir(parents=True, exist_ok=keep is not None)
        except OSError as error:
            raise not_written(path, "folder", error, "made") from error
        with _naming(path, staged):
            yield staged
            _refuse_taken(target, path, overwrite)  # somebody may have put a folder there meanwhile
            swap_in(staged, target)
    except BaseException:
        if keep is not None and keep(staged):
            raise
        shutil.rmtree(staged, ignore_errors=True)
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        raise
