"""Checked arrays from whatever the user's files hold."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Any

import numpy as np

from frametwin.errors import InputError

_KINDS: dict[str, tuple[str, type, str]] = {
    "f": ("fiu", np.float64, "numbers"),
    "i": ("iu", np.int64, "whole numbers"),
    "b": ("b", np.bool_, "true or false"),
}

LARGEST = 1e12
"""Greatest number in a file that is believed; squares and cubes of it stay far from overflowing."""


def _shape_text(shape: tuple[int | None, ...]) -> str:
    if not shape:
        return "a single value"
    return " x ".join("any number" if side is None else str(side) for side in shape)


def _has_booleans(value: Any, depth: int) -> bool:
    """True if nested lists of this depth hold booleans; numpy would silently count them as 0 and 1."""
    flat: Iterable[Any] = value if depth > 0 else [value]
    for _ in range(depth - 1):
        flat = chain.from_iterable(flat)
    return not {bool, np.bool_}.isdisjoint(map(type, flat))


def is_plain_text(value: Any) -> bool:
    """True for a text that is not blank and free of control characters and of halves of characters."""
    return (
        isinstance(value, str)
        and bool(value.strip())
        and not any(ord(char) < 32 or 0xD800 <= ord(char) <= 0xDFFF for char in value)
    )


def index_text(index: Any) -> str:
    """Write an index tuple the way it is written in code: ``[3][1]``."""
    return "".join(f"[{int(i)}]" for i in index)


def checked_array(
    value: Any, kind: str, shape: tuple[int | None, ...], source: str, field: str, remedy: str | None = None
) -> np.ndarray:
    """Copy ``value`` into an array of the wanted kind and shape, or say what is wrong with it.

    Parameters
    ----------
    value
        An array or a nested list.
    kind
        ``"f"`` float64 (whole numbers are welcome), ``"i"`` int64, ``"b"`` bool (numbers are refused).
    shape
        The shape; ``None`` stands for any length.
    source, field
        What to call the file and the field in messages.
    remedy
        What to do, where there is something better to say than the obvious.

    Raises
    ------
    InputError
        If it is ragged, of another type or shape, not finite, or beyond `LARGEST`.
    """
    allowed, dtype, words = _KINDS[kind]
    if type(value) is float and kind == "f" and not shape and abs(value) <= LARGEST:
        return np.array(value)
    wanted = f"give {words}, {_shape_text(shape)}" if remedy is None else remedy
    if value is None:
        raise InputError.at(source, field, "is missing", wanted)
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError.at(source, field, "its rows are not of one length or not numbers", wanted) from error
    if array.size == 0 and not isinstance(value, np.ndarray):
        array = array.astype(dtype)  # an empty list has neither type nor width of its own
        array = array.reshape([side or 0 for side in shape]) if shape and shape[0] is None else array
    mixed = kind != "b" and isinstance(value, list | tuple | bool) and _has_booleans(value, array.ndim)
    if array.dtype.kind not in allowed or mixed:
        raise InputError.at(source, field, f"does not hold {words} only", wanted)
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        found = _shape_text(array.shape)
        raise InputError.at(source, field, f"is {found} where {_shape_text(shape)} is needed", wanted)
    if kind == "i" and array.dtype == np.uint64 and array.size and array.max() > np.iinfo(np.int64).max:
        raise InputError.at(source, field, "holds a number that is too large", wanted)
    result: np.ndarray = array.astype(dtype)  # a copy in any case
    if kind == "f" and not (np.abs(result) <= LARGEST).all():
        place = np.argwhere(~(np.abs(result) <= LARGEST))[0]
        problem = "is too large to be true" if np.isfinite(result[tuple(place)]) else "is not a finite number"
        raise InputError.at(source, f"{field}{index_text(place)}", problem, "replace it by a finite number")
    return result
