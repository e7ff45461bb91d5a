"""The worker's table of jobs, and parameters out of JSON: what fits, and what is refused in words."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from frametwin.checked_json import convert, convert_fields
from frametwin.errors import InputError
from frametwin.fitting.fast_settings import FastSettings
from frametwin.simulation.simulate import SimulationSettings
from frametwin.worker import job_table as jobs
from frametwin.worker.job_table import JOBS, checked_arguments, run_job


def test_every_job_of_the_table_is_there_with_usable_parameters() -> None:
    for name in JOBS:
        with pytest.raises(InputError, match=rf"request {name}: no such: is not a parameter"):
            run_job(name, {"no such": 1})


def test_a_job_gets_its_progress_from_the_worker_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(jobs.JOBS, "told", f"{__name__}:told")
    told_of: list[Any] = []
    assert run_job("told", {"name": "x"}, told_of.append) == {"name": "x", "progress": True}
    assert told_of == ["x"]
    with pytest.raises(InputError, match="progress: is not a parameter"):
        run_job("told", {"name": "x", "progress": 3})
    with pytest.raises(InputError, match="request told: name: is missing; add it"):
        checked_arguments(told, {}, "request told")


def told(name: str, progress: Any = None) -> dict[str, Any]:
    progress(name)
    return {"name": name, "progress": progress is not None}


@dataclasses.dataclass
class Size:
    height: int
    unit: str = "mm"


@pytest.mark.parametrize(
    ("value", "hint", "wanted"),
    [
        (3, int, 3),
        (3, float, 3.0),
        (2.5, float, 2.5),
        (None, int | None, None),
        ("x", str | dict[str, Any], "x"),
        ({"a": 1}, str | dict[str, Any], {"a": 1}),
        ("a/b", Path, Path("a/b")),
        ([1, 2], tuple[int, int], (1, 2)),
        ([1, 2.5], list[float], [1.0, 2.5]),
        ([], list[int], []),
        ([[1, "x"]], list[Any], [[1, "x"]]),
        ({"height": 3}, Size, Size(3)),
        (True, bool, True),
        (object, Any, object),
    ],
)
def test_kinds_that_fit(value: Any, hint: Any, wanted: Any) -> None:
    found = convert(value, hint, "request", "x")
    assert found == wanted and type(found) is type(wanted)


@pytest.mark.parametrize(
    ("value", "hint", "words"),
    [
        (True, int, "is True; give a whole number"),
        (3.0, int, "is 3.0; give a whole number"),
        (True, float, "is True; give a number"),
        (float("nan"), float, "is nan; give a number"),
        (float("inf"), float, "is inf; give a number"),
        (10**400, float, "give a number"),
        (1, bool, "is 1; give true or false"),
        (None, str, "is None; give a text"),
        ("", Path, "is ''; give a path"),
        ("a\0b", Path, "give a path"),
        ([1, 2, 3], tuple[int, int], "is of another kind; give a list of whole numbers"),
        ([1, "2"], list[int], "is of another kind; give a list of whole numbers"),
        ("12", list[int] | None, "is '12'; give a list of whole numbers or null"),
        ([], dict[str, Any], "is of another kind; give an object"),
        ("x" * 500, int, "xxx...; give"),
        ({"depth": 3}, Size, "depth: is not a setting; use one of height, unit"),
        ({"height": "3"}, Size, "height: is '3'; give a whole number"),
        ({"unit": "cm"}, Size, "x.height: is missing; add it"),
    ],
)
def test_kinds_that_do_not_fit(value: Any, hint: Any, words: str) -> None:
    with pytest.raises(InputError) as caught:
        convert(value, hint, "request", "x")
    assert words in str(caught.value) and len(str(caught.value)) < 200


def test_settings_of_the_library_can_be_given_as_json() -> None:
    given = {"views": 4, "size": [10, 12], "peak": 3, "printed": None, "rig": "dome"}
    found = SimulationSettings(**convert_fields(SimulationSettings, given, "settings"))
    assert found == SimulationSettings(views=4, size=(10, 12), peak=3.0, rig="dome")
    whole = json.loads(json.dumps(dataclasses.asdict(FastSettings(absent=0.25))))
    assert FastSettings(**convert_fields(FastSettings, whole, "changes")) == FastSettings(absent=0.25)
    with pytest.raises(InputError, match="seed: is not a setting"):
        convert_fields(FastSettings, {"seed": 1}, "changes", without=("preset", "seed"))
