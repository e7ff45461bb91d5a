"""What people read and write: lists in sentences and in tables, sizes of pictures, durations."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

_NUMBER = re.compile(r"(\d+(?:\.\d+)?)")


@lru_cache(maxsize=1 << 16)  # a stream asks for all its pictures, and asks again
def name_order(name: str) -> tuple[tuple[object, ...], str]:
    """By which names are sorted as people number them: numbers in them by value, so that 9 comes before 10.

    What is behind a point counts as a fraction, as in times.
    """
    parts: list[object] = list(_NUMBER.split(name))  # text and numbers take turns, so like is compared with like
    for i in range(1, len(parts), 2):
        whole, _, fraction = str(parts[i]).partition(".")
        parts[i] = (int(whole), fraction)
    return tuple(parts), name


def enumerated(items: Iterable[object]) -> str:
    """Items as in a sentence: "a", "a and b", "a, b and c"; "none" for none."""
    words = [str(item) for item in items]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words) or "none"


def shortened(items: Iterable[object], most: int = 20, rest: str = "more", gap: str = ", ") -> str:
    """Items as in a table: "a, b, c", and "a, b and 5 more" where there are more than ``most``; "none" for none.

    Parameters
    ----------
    items
        What is listed.
    most
        How many of them are shown, 1 or more.
    rest
        What to call those that are not shown.
    gap
        What stands between two of them; where it is no comma, it stands before the last words as well.
    """
    words = [str(item) for item in items]
    shown = gap.join(words[:most]) or "none"
    if len(words) <= most:
        return shown
    return f"{shown}{' ' if gap == ', ' else gap}and {len(words) - most} {rest}"


def listed(struts: Iterable[int], most: int = 8) -> str:
    """Struts by number: "strut 3", "struts 3 and 4", "struts 3, 4 and 20 others"."""
    numbers = [int(strut) for strut in struts]
    if len(numbers) > most:
        return f"struts {shortened(numbers, most, 'others')}"
    return f"{'strut' if len(numbers) == 1 else 'struts'} {enumerated(numbers)}"


def having(struts: Iterable[int], most: int = 8) -> str:
    """Struts as a subject: "strut 3 has", "struts 3 and 4 have"."""
    words = listed(struts, most)
    return f"{words} {'has' if words.startswith('strut ') else 'have'}"


def counted(count: int, noun: str) -> str:
    """So many of something: "1 strut", "3 batches"."""
    ending = "" if count == 1 else "es" if noun.endswith("ch") else "s"
    return f"{count} {noun}{ending}"


def typed(path: Path) -> str:
    """A path as it is typed in a command: in quotation marks where it has blanks."""
    text = str(path)
    return f'"{text}"' if re.search(r"\s", text) else text


def parsed_size(text: str) -> tuple[int, int] | None:
    """(height, width) of pictures, as arrays have them, from a text such as "1600x1200"; ``None`` for others."""
    found = re.fullmatch(r"([1-9]\d{0,4})[x×X]([1-9]\d{0,4})", text.strip())
    return None if found is None else (int(found[2]), int(found[1]))


def size_text(height: int, width: int) -> str:
    """Size of a picture as it is written everywhere: width first, as in "1600x1200"."""
    return f"{width}x{height}"


def duration_text(seconds: float) -> str:
    """How long something takes, to be read at a glance: "9 s", "11 min 41 s", "2 h 5 min"."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    minutes = round(whole / 60)
    return f"{minutes // 60} h {minutes % 60} min"
