"""Values of JSON and type hints of any kind: what fits arrives unchanged, all else is refused in one sentence."""

from __future__ import annotations

import dataclasses
import json
import types
from pathlib import Path
from typing import Any, Union, get_args, get_origin

from hypothesis import example, given, settings
from hypothesis import strategies as st
from strategies import json_scalars, json_values, numbers

from frametwin.checked_json import convert, convert_fields, described
from frametwin.errors import InputError
from frametwin.fitting.fast_settings import FastSettings
from frametwin.simulation.simulate import SimulationSettings

LEAVES: dict[Any, st.SearchStrategy[Any]] = {
    str: st.text(max_size=5),
    bool: st.booleans(),
    int: st.integers(-(10**12), 10**12),
    float: numbers(),
    type(None): st.none(),
    dict[str, Any]: st.dictionaries(st.text(max_size=3), st.integers(), max_size=3),
}


@st.composite
def hints(draw: st.DrawFn, depth: int = 2) -> Any:
    """Type hints of settings: plain kinds, lists and tuples of hints, and unions of two plain ones."""
    plain = st.sampled_from(list(LEAVES))
    kind = draw(st.sampled_from(["plain", "plain", "list", "pair", "row", "union"])) if depth else "plain"
    if kind == "plain":
        return draw(plain)
    if kind == "union":
        one, other = draw(st.lists(plain, min_size=2, max_size=2, unique=True))
        return one | other
    inner = draw(hints(depth - 1))
    return {"list": list[inner], "row": tuple[inner, ...], "pair": tuple[inner, draw(hints(depth - 1))]}[kind]


def values_of(hint: Any) -> st.SearchStrategy[Any]:
    """Values that fit a hint."""
    if hint in LEAVES:
        return LEAVES[hint]
    parts = get_args(hint)
    if get_origin(hint) in (Union, types.UnionType):
        return st.one_of(*map(values_of, parts))
    if get_origin(hint) is list:
        return st.lists(values_of(parts[0]), max_size=3)
    if parts[-1] is Ellipsis:
        return st.lists(values_of(parts[0]), max_size=3).map(tuple)
    return st.tuples(*map(values_of, parts))


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of the kind that a hint says, to the last item."""
    kind, parts = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, types.UnionType):
        return any(fits(value, part) for part in parts)
    if type(value) is not kind:
        return False
    if kind is list or (kind is tuple and parts[-1] is Ellipsis):
        return all(fits(item, parts[0]) for item in value)
    if kind is tuple:
        return len(value) == len(parts) and all(map(fits, value, parts))
    return True


@given(st.data())
def test_what_fits_a_hint_comes_through_json_unchanged(data: st.DataObject) -> None:
    hint = data.draw(hints())
    value = data.draw(values_of(hint))
    found = convert(json.loads(json.dumps(value)), hint, "request", "x")
    assert found == value and fits(found, hint)


def exact(value: Any) -> Any:
    """A value to compare: Python takes 1 for ``True``, and JSON knows no tuples."""
    if isinstance(value, list | tuple):
        return [exact(item) for item in value]
    if isinstance(value, dict):
        return {key: exact(item) for key, item in value.items()}
    return ("boolean", value) if isinstance(value, bool) else value


@settings(max_examples=200)
@example(float, True)
@example(int, True)
@given(hints(), json_scalars() | json_values())
def test_any_value_becomes_of_the_hinted_kind_or_is_refused_in_one_sentence(hint: Any, value: Any) -> None:
    try:
        found = convert(value, hint, "request", "x")
    except InputError as error:
        assert str(error).startswith("request: x: is ") and len(str(error).splitlines()) == 1
        assert described(hint) in str(error)
    else:
        assert fits(found, hint)
        assert exact(found) == exact(value)


@dataclasses.dataclass(frozen=True)
class Stage:
    steps: int
    size: tuple[int, int] = (3, 4)
    blur: float | None = None
    folder: Path = Path("a")


@dataclasses.dataclass(frozen=True)
class Plan:
    name: str
    stages: tuple[Stage, ...] = ()


def stages() -> st.SearchStrategy[Stage]:
    size = st.tuples(st.integers(1, 9), st.integers(1, 9))
    folders = st.text("ab/._ -", min_size=1, max_size=6).map(Path)
    return st.builds(Stage, st.integers(), size, st.none() | numbers(), folders)


@given(st.builds(Plan, st.text(max_size=5), st.lists(stages(), max_size=3).map(tuple)))
def test_settings_within_settings_come_through_json_unchanged(plan: Plan) -> None:
    assert convert(json.loads(json.dumps(dataclasses.asdict(plan), default=str)), Plan, "request", "plan") == plan


@given(st.sampled_from([FastSettings, SimulationSettings]), st.dictionaries(st.text("abcdes_"), json_values()))
def test_names_of_no_setting_are_refused_by_name(cls: type, values: dict[str, Any]) -> None:
    known = {item.name for item in dataclasses.fields(cls)}
    try:
        found = convert_fields(cls, values, "request")
    except InputError as error:
        assert any(str(error).startswith(f"request: {name}: ") for name in values)
    else:
        assert set(found) == set(values) <= known


@given(st.data(), st.sampled_from([FastSettings(), SimulationSettings()]), json_values())
def test_any_value_of_a_setting_is_taken_or_refused_by_its_name(
    data: st.DataObject, settings: FastSettings | SimulationSettings, value: Any
) -> None:
    name = data.draw(st.sampled_from([item.name for item in dataclasses.fields(settings)]))
    try:
        found = convert_fields(type(settings), {name: value}, "request")
    except InputError as error:
        assert str(error).startswith("request: ") and len(str(error).splitlines()) == 1
        assert isinstance(value, list) or str(error).startswith(f"request: {name}: ")  # or what is within an item
    else:
        assert set(found) == {name} and json.loads(json.dumps(found[name], default=dataclasses.asdict)) == value
