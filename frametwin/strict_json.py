"""JSON: read more strictly than by the standard library, written so that people can read it."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from typing import Any

from frametwin.errors import InputError
from frametwin.whole_files import PathLike, read_text, write_text


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


def _plain(value: Any) -> Any:
    """Turn numpy arrays and scalars into lists and numbers (found by their ``tolist``)."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def _rows_of_numbers(value: Any) -> bool:
    """Whether a value is an array of rows of numbers or booleans, none of which is empty."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    return kind in tuple("biuf") and value.ndim > 1 and value.size > 0


def _in_lines(array: Any, write: Callable[[Any], str], indent: str) -> str:
    """Such an array with a line for each of its rows.

    All is written at once, and taken apart where there are as many brackets as between two rows alone: to write row by
    row takes longer than to write all numbers.
    """
    closed, opened = "]" * (array.ndim - 1), "[" * (array.ndim - 1)
    rows = write(array.tolist())[1:-1].replace(f"{closed}, {opened}", f"{closed},\n{indent}  {opened}")
    return f"[\n{indent}  {rows}\n{indent}]"


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
        inner = indent + "  "
        if _rows_of_numbers(value):
            return _in_lines(value, compact, indent)
        value = value.tolist() if hasattr(value, "tolist") else value
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
