"""Files read with the errors told in words, and written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import uuid
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from pathlib import Path

from frametwin.errors import InputError

PathLike = str | os.PathLike[str]


def read_bytes(path: PathLike, field: str = "file", remedy: str = "give a file that can be opened") -> bytes:
    """Read a file.

    Raises
    ------
    InputError
        If it is missing, a folder, or not readable.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError as error:
        raise InputError.at(path, field, "the file does not exist", "check the name, or put the file there") from error
    except OSError as error:
        raise InputError.at(path, field, f"cannot be read ({error.strerror})", remedy) from error


def file_hash(path: PathLike, remedy: str = "put the file back") -> str:
    """SHA-256 of a file, hexadecimal.

    Raises
    ------
    InputError
        As `read_bytes`.
    """
    return hashlib.sha256(read_bytes(path, remedy=remedy)).hexdigest()


def decode_text(data: bytes, path: PathLike, field: str = "file") -> str:
    """The UTF-8 text that the file ``path`` holds, every line ending in a line feed; a byte order mark is skipped.

    Raises
    ------
    InputError
        If it is not text.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.at(path, field, "is not a text file", "give a file written as UTF-8 text") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_text(path: PathLike, field: str = "file") -> str:
    """Read a text file; see `read_bytes` and `decode_text`.

    Raises
    ------
    InputError
        If the file is missing, a folder, not readable, or not text.
    """
    return decode_text(read_bytes(path, field), path, field)


def temporary_name(path: Path) -> Path:
    """Give a hidden name beside ``path`` that nobody else uses (same file system, so renaming is atomic)."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")


def write_bytes(path: PathLike, data: bytes) -> None:
    """Write ``data`` to ``path``: afterwards the file is whole and new, or untouched.

    Raises
    ------
    InputError
        If the file cannot be written there (folder missing, no permission, disk full).
    """
    target = Path(path)
    temporary = temporary_name(target)
    try:
        try:
            waiting = _waiting.get()
            with open(temporary, "xb") as stream:
                stream.write(data)
                stream.flush()
                if waiting is None:
                    os.fsync(stream.fileno())
            os.replace(temporary, target)
            if waiting is not None:
                waiting.append(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise not_written(target, "file", error) from error


_waiting: ContextVar[list[Path] | None] = ContextVar("waiting", default=None)
"""Files that were written and are still to be put on disk, where that is done together."""

_SYNC_WORKERS = 8


@contextlib.contextmanager
def synced_together() -> Iterator[None]:
    """Put the files that a block writes on disk at its end, all at once and not one after the other.

    For files that count only once something that comes after the block makes them count. Where the block raises,
    nothing is put on disk.

    Raises
    ------
    InputError
        If a file cannot be put there (disk full).
    """
    waiting: list[Path] = []
    token = _waiting.set(waiting)
    try:
        yield
    finally:
        _waiting.reset(token)
    with ThreadPoolExecutor(_SYNC_WORKERS) as pool:
        for job in [pool.submit(_sync, path) for path in dict.fromkeys(waiting)]:
            job.result()


def _sync(path: Path) -> None:
    try:
        with open(path, "rb+") as stream:
            os.fsync(stream.fileno())
    except FileNotFoundError:
        return  # what was written for a moment alone
    except OSError as error:
        raise not_written(path, "file", error) from error


FULL = (errno.ENOSPC, errno.EDQUOT)


def not_written(path: PathLike, field: str, error: OSError, verb: str = "written") -> InputError:
    """What to tell of a file or folder that the system does not let anybody write."""
    remedy = "free some space, or choose a folder on another disk"
    if error.errno not in FULL:
        remedy = "choose a folder that exists and is writable"
    return InputError.at(path, field, f"cannot be {verb} ({error.strerror})", remedy)


def write_text(path: PathLike, text: str) -> None:
    """Write ``text`` as UTF-8 with the line ends it has; otherwise as `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))
