"""Scratch folders in the temporary directory; what a killed process left of them is swept by the next one.

Each process that uses a folder keeps a lock on a file of its own in it, the mark. The system takes the lock back when
the process ends, however that comes about: a folder whose marks can all be locked has no owner any more.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from frametwin.files import PathLike

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PREFIX = "frametwin-"
MARK = ".owner-"
VARIABLE = "FRAMETWIN_SCRATCH"
"""Environment variable that tells a process which folder was made for it."""

_marks: dict[str, IO[bytes]] = {}
"""Open marks of this process, by the folder."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A new empty folder in the temporary directory, gone when the block ends.

    Yields
    ------
    Its path.
    """
    folder = make_scratch()
    try:
        yield folder
    finally:
        remove_scratch(folder)


def make_scratch() -> Path:
    """Make a folder that belongs to this process, and sweep those that belong to nobody any more."""
    sweep_scratch()
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        if hold_scratch(folder):
            return folder


def hold_scratch(folder: PathLike) -> bool:
    """Make this process an owner of a folder, besides those that it has; ``False`` if it is gone."""
    mark = Path(folder, f"{MARK}{uuid.uuid4().hex}")
    try:
        stream = open(mark, "xb")  # noqa: SIM115 (it stays open as long as the folder is in use)
    except FileNotFoundError:
        return False
    if not (_lock(stream) and mark.exists()):  # somebody swept it before it was locked
        stream.close()
        return False
    _marks[_key(folder)] = stream
    return True


def remove_scratch(folder: PathLike | None) -> None:
    """Remove a folder that `make_scratch` has made, if there is one, whoever else owns it."""
    if folder and Path(folder).name.startswith(PREFIX):
        _let_go(folder)
        shutil.rmtree(folder, ignore_errors=True)


def sweep_scratch() -> None:
    """Remove the folders of this user in the temporary directory whose owners have all ended."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        try:
            if _is_mine(folder):
                _sweep(folder)
        except OSError:
            continue  # somebody else was quicker, or it cannot be read


def scratch_environment(folder: PathLike) -> dict[str, str]:
    """Environment variables with which a process puts its temporary files into a folder, on every system."""
    return dict.fromkeys((VARIABLE, "TMPDIR", "TEMP", "TMP"), os.fspath(folder))


def _sweep(folder: Path) -> None:
    """Remove a folder unless somebody holds it; one without marks is just being made, or not ours."""
    marks = list(folder.glob(f"{MARK}*"))
    streams: list[IO[bytes]] = []
    try:
        for mark in marks:
            streams.append(open(mark, "r+b"))  # noqa: SIM115 (closed below)
            if not _lock(streams[-1]):
                return
        if not marks:
            return
        if sys.platform == "win32":  # where nobody can remove what is open
            _close(streams)
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        _close(streams)


def _is_mine(folder: Path) -> bool:
    """Whether it is a folder, not a link to one, that this user has made."""
    if folder.is_symlink() or not folder.is_dir():
        return False
    return sys.platform == "win32" or folder.stat().st_uid == os.getuid()


def _key(folder: PathLike) -> str:
    return os.path.realpath(folder)


def _let_go(folder: PathLike) -> None:
    stream = _marks.pop(_key(folder), None)
    if stream is not None:
        stream.close()


def _close(streams: list[IO[bytes]]) -> None:
    while streams:
        streams.pop().close()


def _lock(stream: IO[bytes]) -> bool:
    """Lock an open file until it is closed or this process ends; ``False`` if somebody has it locked."""
    try:
        if sys.platform == "win32":
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
