"""A file of events, one JSON object a line, to which lines are only ever added."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import TracebackType

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.tracking.events import Event


class EventLog:
    """Adds events to a file; each line is written in one piece, so that readers never see half of one.

    What a process that was killed has left of a line is ended first, so that it spoils no other. Use it as a context
    manager.

    Parameters
    ----------
    path : path
        The file; it is made where it does not exist.

    Raises
    ------
    InputError
        If it cannot be written.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path)
        try:
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
            if _torn(self._file):
                os.write(self._file, b"\n")
        except OSError as error:
            raise _not_written(self.path, error) from error

    def __enter__(self) -> EventLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    def add(self, event: Event) -> None:
        """Add an event.

        Raises
        ------
        InputError
            If the disk is full, or the file is gone.
        """
        line = json.dumps(event.as_dict(), ensure_ascii=False, allow_nan=False) + "\n"
        try:
            os.write(self._file, line.encode("utf-8"))
        except OSError as error:
            raise _not_written(self.path, error) from error


def _torn(file: int) -> bool:
    """Whether a file ends in the middle of a line."""
    size = os.fstat(file).st_size
    if size == 0:
        return False
    os.lseek(file, size - 1, os.SEEK_SET)
    return os.read(file, 1) != b"\n"


def _not_written(path: Path, error: OSError) -> InputError:
    remedy = "choose a file in a folder that exists and is writable, on a disk with space"
    return InputError.at(path, "file", f"cannot be written ({error.strerror})", remedy)
