"""Lists in sentences and in tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from frametwin.wording import (
    counted,
    duration_text,
    enumerated,
    having,
    listed,
    name_order,
    parsed_size,
    shortened,
    size_text,
    typed,
)


@pytest.mark.parametrize(
    ("items", "sentence", "table"),
    [
        ([], "none", "none"),
        (["a"], "a", "a"),
        (["a", "b"], "a and b", "a, b"),
        (["a", "b", "c"], "a, b and c", "a, b, c"),
        (["a", "b", "c", "d"], "a, b, c and d", "a, b, c and 1 more"),
    ],
)
def test_lists(items: list[str], sentence: str, table: str) -> None:
    assert enumerated(items) == sentence and enumerated(iter(items)) == sentence
    assert shortened(items, 3) == table


def test_what_is_left_out_is_counted() -> None:
    assert shortened(range(6), 2, "others") == "0, 1 and 4 others"
    assert shortened(["a, b", "c", "d"], 2, gap="; ") == "a, b; c; and 1 more"
    assert shortened(["a, b", "c"], 2, gap="; ") == "a, b; c"


def test_struts_by_number() -> None:
    assert (listed([3]), having([3])) == ("strut 3", "strut 3 has")
    assert (listed(np.array([3, 4])), having(np.array([3, 4]))) == ("struts 3 and 4", "struts 3 and 4 have")
    assert listed(range(12)) == "struts 0, 1, 2, 3, 4, 5, 6, 7 and 4 others"
    assert having(range(4), most=2) == "struts 0, 1 and 2 others have"


def test_things_are_counted_and_paths_can_be_typed() -> None:
    assert [counted(n, "batch") for n in (0, 1, 2)] == ["0 batches", "1 batch", "2 batches"]
    assert (counted(1, "strut"), counted(3, "strut")) == ("1 strut", "3 struts")
    assert (typed(Path("out") / "job"), typed(Path("my job ö"))) == (str(Path("out") / "job"), '"my job ö"')


def test_sizes_are_written_with_the_width_first() -> None:
    assert parsed_size("1600x1200") == parsed_size(" 1600×1200 ") == (1200, 1600)
    assert size_text(1200, 1600) == "1600x1200"
    for text in ("", "1600", "1600x", "0x10", "1600x1200x3", "1600.5x1200", "-1x5", "big", "123456x10"):
        assert parsed_size(text) is None


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.2, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min 0 s"),
        (701.0, "11 min 41 s"),
        (3599.7, "1 h 0 min"),
        (7500.0, "2 h 5 min"),
        (7195.0, "2 h 0 min"),
    ],
)
def test_durations(seconds: float, words: str) -> None:
    assert duration_text(seconds) == words


@pytest.mark.parametrize(
    "names",
    [
        ["9", "10", "011", "100"],
        ["a", "a2", "a10", "a10b", "b1"],
        ["1700000000.25", "1700000000.5", "1700000001.1", "1700000010.0"],
        ["2", "2-left", "left", "left-2", "left-11"],
        ["7", "07x", "8"],
    ],
)
def test_names_are_sorted_as_people_number_them(names: list[str]) -> None:
    assert sorted(reversed(names), key=name_order) == names
    assert name_order("07") != name_order("7")  # two names are never the same place
