"""Settings are checked wherever they come from: every class of the library, every field, by one table of ranges."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
import pkgutil
import types
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pytest
from cli_tools import refused
from small_frames import tower
from worker_cases import worker_python

import frametwin
from frametwin.checked_json import convert_fields
from frametwin.errors import InputError
from frametwin.fitting.fast_settings import CoarseStage, FastSettings, Stage
from frametwin.fitting.settings import FitSettings
from frametwin.mechanics.hardening import Hardening
from frametwin.printing.job.guards import GuardLimits
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.job_files import JobSettings
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.toolpath.robot_files import RobotSettings
from frametwin.printing.toolpath.workspace import Workspace
from frametwin.ranges import (
    Choice,
    Range,
    Rule,
    hints_of,
)
from frametwin.worker.client import WorkerClient

NAMES = ("Settings", "Options", "Limits")
CHECKED_ELSEWHERE = ("frametwin.cli",)
"""Command lines: click checks their words, and what is made of them is checked as everywhere."""


def library() -> Iterator[types.ModuleType]:
    """Every module that can be imported without Blender."""
    for found in pkgutil.walk_packages(frametwin.__path__, "frametwin.", onerror=lambda name: None):
        if found.name.endswith("__main__"):
            continue
        try:
            yield importlib.import_module(found.name)
        except ModuleNotFoundError as error:
            if error.name != "bpy":
                raise


def is_settings(item: Any, module: types.ModuleType) -> bool:
    """A dataclass of this module that is called settings, or that declares a range."""
    if not (isinstance(item, type) and dataclasses.is_dataclass(item) and item.__module__ == module.__name__):
        return False
    if module.__name__.startswith(CHECKED_ELSEWHERE):
        return False
    if item.__name__.endswith(NAMES):
        return True
    try:
        return any(map(declares_a_range, hints_of(item).values()))
    except NameError:  # hints for the type checker alone
        return False


def declares_a_range(hint: Any) -> bool:
    """Whether there is one in a hint, at any depth."""
    return isinstance(hint, Range | Choice) or any(map(declares_a_range, get_args(hint)))


CLASSES = [item for module in library() for item in vars(module).values() if is_settings(item, module)]

NOZZLE = {
    "tip_radius": 1.0, "cone_length": 10.0, "cone_radius": 8.0, "body_radius": 15.0, "body_length": 100.0, "bead": 2.0,
}  # fmt: skip
NEEDED: dict[str, dict[str, Any]] = {
    "CoarseStage": {"detail": 0.9, "blur": 1.0, "iterations": 3, "pieces": 4},
    "Stage": {"detail": 0.9, "blur": 1.0, "iterations": 3, "pieces": 4, "pull": 0.1, "drag": 0.1},
    "ExportSettings": {"format": "npz"},
    "JobSettings": {"robot": RobotSettings(Workspace(np.zeros(3), np.ones(3)))},
    "Nozzle": NOZZLE,
    "RobotSettings": {"workspace": Workspace(np.zeros(3), np.ones(3))},
    "Workspace": {"lower": np.zeros(3), "upper": np.ones(3)},
}
"""What the classes that have no defaults want."""

KINDS_OF_NUMBERS = (int, float)


def alternatives(hint: Any) -> list[Any]:
    """What a hint allows, without ``None``."""
    parts = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    return [part for part in parts if part is not types.NoneType]


def opened(hint: Any) -> tuple[Any, list[Any]]:
    """A hint without what is declared around it, and that."""
    (hint,) = alternatives(hint)
    base, *rules = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    return base, rules


def range_of(rules: list[Any]) -> Range:
    found = [rule for rule in rules if isinstance(rule, Range)]
    assert len(found) == 1, "a number needs a range"
    return found[0]


def bad_values(hint: Any) -> Iterator[Any]:
    """Values of another kind, and out of the range that is declared."""
    base, rules = opened(hint)
    kind = get_origin(base) or base
    yield object()
    if types.NoneType not in get_args(hint):
        yield None
    if kind in KINDS_OF_NUMBERS:
        allowed = range_of(rules)
        yield from (True, "1", [1], math.nan, math.inf, -math.inf)
        yield 2.5 if kind is int else 10**400
        for limit, excluded, beyond in (
            (allowed.low, allowed.low_excluded, -1),
            (allowed.high, allowed.high_excluded, 1),
        ):
            if math.isfinite(limit):
                yield limit if excluded else limit + beyond * (1 if kind is int else max(1e-9, 1e-9 * abs(limit)))
        return
    if kind is bool:
        yield from (1, 0.0, "true")
    elif kind is str:
        yield 3
        if any(isinstance(rule, Choice) for rule in rules):
            yield "no such name"
    elif kind is tuple:
        yield from (3, "text")
        parts = get_args(base)
        if parts[-1] is Ellipsis and any(isinstance(rule, Rule) for rule in rules):
            yield ()
        if parts[-1] is not Ellipsis:
            yield tuple(range(1, len(parts) + 2))
        length = 1 if parts[-1] is Ellipsis else len(parts)
        for bad in list(bad_values(parts[0])):
            yield (bad,) * length
    else:
        yield from (3, "text")


CASES = [(cls, name) for cls in CLASSES for name in hints_of(cls)]
ARRAYS = [(Workspace, "lower"), (Workspace, "upper"), (Workspace, "base")]
"""Told by `frametwin.arrays.checked_array`."""


def test_all_settings_of_the_library_are_here() -> None:
    names = {cls.__name__ for cls in CLASSES}
    assert len(CLASSES) >= 25
    assert names >= {"FastSettings", "FitSettings", "SagSettings", "GuardLimits", "PlanOptions", "PhotoLook", "Nozzle"}
    assert set(NEEDED) <= names


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: f"{cls.__module__}.{cls.__name__}")
def test_defaults_are_in_their_ranges(cls: type) -> None:
    settings = cls(**NEEDED.get(cls.__name__, {}))
    again = dataclasses.replace(settings)
    assert [str(getattr(again, name)) for name in hints_of(cls)] == [
        str(getattr(settings, name)) for name in hints_of(cls)
    ]


@pytest.mark.parametrize(
    ("cls", "name"), [case for case in CASES if case not in ARRAYS], ids=lambda item: getattr(item, "__name__", item)
)
def test_what_does_not_fit_is_refused_by_name(cls: type, name: str) -> None:
    needed = NEEDED.get(cls.__name__, {})
    for value in bad_values(hints_of(cls)[name]):
        with pytest.raises(InputError) as caught:
            cls(**{**needed, name: value})
        error = caught.value
        assert error.field.partition("[")[0] == name, (value, str(error))
        assert error.problem.startswith("is ") and error.remedy.startswith("give "), str(error)
        assert len(error.problem) < 100


@pytest.mark.parametrize("name", ["lower", "upper", "base"])
def test_arrays_of_a_workspace_are_finite(name: str) -> None:
    good = {"lower": np.zeros(3), "upper": np.ones(3), "base": np.eye(4)}
    for bad in (np.full(good[name].shape, np.nan), "text", 3):
        with pytest.raises(InputError) as caught:
            Workspace(**{**good, name: bad})
        assert caught.value.source == "workspace" and caught.value.field.partition("[")[0] == name


def test_numbers_of_numpy_and_lists_become_those_of_python() -> None:
    settings = FitSettings(
        iterations=np.int64(3), spread=np.float32(0.5), learn_opacity=np.bool_(False), lattice_cells=np.array([1, 2])
    )
    assert settings == FitSettings(iterations=3, spread=0.5, learn_opacity=False, lattice_cells=(1, 2))
    kinds = [type(getattr(settings, name)) for name in ("iterations", "spread", "learn_opacity", "lattice_cells")]
    assert kinds == [int, float, bool, tuple]
    assert type(Hardening(longest_span=3).longest_span) is float


# --- From where they come


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"refine": ()}, "refine"),
        ({"finish": ()}, "finish"),
        ({"refine": (3,)}, "refine[0]"),
        ({"coarse": FastSettings().refine}, "coarse[0]"),
    ],
)
def test_a_fast_fit_needs_its_stages(changes: Mapping[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        FastSettings(**changes)
    assert (caught.value.source, caught.value.field) == ("settings", field)


@pytest.mark.parametrize("stage", [FastSettings().coarse[0], FastSettings().finish[0]])
def test_stages_take_a_step_at_least(stage: CoarseStage | Stage) -> None:
    with pytest.raises(InputError, match="stage: iterations: is 0; give a whole number from 1 to 10000"):
        dataclasses.replace(stage, iterations=0)


def test_guards_cannot_be_switched_off_in_silence() -> None:
    for wrong in ({"mismatch": 1e9}, {"displacement": math.inf}, {"confidence": 0.0}, {"changed_pixels": 10**9}):
        with pytest.raises(InputError) as caught:
            PlanOptions(limits=GuardLimits(**wrong))
        assert caught.value.source == "limits" and caught.value.field in wrong


def test_json_is_checked_as_deep_as_it_is() -> None:
    given = {"limits": {"mismatch": 1e9}}
    with pytest.raises(InputError, match=r"^settings: limits\.mismatch: is 1000000000\.0; give a share "):
        PlanOptions(**convert_fields(PlanOptions, given, "settings"))
    given = {"limits": {"mismatches": 0.1}}
    with pytest.raises(InputError, match=r"^settings: limits\.mismatches: is not a setting; use one of mismatch, "):
        PlanOptions(**convert_fields(PlanOptions, given, "settings"))
    stage = {"detail": 1.0, "blur": 1.0, "iterations": 0, "pieces": 4, "pull": 0.1, "drag": 0.1}
    with pytest.raises(InputError, match=r"^changes: refine\.iterations: is 0"):
        convert_fields(FastSettings, {"refine": [stage]}, "changes")


def test_the_command_line_is_checked(tmp_path: Path) -> None:
    sentence = refused("fit", tmp_path / "none", "--out", tmp_path / "run", "--set", "absent=NaN")
    assert "absent" in sentence and "a share from 0 to 1" in sentence


def test_the_worker_checks() -> None:
    with WorkerClient(worker_python()) as worker:
        for name, settings, field in (
            ("print-plan", {"limits": {"mismatch": 1e9}}, "limits.mismatch"),
            ("print-plan", {"nozzle": {"tip_radius": "thin"}}, "nozzle.tip_radius"),
            ("print-plan", {"waypoints": {"speed": 0}}, "waypoints.speed"),
            ("print-simulate", {"seed": -1}, "seed"),
            ("print-simulate", {"plan": {"formats": []}}, "plan.formats"),
            ("simulate", {"size": [7, 100]}, "size"),
        ):
            with pytest.raises(InputError) as caught:
                worker.call(name, {"frame": "bridge", "out": "never", "settings": settings})
            assert (caught.value.source, caught.value.field) == ("settings", field)


@pytest.mark.parametrize(
    ("place", "value", "field"),
    [
        (("limits", "mismatch"), 1e9, "settings.limits.mismatch"),
        (("robot", "waypoints", "speed"), -1.0, "robot.waypoints.speed"),
        (("robot", "workspace", "max_speed"), 0.0, "robot.workspace.max_speed"),
        (("robot", "formats"), ["dwg"], "robot.formats[0]"),
        (("adapt",), False, "settings.reprint"),
    ],
)
def test_a_job_file_is_checked_and_named(tmp_path: Path, place: tuple[str, ...], value: Any, field: str) -> None:
    plan_job(
        tmp_path / "job",
        tower(),
        PlanOptions(batch_size=24, allow_contact=True, formats=("json",), compensate=False, reprint=True),
    )
    path = tmp_path / "job" / "job.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    inside = data["settings"]
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    inside.pop("anticipate", None)
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        PrintJob(tmp_path / "job")
    assert (caught.value.source, caught.value.field) == (str(path), field)


def test_settings_of_a_job_come_back_as_they_were() -> None:
    options = PlanOptions(base=np.eye(4), workspace=[0, 0, 0, 300, 300, 300], max_speed=100)
    settings = options.job(tower(), options.order(tower()).nozzle)
    text = json.dumps(settings.as_dict(), default=lambda array: array.tolist())
    again = JobSettings.from_dict(json.loads(text), "job.json")
    assert again.robot.as_dict()["workspace"]["base"].tolist() == np.eye(4).tolist()
    assert (again.limits, again.robot.waypoints, again.robot.formats) == (
        settings.limits,
        dataclasses.replace(settings.robot.waypoints, nozzle=again.robot.waypoints.nozzle),
        settings.robot.formats,
    )
    assert again.robot.waypoints.nozzle == settings.robot.waypoints.nozzle
