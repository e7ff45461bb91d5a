"""Ranges of settings: what belongs to them, what is said of what does not, and where."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import pytest

from frametwin.errors import InputError
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.ranges import (
    above,
    at_least,
    between,
    check_settings,
    check_values,
    in_words,
    one_of,
    rising,
    sized,
    some,
    wanted_by,
    within,
)


@pytest.mark.parametrize(
    ("hint", "words"),
    [
        (Annotated[float, within(0.0, 1.0)], "a number from 0 to 1"),
        (Annotated[int, within(1, 1_000_000)], "a whole number from 1 to 1000000"),
        (Annotated[float, above(0.0)], "a number above 0"),
        (Annotated[float, above(0.0, up_to=1.0, noun="a share")], "a share above 0 and up to 1"),
        (Annotated[float, at_least(0.0, below=90.0, noun="degrees")], "degrees from 0 up, below 90"),
        (Annotated[int, at_least(0)], "a whole number from 0 up"),
        (Annotated[float, between(-1.0, 0.5)], "a number between -1 and 0.5"),
        (Annotated[str, one_of(("a", "b"))], "one of a, b"),
        (Annotated[float, above(0.0)] | None, "a number above 0"),
        (Annotated[float, above(0.0), in_words("millimetres")], "millimetres"),
        (tuple[Annotated[int, within(1, 2)], ...], "a list of whole numbers"),
        (Annotated[tuple[int, ...], some("one or more")], "one or more"),
        (bool, "true or false"),
        (Nozzle, "a Nozzle"),
    ],
)
def test_what_is_wanted_in_words(hint: Any, words: str) -> None:
    assert wanted_by(hint) == words


@pytest.mark.parametrize(
    ("make", "inside", "at", "outside"),
    [
        (lambda: within(0.0, 1.0), (0.5,), (0.0, 1.0), (-1e-9, 1.0 + 1e-9)),
        (lambda: between(0.0, 1.0), (1e-9, 1.0 - 1e-9), (), (0.0, 1.0)),
        (lambda: above(0.0, up_to=2.0), (1e-9,), (2.0,), (0.0, 2.1)),
        (lambda: at_least(0.0, below=2.0), (1.9,), (0.0,), (2.0, -1e-9)),
        (lambda: above(0.0), (1e300,), (), (0.0, -1.0)),
        (lambda: at_least(3), (10**30,), (3,), (2,)),
    ],
)
def test_limits_belong_to_a_range_as_it_says(make: Any, inside: Any, at: Any, outside: Any) -> None:
    allowed = make()
    assert all(allowed.holds(value) for value in (*inside, *at))
    assert not any(allowed.holds(value) for value in outside)


def test_rules_for_lists() -> None:
    assert some("x").holds((1,)) and not some("x").holds(())
    assert rising.holds((1, 1, 2)) and not rising.holds((1, 3, 2))
    assert sized(2).holds((1, 2)) and not sized(2).holds((1, 2, 3))


@dataclasses.dataclass(frozen=True)
class Look:
    sides: Annotated[tuple[Annotated[int, at_least(3)], ...], some("one or more")] = (4,)

    def __post_init__(self) -> None:
        check_settings(self, "look")


def test_the_source_and_the_place_are_told() -> None:
    with pytest.raises(InputError, match=r"^look: sides\[1\]: is 2; give a whole number from 3 up\.$"):
        Look((3, 2))
    with pytest.raises(InputError, match=r"^file: a\.sides: is \(\); give one or more\.$"):
        check_values(Look, {"sides": ()}, "file", "a.")
    assert check_values(Look, {"sides": [5]}) == {"sides": (5,)}
    with pytest.raises(InputError, match=r"^settings: side: is not a setting; use one of sides\.$"):
        check_values(Look, {"side": 3})
