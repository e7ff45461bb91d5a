"""Workers for tests: with jobs that misbehave, and programs that only pretend to be one."""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from frametwin.errors import InputError
from frametwin.worker.client import WorkerClient, find_python

EXTRA_JOBS = Path(__file__).resolve().parent / "extra_worker_jobs"
PATIENCE = 60.0


def worker_python() -> str:
    """The Python that has the libraries; tests that need it are left out where there is none."""
    try:
        return find_python()
    except InputError as error:
        pytest.skip(str(error))


def extra_client(**environment: str) -> WorkerClient:
    """A client of a worker that knows the jobs of `EXTRA_JOBS` too."""
    return WorkerClient(worker_python(), package_root=EXTRA_JOBS, environment=environment)


def until(condition: Callable[[], Any], what: str = "that") -> Any:
    """Wait for something to be true, and give it."""
    deadline = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s for {what}"
        time.sleep(0.01)
    return found


def is_gone(pid: int) -> bool:
    """Whether a process has ended; one that only waits for its parent to notice has."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except FileNotFoundError:
        return Path("/proc/self").exists()


def script(path: Path, text: str) -> str:
    """A program that runs ``text`` with the shell."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def events_until_done(client: WorkerClient, *keys: str) -> list[dict[str, Any]]:
    """Pump until every request has its result or error."""
    events: list[dict[str, Any]] = []

    def done() -> bool:
        events.extend(client.poll(5))
        ended = [event["id"] for event in events if event["event"] in ("result", "error")]
        return set(keys) <= set(ended)

    until(done, f"the answers to {keys}")
    return events
