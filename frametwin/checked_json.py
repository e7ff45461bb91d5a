"""Values out of JSON, turned into what a type hint says or a file needs, or refused in words."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
import types
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from frametwin.errors import InputError

_NAMES: dict[Any, str] = {
    str: "a text",
    Path: "a path",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    dict: "an object",
    list: "a list",
    tuple: "a list",
    type(None): "null",
}


_DIGEST = re.compile(r"[0-9a-f]{64}")

LARGEST = 1e300
"""Numbers beyond it are no numbers; JSON knows whole ones of any length."""


class _WrongKind(Exception):
    """The value is not of the kind of the hint."""


def convert(value: Any, hint: Any, source: str, field: str) -> Any:
    """Turn a value out of JSON into what a type hint says.

    Parameters
    ----------
    value
        Of JSON, or a numpy array where the hint says ``Any``.
    hint
        ``str``, ``Path``, ``bool``, ``int``, ``float`` (whole numbers are welcome), ``None``, ``dict``, ``list[...]``,
        ``tuple[...]``, a dataclass (from an object with its fields), unions of these, or ``Any``.
    source, field
        What to call them in messages.

    Raises
    ------
    InputError
        If it is of another kind.
    """
    try:
        return _converted(value, hint, source, field)
    except _WrongKind:
        shown = repr(value) if isinstance(value, str | int | float | bool) or value is None else "of another kind"
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise InputError.at(source, field, f"is {shown}", f"give {described(hint)}") from None


def convert_fields(cls: type, values: Mapping[str, Any], source: str, without: Collection[str] = ()) -> dict[str, Any]:
    """Values for some fields of a dataclass, by its type hints.

    Parameters
    ----------
    cls
        The dataclass.
    values
        By name.
    source
        What to call them in messages.
    without
        Fields that are not to be had.

    Raises
    ------
    InputError
        If a name is unknown, or a value of another kind.
    """
    hints = get_type_hints(cls)
    known = [item.name for item in dataclasses.fields(cls) if item.name not in without]
    for name in values:
        if name not in known:
            raise name_problem(source, name, "is not a setting", known)
    return {name: convert(value, hints[name], source, name) for name, value in values.items()}


@contextlib.contextmanager
def told_of(source: str, field: str = "") -> Iterator[None]:
    """Let errors about settings name the file that those come from, and the field there that holds them."""
    try:
        yield
    except InputError as error:
        if not error.parts:
            raise
        place = f"{field}.{error.field}" if field else error.field
        raise InputError.at(source, place, error.problem, error.remedy) from error


def name_problem(source: str, name: str, problem: str, known: Collection[str]) -> InputError:
    """The error for a name that is wrong, with those that would be right."""
    return InputError.at(source, name, problem, f"use one of {', '.join(known)}" if known else "leave it out")


def described(hint: Any) -> str:
    """A kind in words."""
    if get_origin(hint) is Annotated:
        return described(get_args(hint)[0])
    if get_origin(hint) in (Union, types.UnionType):
        return " or ".join(described(part) for part in get_args(hint))
    kind = get_origin(hint) or hint
    if kind in (list, tuple) and get_args(hint):
        inner = [part for part in get_args(hint) if part is not Ellipsis]
        words = {described(part).removeprefix("a ").removeprefix("an ") for part in inner}
        return "a list of " + " and ".join(f"{word}s" for word in sorted(words))
    return _NAMES.get(kind, "an object" if dataclasses.is_dataclass(kind) else "something else")


def _converted(value: Any, hint: Any, source: str, field: str) -> Any:
    if hint is Any:
        return value
    kind = get_origin(hint) or hint
    if kind in (Union, types.UnionType):
        return _any_of(value, get_args(hint), source, field)
    if kind in (list, tuple):
        return kind(_items(value, hint, source, field))
    if dataclasses.is_dataclass(kind) and isinstance(value, dict):
        assert isinstance(kind, type)
        with told_of(source, field):
            given = convert_fields(kind, value, source)
        for item in dataclasses.fields(kind):
            needed = item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING
            if needed and item.name not in given:
                raise InputError.at(source, f"{field}.{item.name}", "is missing", "add it")
        with told_of(source, field):
            return kind(**given)
    if kind is float and is_number(value):
        return float(value)
    if kind is Path and isinstance(value, str) and value and "\0" not in value:
        return Path(value)
    if kind in (str, bool, int, dict, type(None)) and type(value) is kind:
        return value
    raise _WrongKind


def _any_of(value: Any, hints: tuple[Any, ...], source: str, field: str) -> Any:
    for hint in hints:
        try:
            return _converted(value, hint, source, field)
        except _WrongKind:
            continue
    raise _WrongKind


def _items(value: Any, hint: Any, source: str, field: str) -> list[Any]:
    parts = get_args(hint) or (Any, ...)
    if not isinstance(value, list):
        raise _WrongKind
    if get_origin(hint) is list or parts[-1] is Ellipsis:
        parts = (parts[0],) * len(value)
    if len(parts) != len(value):
        raise _WrongKind
    return [_converted(item, part, source, field) for item, part in zip(value, parts, strict=True)]


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, not beyond `LARGEST`; ``True`` is none."""
    return type(value) in (int, float) and abs(value) < LARGEST and not math.isnan(value)


@dataclasses.dataclass(frozen=True)
class Fields:
    """Fields of an object out of a JSON file that the project has written itself.

    Every method returns the value of a field, and raises `InputError` if it is missing or of another kind.

    Attributes
    ----------
    data : mapping
        The object.
    source : str or path
        The file.
    remedy : str
        What to do about a file that is damaged.
    prefix : str
        Where the object is in the file, with what stands before the names of its fields, such as ``samples[3].``.
    """

    data: Mapping[str, Any]
    source: str | Path
    remedy: str
    prefix: str = ""

    def text(self, key: str) -> str:
        """A text."""
        return str(self._value(key, str))

    def whole(self, key: str) -> int:
        """A whole number from 0 up."""
        value = int(self._value(key, int))
        if value < 0:
            raise self.wrong(key, f"is {value}")
        return value

    def object(self, key: str) -> dict[str, Any]:
        """An object."""
        return dict(self._value(key, dict))

    def objects(self, key: str) -> list[Fields]:
        """The objects of a list."""
        values: list[Any] = self._value(key, list)
        for i, item in enumerate(values):
            if not isinstance(item, dict):
                raise self.wrong(f"{key}[{i}]", "is not an object")
        return [Fields(item, self.source, self.remedy, f"{self.prefix}{key}[{i}].") for i, item in enumerate(values)]

    def digest(self, key: str) -> str:
        """A SHA-256 in hexadecimal."""
        value = self.text(key)
        if not _DIGEST.fullmatch(value):
            raise self.wrong(key, "is not a SHA-256 in hexadecimal")
        return value

    def wrong(self, key: str, problem: str) -> InputError:
        """The error for a field."""
        return InputError.at(self.source, f"{self.prefix}{key}", problem, self.remedy)

    def _value(self, key: str, kind: type) -> Any:
        if key not in self.data:
            raise self.wrong(key, "is missing")
        value = self.data[key]
        if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            raise self.wrong(key, f"is not {_NAMES[kind]}")
        return value
