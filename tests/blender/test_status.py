"""How far a job is as a whole, how long it still takes, and how it ended."""

from __future__ import annotations

from typing import Any

import pytest

from frametwin.blender.background import status as module
from frametwin.blender.background.status import SHOWN, Status

STAGES = {"reading": (0.0, 0.2), "moving": (0.2, 1.0), "bending": (0.2, 1.0)}


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, to be set."""
    now = [100.0]
    monkeypatch.setattr(module, "perf_counter", lambda: now[0])
    return now


def begun(part: tuple[int, int] = (0, 1), before: Status | None = None) -> Status:
    made = Status.of("Fit", "starting", STAGES, part, before or Status())
    made._began = module.perf_counter() if part[0] == 0 else made._began
    return made


def step(stage: str, iteration: int, total: int) -> dict[str, Any]:
    return {"stage": stage, "iteration": iteration, "total": total, "loss": None}


def test_progress_is_that_of_the_whole_job_and_never_goes_back(clock: list[float]) -> None:
    status = begun()
    seen = [status.overall]
    for stage, iteration, total in (
        ("reading", 4, 8),
        ("reading", 8, 8),
        ("moving", 5, 50),
        ("unknown", 1, 2),
        ("moving", 25, 50),
        ("reading", 1, 8),
        ("bending", 50, 50),
    ):
        status.step(step(stage, iteration, total))
        seen.append(status.overall / (1.0 - SHOWN))
    assert seen == pytest.approx([0.0, 0.1, 0.2, 0.28, 0.28, 0.6, 0.6, 1.0])
    status.result("showing")
    assert status.overall == pytest.approx(1.0 - SHOWN) and status.share == 0.0


def test_the_time_left_is_that_of_the_whole_job_in_minutes(clock: list[float]) -> None:
    status = begun()
    assert status.seconds_left is None and status.overall_line == "Fit: starting"
    clock[0] += 30.0
    status.step(step("reading", 2, 8))
    share = 0.05 * (1.0 - SHOWN)
    assert status.seconds_left == pytest.approx(30.0 * (1.0 - share) / share)
    assert status.overall_line == "Fit: reading, 5 %, 9 min 42 s left"
    assert status.line == "reading, 2/8, 9 min 42 s left"


def test_jobs_that_follow_each_other_are_one(clock: list[float]) -> None:
    first = begun((0, 2))
    clock[0] += 10.0
    first.result("showing")
    assert first.overall == pytest.approx(0.5 * (1.0 - SHOWN))
    second = begun((1, 2), first)
    assert second.overall == 0.5 and second.seconds_left == pytest.approx(10.0)


def test_a_job_that_names_no_stages_has_but_one(clock: list[float]) -> None:
    status = Status.of("Render", "starting", {}, (0, 1), Status())
    status.step(step("rendering", 2, 8))
    assert status.overall == pytest.approx(0.25 * (1.0 - SHOWN))
