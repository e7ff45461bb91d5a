"""Ranges of settings: declared at the fields, and checked by one function wherever a value comes from.

::

    @dataclass(frozen=True)
    class Look:
        share: Annotated[float, within(0.0, 1.0)] = 0.5
        sides: Annotated[tuple[Annotated[int, at_least(3)], ...], some("one number of sides or more")] = (4,)

        def __post_init__(self) -> None:
            check_settings(self)

A value has to be of the kind of its hint in any case: numbers are finite, ``True`` is no number, and 3.0 no whole
number. What numpy has for Python's numbers and tuples is welcome, and is replaced by them. What concerns several fields
at once stays code of the class.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from frametwin.checked_json import described, is_number, name_problem
from frametwin.errors import InputError


@dataclass(frozen=True)
class Range:
    """Numbers from ``low`` to ``high``, of which either may itself be excluded.

    ``noun`` is what to call them in remedies, such as ``"a share"``, in place of "a number".
    """

    low: float = -math.inf
    high: float = math.inf
    low_excluded: bool = False
    high_excluded: bool = False
    noun: str = ""

    def holds(self, value: float) -> bool:
        """Whether a number is in the range."""
        above = value > self.low if self.low_excluded else value >= self.low
        below = value < self.high if self.high_excluded else value <= self.high
        return above and below

    def words(self, noun: str) -> str:
        """The range in words, with the noun that is usual for such values."""
        low, high = (str(limit) if isinstance(limit, int) else f"{limit:g}" for limit in (self.low, self.high))
        noun = self.noun or noun
        if self.high == math.inf:
            return f"{noun} above {low}" if self.low_excluded else f"{noun} from {low} up"
        if self.low_excluded and self.high_excluded:
            return f"{noun} between {low} and {high}"
        if self.low_excluded:
            return f"{noun} above {low} and up to {high}"
        return f"{noun} from {low} up, below {high}" if self.high_excluded else f"{noun} from {low} to {high}"


def within(low: float, high: float, noun: str = "") -> Range:
    """Numbers from ``low`` to ``high``."""
    return Range(low, high, noun=noun)


def between(low: float, high: float, noun: str = "") -> Range:
    """Numbers between ``low`` and ``high``, which are excluded themselves."""
    return Range(low, high, True, True, noun)


def above(low: float, up_to: float = math.inf, noun: str = "") -> Range:
    """Numbers above ``low``, which is excluded, up to a greatest one."""
    return Range(low, up_to, low_excluded=True, noun=noun)


def at_least(low: float, below: float = math.inf, noun: str = "") -> Range:
    """Numbers from ``low`` up, below one that is excluded."""
    return Range(low, below, high_excluded=below != math.inf, noun=noun)


@dataclass(frozen=True)
class Choice:
    """One of several names."""

    names: tuple[str, ...]

    def holds(self, value: str) -> bool:
        """Whether a text is one of the names."""
        return value in self.names

    def words(self, noun: str) -> str:
        """The names."""
        return f"one of {', '.join(self.names)}"


def one_of(names: Iterable[str]) -> Choice:
    """One of these names."""
    return Choice(tuple(names))


@dataclass(frozen=True)
class Rule:
    """A rule for lists: what has to hold, and what is wanted in words (empty for what the hint says)."""

    holds: Callable[[Any], bool]
    wanted: str = ""

    def words(self, noun: str) -> str:
        """What is wanted."""
        return self.wanted or noun


def some(wanted: str) -> Rule:
    """A list with at least one item."""
    return Rule(lambda items: len(items) > 0, wanted)


def sized(count: int) -> Rule:
    """A list of so many items, where the hint leaves their number open."""
    return Rule(lambda items: len(items) == count)


rising = Rule(lambda items: all(low <= high for low, high in zip(items, items[1:], strict=False)))
"""A list in which no number is below the one before."""


@dataclass(frozen=True)
class InWords:
    """What is wanted of a whole field, whichever part of it is wrong: the remedy is to give that."""

    wanted: str


def in_words(wanted: str) -> InWords:
    """Say what is wanted of a field in words that suit it better than those of its kind and range."""
    return InWords(wanted)


Share = Annotated[float, within(0.0, 1.0, "a share")]
Seed = Annotated[int, at_least(0)]
Tilt = Annotated[float, at_least(0.0, below=90.0, noun="degrees")]
ViewCount = Annotated[int, within(2, 1000), in_words("a whole number from 2 to 1000, 8 are usual")]
PictureSize = Annotated[
    tuple[Annotated[int, within(8, 16384)], Annotated[int, within(8, 16384)]],
    in_words("height and width from 8 to 16384 pixels"),
]
"""Kinds of settings that several classes have."""


def check_settings(settings: Any, source: str = "settings") -> None:
    """Check every field of a frozen dataclass against its hint; for its ``__post_init__``.

    Parameters
    ----------
    settings : dataclass instance
        Its numbers and lists are replaced by Python's own kinds: 3 in a field for floats becomes 3.0, a list a tuple.
    source : str
        What to call them in messages.

    Raises
    ------
    InputError
        If a value is of another kind or out of its range; the message names the field.
    """
    cls: type = type(settings)
    for name, hint in hints_of(cls).items():
        given = getattr(settings, name)
        value = _told(given, hint, source, name)
        if value is not given:
            object.__setattr__(settings, name, value)


def check_values(
    cls: type, values: Mapping[str, Any], source: str = "settings", prefix: str = "", without: Collection[str] = ()
) -> dict[str, Any]:
    """Check values for some fields of a dataclass, of which no instance is made yet.

    Parameters
    ----------
    cls : type
        The dataclass.
    values : mapping
        By name.
    source, prefix : str
        What to call them in messages, and what to put before their names there.
    without : collection of str
        Fields that are not to be had.

    Returns
    -------
    dict
        The values as the dataclass will have them.

    Raises
    ------
    InputError
        If a name is unknown, or a value of another kind or out of its range.
    """
    hints = hints_of(cls)
    known = [name for name in hints if name not in without]
    for name in values:
        if name not in known:
            raise name_problem(source, f"{prefix}{name}", "is not a setting", known)
    return {name: _told(value, hints[name], source, f"{prefix}{name}") for name, value in values.items()}


@cache
def hints_of(cls: type) -> dict[str, Any]:
    """Hints of a dataclass's fields by name, with their ranges."""
    hints = get_type_hints(cls, include_extras=True)
    return {item.name: hints[item.name] for item in dataclasses.fields(cls)}


