"""The runner with workers that behave and that do not, without the add-on."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worker_cases import EXTRA_JOBS, is_gone, until, worker_python

from frametwin.blender.background.runner import GRACE, Job, Runner
from frametwin.blender.background.stepwise import TURN
from frametwin.errors import FrameTwinError, InputError
from frametwin.worker.client import WorkerClient


@pytest.fixture
def runner() -> Iterator[Runner]:
    made = Runner()
    yield made
    made.close()


def job(request: str, parameters: dict[str, Any] | None = None, **more: Any) -> Job:
    def finish(value: Any) -> Any:
        yield
        return f"got {value}"

    options = {
        "worker": lambda: WorkerClient(worker_python(), package_root=EXTRA_JOBS),
        "kind": "extra",
        "finish": finish,
    }
    return Job(title="Job", request=request, parameters=parameters or {}, **{**options, **more})


def run(runner: Runner) -> str:
    until(lambda: not runner.pump(), "the end of the job")
    return runner.status.message


def test_a_result_is_loaded_and_finished(runner: Runner) -> None:
    shown: list[float] = []
    cleared: list[int] = []
    runner.start(
        job(
            "count",
            {"steps": 30, "pause": 0.02},
            on_curves=lambda curves: shown.append(float(np.max(curves))),
            load=lambda result: result["steps"] + 1,
            clear=lambda: cleared.append(1),
        )
    )
    assert runner.busy and run(runner) == "got 31" and not runner.status.error
    assert shown == sorted(shown) and len(set(shown)) > 2 and cleared == [1]


def test_a_print_job_that_holds_is_told_as_it_was(runner: Runner) -> None:
    runner.start(job("hold"))
    assert run(runner) == "captures/3: collapsed: it lies on the plate; look at it." and runner.status.error


def test_one_at_a_time_in_one_process(runner: Runner) -> None:
    runner.start(job("count"))
    with pytest.raises(FrameTwinError, match="still under way"):
        runner.start(job("count"))
    run(runner)
    (pid,) = runner.pids
    runner.start(job("count"))
    run(runner)
    assert runner.pids == [pid]
    runner.start(job("count", kind="another"))
    run(runner)
    until(lambda: is_gone(pid), "the end of the worker of another kind")


@pytest.mark.parametrize("how", ["kill", "leave", "known", "unknown", "exit"])
def test_failures_are_told_and_the_next_job_works(runner: Runner, how: str) -> None:
    runner.start(job("crash", {"how": how}))
    words = run(runner)
    assert runner.status.error and words and "Traceback" not in words
    runner.start(job("count"))
    assert run(runner) == "got {'steps': 3}" and not runner.status.error


def test_cancelling_a_job_that_listens_keeps_its_process(runner: Runner) -> None:
    runner.start(job("count", {"steps": 10**6, "pause": 0.01}))
    until(lambda: runner.pump() and runner.status.total, "the first step")
    runner.cancel()
    assert run(runner) == "Cancelled" and not runner.status.error and len(runner.pids) == 1


def test_cancelling_a_job_that_does_not_listen_kills_it(runner: Runner, tmp_path: Path) -> None:
    out = tmp_path / "made" / "run"
    runner.start(job("stubborn", out=out))
    until(lambda: runner.pump() and runner._key is not None, "the request")
    (pid,) = runner.pids
    time.sleep(0.5)  # cancelled before it begins, it would be no trouble
    (out.parent / ".run.0123.part").mkdir(parents=True)  # as it would leave it
    runner.cancel()
    assert run(runner) == "Cancelled" and not runner.pids
    until(lambda: is_gone(pid) and not out.parent.exists(), "the end of the process, and of what it left")


def late(runner: Runner, out: Path, moment: str, release: threading.Event) -> None:
    """Have a folder written, up to some moment after it is."""

    def load(result: Any) -> None:
        if moment == "reading the result":
            release.wait(60.0)

    def finish(value: Any) -> Any:
        while True:
            yield

    runner.start(job("write", {"out": out, "steps": 0}, out=out, load=load, finish=finish))
    if moment == "unheard":
        until(lambda: (out / "half").exists(), "the folder")
    else:
        until(lambda: runner.pump(0.0) and runner.status.stage == moment, moment)
        assert (out / "half").exists()


@pytest.mark.parametrize("moment", ["unheard", "reading the result", "showing the result"])
def test_nothing_is_left_of_a_job_that_is_cancelled_when_it_is_done(
    runner: Runner, tmp_path: Path, moment: str
) -> None:
    out, release = tmp_path / "made" / "run", threading.Event()
    late(runner, out, moment, release)
    runner.cancel()
    if moment == "unheard":
        time.sleep(2.0 * GRACE)  # Blender was busy elsewhere, and the time to stop is over
    assert run(runner) == "Cancelled" and not runner.status.error
    release.set()
    until(lambda: not out.parent.exists(), "the end of the folder")
    runner.start(job("count"))
    assert run(runner) == "got {'steps': 3}"


def test_nothing_is_left_of_a_job_that_is_done_when_all_is_closed(runner: Runner, tmp_path: Path) -> None:
    release = threading.Event()
    late(runner, tmp_path / "run", "reading the result", release)
    release.set()
    runner.close()
    assert not list(tmp_path.iterdir())


def test_folders_of_others_stay(runner: Runner, tmp_path: Path) -> None:
    before = tmp_path / "before"
    before.mkdir()
    late(runner, before, "showing the result", threading.Event())
    runner.cancel()
    meanwhile = tmp_path / "meanwhile"
    runner.start(job("write", {"out": meanwhile}, out=meanwhile))
    until(lambda: runner.pump() and runner.status.total, "the first step")
    meanwhile.mkdir()
    (meanwhile / "of another").write_text("1")
    runner.cancel()
    assert run(runner) == "Cancelled"
    until(lambda: sorted(path.name for path in tmp_path.iterdir()) == ["before", "meanwhile"], "the end of the rest")
    time.sleep(0.2)  # in which a thread would remove what it may not
    assert (before / "half").exists() and (meanwhile / "of another").exists()


def test_blender_has_its_turn_between_two_steps(runner: Runner) -> None:
    log: list[str] = []

    def finish(value: Any) -> Any:
        for step in ("first", "second", "third"):
            log.append(step)
            yield TURN if step == "second" else None
        return "done"

    runner.start(job("count", finish=finish))
    until(lambda: runner.pump(3600.0) and log, "the first steps")
    assert log == ["first", "second"]
    assert not runner.pump(3600.0) and log == ["first", "second", "third"]


def test_a_job_that_ends_well_keeps_its_folder(runner: Runner, tmp_path: Path) -> None:
    out = tmp_path / "run"
    runner.start(job("write", {"out": out, "steps": 0}, out=out))
    assert run(runner) == "got {}"
    runner.close()
    assert (out / "half").exists()


@pytest.mark.parametrize("moment", ["at once", "later"])
def test_closing_in_the_middle_leaves_no_process(runner: Runner, moment: str) -> None:
    clients: list[WorkerClient] = []

    def worker() -> WorkerClient:
        clients.append(WorkerClient(worker_python(), package_root=EXTRA_JOBS))
        return clients[0]

    runner.start(job("stubborn", worker=worker))
    if moment == "later":
        until(lambda: runner.pump() and runner._key is not None, "the request")
    runner.close()
    assert not runner.busy
    time.sleep(0.3)  # the thread that starts a worker may still be at it
    until(lambda: clients[0].pid is None or is_gone(clients[0].pid), "the end of the process")


def test_what_fails_in_the_main_thread_is_told_too(runner: Runner) -> None:
    def finish(value: Any) -> Any:
        yield
        raise InputError("the scene is full")

    runner.start(job("count", finish=finish))
    assert run(runner) == "the scene is full" and runner.status.error

    def stumble(result: dict[str, Any]) -> Any:
        raise ZeroDivisionError("a bug")

    runner.start(job("count", load=stumble))
    assert "ZeroDivisionError: a bug" in run(runner) and not runner.busy


def test_finishing_is_taken_back_and_begun_anew_around_an_undo(runner: Runner) -> None:
    log: list[str] = []

    def finish(value: Any) -> Any:
        log.append("begin")
        try:
            for _ in range(3):
                yield
        except GeneratorExit:
            log.append("taken back")
            raise
        return "done"

    runner.start(job("count", finish=finish))
    until(lambda: runner.pump(0.0) and runner._steps is not None, "the result")
    next(runner._steps)  # type: ignore[arg-type]
    runner.hold()
    assert runner.pump() and log == ["begin", "taken back"]
    runner.resume()
    assert run(runner) == "done" and log == ["begin", "taken back", "begin"]
