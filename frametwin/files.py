"""Reading JSON strictly, and writing files and folders whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import glob
import hashlib
import json
import os
import re
import shutil
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from frametwin.errors import FrameTwinError, InputError

PathLike = str | os.PathLike[str]


def _temporary_name(path: Path) -> Path:
    """Give a hidden name beside ``path`` that nobody else uses (same file system, so renaming is atomic)."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")


def remove_leftovers(path: PathLike) -> None:
    """Remove what a process that was killed while it wrote ``path`` has left beside it; only its own caller knows."""
    target = Path(os.path.realpath(path))
    for rest in target.parent.glob(f".{glob.escape(target.name)}.*.part"):
        if rest.is_dir():
            shutil.rmtree(rest, ignore_errors=True)
        else:
            rest.unlink(missing_ok=True)


def write_bytes(path: PathLike, data: bytes) -> None:
    """Write ``data`` to ``path``: afterwards the file is whole and new, or untouched.

    Raises
    ------
    InputError
        If the file cannot be written there (folder missing, no permission, disk full).
    """
    target = Path(path)
    temporary = _temporary_name(target)
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
        raise _not_written(target, "file", error) from error


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
        raise _not_written(path, "file", error) from error


_FULL = (errno.ENOSPC, errno.EDQUOT)


def _not_written(path: PathLike, field: str, error: OSError, verb: str = "written") -> InputError:
    """What to tell of a file or folder that the system does not let anybody write."""
    remedy = "free some space, or choose a folder on another disk"
    if error.errno not in _FULL:
        remedy = "choose a folder that exists and is writable"
    return InputError.at(path, field, f"cannot be {verb} ({error.strerror})", remedy)


def write_text(path: PathLike, text: str) -> None:
    """Write ``text`` as UTF-8 with the line ends it has; otherwise as `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def _plain(value: Any) -> Any:
    """Turn numpy arrays and scalars into lists and numbers (found by their ``tolist``)."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def dump_json(obj: Any) -> str:
    """Format ``obj`` as JSON that people can read: a line for each key, and for each row of a long list.

    Floats are written with as many digits as it takes to read back the same number.

    Raises
    ------
    ValueError
        If a number is NaN or infinite.
    """

    compact = json.JSONEncoder(allow_nan=False, default=_plain, ensure_ascii=False).encode

    def block(value: Any, indent: str) -> str:
        value = value.tolist() if hasattr(value, "tolist") else value
        inner = indent + "  "
        if isinstance(value, dict) and value:
            rows = [f"{inner}{json.dumps(str(key))}: {block(item, inner)}" for key, item in value.items()]
            return "{\n" + ",\n".join(rows) + "\n" + indent + "}"
        if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple | dict):
            return "[\n" + ",\n".join(inner + compact(item) for item in value) + "\n" + indent + "]"
        return compact(value)

    return block(obj, "") + "\n"


def write_json(path: PathLike, obj: Any) -> None:
    """Write ``obj`` as JSON, atomically; arrays and numpy scalars become lists and numbers.

    Raises
    ------
    ValueError
        If a number is NaN or infinite: such files cannot be read elsewhere.
    InputError
        As `write_bytes`.
    """
    write_text(path, dump_json(obj))


class _Damage(ValueError):
    """A fault in JSON that the standard library would let pass: (field, problem, remedy)."""


def _no_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        keys = [key for key, _ in pairs]
        double = next(key for key in keys if keys.count(key) > 1)
        raise _Damage(double, "occurs twice in one object", "keep one of the two")
    return result


def _refuse_constant(text: str) -> float:
    raise _Damage(text, "is not a number", "replace it by a finite number")


_MAYBE_TOO_LARGE = re.compile(r"[\s,:\[]-?\d[\d.]*[eE]\+?\d{3}")  # hashes have such digits too, but begin with a quote


def _finite_float(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise _Damage(text, "is too large for a number", "replace it by a finite number")
    return value


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


def parse_json(text: str, path: PathLike) -> dict[str, Any]:
    """Parse the text of ``path``; see `read_json`."""
    hooks: dict[str, Any] = {"object_pairs_hook": _no_duplicates, "parse_constant": _refuse_constant}
    if _MAYBE_TOO_LARGE.search(text):  # the hook makes reading three times slower
        hooks["parse_float"] = _finite_float
    if not text.strip():
        raise InputError.at(path, "file", "is empty", "write the file again")
    try:
        value = json.loads(text, **hooks)
    except _Damage as damage:
        raise InputError.at(path, *damage.args) from damage
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        if error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated"):
            raise InputError.at(
                path, where, "the JSON is cut short", "write the file again, or copy it whole"
            ) from error
        raise InputError.at(path, where, f"is not JSON ({error.msg})", "correct the text there") from error
    except (RecursionError, ValueError) as error:
        raise InputError.at(path, "file", f"is not usable JSON ({error})", "write the file again") from error
    if not isinstance(value, dict):
        raise InputError.at(path, "file", "does not hold a JSON object", "put the fields between { and }")
    return value


def read_json(path: PathLike) -> dict[str, Any]:
    """Read a file that holds one JSON object, more strictly than the standard library.

    Raises
    ------
    InputError
        If the file is missing, cut short, not JSON, not an object, has a key twice, or holds NaN, Infinity or
        a number beyond the range of a double.
    """
    return parse_json(read_text(path), path)


def check_format(data: dict[str, Any], path: PathLike, name: str, version: int = 1, oldest: int | None = None) -> int:
    """Check the keys ``format`` and ``version`` that every file of FrameTwin carries.

    Returns
    -------
    The file's version: from ``oldest`` (by default the only one) to ``version``.

    Raises
    ------
    InputError
        If either is missing, or not one of those.
    """
    oldest = version if oldest is None else oldest
    if "format" not in data:
        raise InputError.at(path, "format", "is missing", f'add "format": "{name}"')
    if data["format"] != name:
        raise InputError.at(
            path, "format", f"is {data['format']!r} where '{name}' is needed", "give a file of that format"
        )
    if "version" not in data:
        raise InputError.at(path, "version", "is missing", f'add "version": {version}')
    found = data["version"]
    if type(found) is not int or not oldest <= found <= version:
        known = f"only {version} is" if oldest == version else f"only {oldest} to {version} are"
        raise InputError.at(
            path,
            "version",
            f"{found!r} is not known, {known}",
            f"update FrameTwin, or write the file as version {version}",
        )
    return found


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
    old = _temporary_name(target)
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
            raise _not_written(inside.replace(hidden, shown), "file", error) from error
        if error.errno in _FULL:
            raise _not_written(path, "folder", error) from error
        raise


PART = ".part"
"""Behind the name of a folder that is not whole yet and will be gone on with."""


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
    staged = _temporary_name(target) if keep is None else target.with_name(target.name + PART)
    try:
        try:
            staged.mkdir(parents=True, exist_ok=keep is not None)
        except OSError as error:
            raise _not_written(path, "folder", error, "made") from error
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