class _Wrong(Exception):
    """A value that does not fit: its place, itself, and what is wanted there."""

    def __init__(self, place: str, value: Any, wanted: str) -> None:
        super().__init__(place, value, wanted)
        self.place, self.value, self.wanted = place, value, wanted


def _told(value: Any, hint: Any, source: str, field: str) -> Any:
    """The value as its hint has it, or an error in words."""
    try:
        return _checked(value, hint, field)
    except _Wrong as wrong:
        shown = repr(_plain(wrong.value))
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise InputError.at(source, wrong.place, f"is {shown}", f"give {wrong.wanted}") from None


def _checked(value: Any, hint: Any, place: str) -> Any:
    kind = get_origin(hint) or hint
    if kind is Annotated:
        return _annotated(value, hint, place)
    if kind in (Union, types.UnionType):
        return _any_of(value, hint, place)
    if kind in (tuple, frozenset):
        return kind(_items(value, hint, place))
    plain = _plain(value)
    if kind is float and is_number(plain):
        return float(plain)
    if kind is not float and _is_a(plain, kind):
        return plain
    raise _Wrong(place, value, wanted_by(hint))


def _annotated(value: Any, hint: Any, place: str) -> Any:
    base, *rules = get_args(hint)
    try:
        found = _checked(value, base, place)
    except _Wrong as wrong:
        if wrong.place != place and not any(isinstance(rule, InWords) for rule in rules):
            raise
        raise _Wrong(place, value, wanted_by(hint)) from None
    if not all(isinstance(rule, InWords) or rule.holds(found) for rule in rules):
        raise _Wrong(place, value, wanted_by(hint))
    return found


def _any_of(value: Any, hint: Any, place: str) -> Any:
    parts = [part for part in get_args(hint) if part is not types.NoneType]
    if value is None and len(parts) < len(get_args(hint)):
        return None
    for part in parts:
        try:
            return _checked(value, part, place)
        except _Wrong:
            if len(parts) == 1:
                raise
    raise _Wrong(place, value, wanted_by(hint))


def _items(value: Any, hint: Any, place: str) -> list[Any]:
    kind, parts = get_origin(hint) or hint, get_args(hint) or (Any, ...)
    items = value.tolist() if hasattr(value, "tolist") else value  # an array of numpy's
    fits = isinstance(items, list | tuple) or (kind is frozenset and isinstance(items, set | frozenset))
    if fits and (kind is frozenset or parts[-1] is Ellipsis):
        parts = (parts[0],) * len(items)
    if not fits or len(parts) != len(items):
        raise _Wrong(place, value, wanted_by(hint))
    return [_checked(item, part, f"{place}[{i}]") for i, (item, part) in enumerate(zip(items, parts, strict=True))]


def _plain(value: Any) -> Any:
    """A number of numpy's as one of Python's; anything else as it is."""
    return value.item() if getattr(value, "shape", None) == () and hasattr(value, "item") else value


def _is_a(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind that is neither a number with a point nor made of others."""
    if kind is Any or not isinstance(kind, type):
        return True
    if isinstance(value, bool) and kind is int:
        return False
    return isinstance(value, Mapping if kind is dict else kind)


def wanted_by(hint: Any) -> str:
    """What a hint wants, in words that follow "give"."""
    kind = get_origin(hint) or hint
    if kind is Annotated:
        base, *rules = get_args(hint)
        words = wanted_by(base)
        for rule in rules:
            words = rule.wanted if isinstance(rule, InWords) else rule.words(words)
        return words
    if kind in (Union, types.UnionType):
        return " or ".join(wanted_by(part) for part in get_args(hint) if part is not types.NoneType)
    return f"a {kind.__name__}" if isinstance(kind, type) and dataclasses.is_dataclass(kind) else described(hint)
