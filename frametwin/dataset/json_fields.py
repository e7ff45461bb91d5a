"""Fields of ``dataset.json`` and ``sample.json``: of the kind that they have to be, or what is wrong, in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from frametwin.errors import InputError

REMEDY = "generate the dataset again"

_DIGEST = re.compile(r"[0-9a-f]{64}")


def _value(data: Mapping[str, Any], key: str, path: Path, prefix: str, kind: type, words: str) -> Any:
    if key not in data:
        raise InputError.at(path, f"{prefix}{key}", "is missing", REMEDY)
    value = data[key]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError.at(path, f"{prefix}{key}", f"is not {words}", REMEDY)
    return value


def text_of(data: Mapping[str, Any], key: str, path: Path, prefix: str = "") -> str:
    """A text."""
    return str(_value(data, key, path, prefix, str, "a text"))


def object_of(data: Mapping[str, Any], key: str, path: Path) -> dict[str, Any]:
    """An object."""
    return dict(_value(data, key, path, "", dict, "an object"))


def objects_of(data: Mapping[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    """A list of objects."""
    values: list[Any] = _value(data, key, path, "", list, "a list")
    for i, item in enumerate(values):
        if not isinstance(item, dict):
            raise InputError.at(path, f"{key}[{i}]", "is not an object", REMEDY)
    return values


def whole_of(data: Mapping[str, Any], key: str, path: Path, prefix: str = "") -> int:
    """A whole number from 0 up."""
    value = int(_value(data, key, path, prefix, int, "a whole number"))
    if value < 0:
        raise InputError.at(path, f"{prefix}{key}", f"is {value}", REMEDY)
    return value


def digest_of(data: Mapping[str, Any], key: str, path: Path, prefix: str = "") -> str:
    """A SHA-256 in hexadecimal."""
    value = text_of(data, key, path, prefix)
    if not _DIGEST.fullmatch(value):
        raise InputError.at(path, f"{prefix}{key}", "is not a SHA-256 in hexadecimal", REMEDY)
    return value
