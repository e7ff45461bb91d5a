"""The worker's client with real workers: runs in Blender's Python too, which has numpy alone."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from worker_cases import EXTRA_JOBS, events_until_done, extra_client, is_gone, until, worker_python

import frametwin
from frametwin.errors import FrameTwinError
from frametwin.progress import Progress
from frametwin.worker.client import WorkerClient, error_of
from frametwin.worker.interpreter import VARIABLE

posix = pytest.mark.skipif(os.name == "nt", reason="shell scripts and signals are for POSIX")


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerClient]:
    """One worker for all tests that leave it well."""
    with extra_client() as client:
        yield client


def test_progress_and_curves_arrive(worker: WorkerClient) -> None:
    steps: list[Progress] = []
    assert worker.call("count", {"steps": 60, "pause": 0.01}, steps.append, curves=True) == {"steps": 60}
    assert dataclasses.replace(steps[0], control_points=None) == Progress("counting", 0, 60)  # a loss of NaN is none
    drawn = [step for step in steps if step.control_points is not None]
    assert len(drawn) >= 2 and drawn[-1].control_points.shape == (2, 4, 3)
    assert all((step.control_points == step.iteration).all() for step in drawn)
    steps.clear()
    worker.call("count", {"steps": 10, "stage": "again"}, steps.append)
    assert steps and not any(step.control_points is not None for step in steps)


def test_requests_are_answered_one_after_the_other(worker: WorkerClient) -> None:
    assert worker.poll() == []
    keys = [worker.request("count", {"pause": 0.05, "stage": name}) for name in "ab"]
    events = events_until_done(worker, *keys)
    done = [event["id"] for event in events if event["event"] == "result"]
    assert done == keys
    stages = [event["stage"] for event in events if event["event"] == "progress"]
    assert stages == sorted(stages) and set(stages) == {"a", "b"}


@pytest.mark.parametrize("way", ["closed", "killed", "orphaned"])
def test_temporary_files_go_with_the_worker(way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    client = extra_client()
    client.start()
    assert client.pid is not None and len(list(tmp_path.iterdir())) == 1
    if way == "killed":
        os.kill(client.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
        until(lambda: not client.alive, "the end of the worker")
    elif way == "orphaned":
        client._child.process.stdin.close()  # as the system does when the parent dies
        until(lambda: list(tmp_path.iterdir()) == [], "the end of the folder, without the client")
    client.close()
    assert list(tmp_path.iterdir()) == []


def test_outdated_curves_do_not_pile_up(worker: WorkerClient) -> None:
    key = worker.request("count", {"steps": 30, "pause": 0.05}, curves=True)
    until(lambda: key not in worker._open, "the end of the job")  # nobody has looked since it began
    events = worker.poll(100)
    assert [event["event"] for event in events[2:]] == ["result"]
    latest = {event["event"]: event["iteration"] for event in events[:2]}  # whichever came last
    assert latest.keys() == {"progress", "curves"} and min(latest.values()) > 20


def test_a_limit_of_events(worker: WorkerClient) -> None:
    keys = [worker.request("echo", {"values": [i]}) for i in range(5)]
    until(lambda: not worker._open, "all results")
    assert [event["id"] for event in worker.poll(2)] == keys[:2]
    assert [event["id"] for event in worker.poll(2)] == keys[2:4]
    assert [event["id"] for event in worker.poll()] == keys[4:]


def test_cancel_what_waits(worker: WorkerClient) -> None:
    first = worker.request("count", {"steps": 10**6, "pause": 0.01})
    second = worker.request("count")
    third = worker.request("count")
    worker.cancel(second)
    worker.cancel("999")
    (event,) = [event for event in events_until_done(worker, second) if event["event"] == "error"]
    assert event["kind"] == "cancelled" and "before it began" in event["message"]
    worker.cancel(first)
    events = events_until_done(worker, first, third)
    kinds = {event["id"]: event.get("kind") for event in events if event["event"] in ("error", "result")}
    assert kinds == {first: "cancelled", third: None}


def test_an_exception_in_the_callback_stops_the_job(worker: WorkerClient) -> None:
    def fail(step: Progress) -> None:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        worker.call("count", {"steps": 10**6, "pause": 0.01}, fail)
    assert worker.call("count")["steps"] == 3  # and does not wait for ever
    assert worker.poll() == []


def test_arrays_travel_both_ways(worker: WorkerClient) -> None:
    values = [
        np.random.default_rng(1).normal(size=(3, 4, 3)),
        np.arange(6, dtype=np.int32).reshape(2, 3),
        np.arange(4, dtype=">f4"),
        np.array([True, False]),
        np.zeros((0, 2)),
        np.array([np.nan, np.inf]),
        np.float32(1.5),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.array(["ä", "b"]),
    ]
    back = worker.call("echo", {"values": values})
    assert back["kinds"] == ["ndarray"] * 6 + ["float", "ndarray", "list"]
    for sent, got in zip(values, back["values"], strict=True):
        assert np.array_equal(sent, got, equal_nan=np.asarray(sent).dtype.kind == "f")
    big = worker.call("echo", {"values": ["ü 桥 \udcff", {"a": None}, "x" * 300_000]})
    assert big["values"] == ["ü 桥 \udcff", {"a": None}, "x" * 300_000]
    with pytest.raises(ValueError, match="JSON"):
        worker.call("echo", {"values": [float("nan")]})
    with pytest.raises(TypeError, match="set"):
        worker.call("echo", {"values": [{1, 2}]})


def test_what_libraries_print_never_reaches_the_protocol(worker: WorkerClient) -> None:
    assert worker.call("shout") == {"read": 0, "child_read": 0}
    words = until(lambda: "by a child" in worker.last_words and worker.last_words, "the last words")
    for text in ("printed", "to the old stdout", "to the descriptor"):
        assert text in words.splitlines()


@pytest.mark.parametrize("how", ["exit", "interrupt", "unknown", "known"])
def test_a_job_that_fails_leaves_the_worker_well(worker: WorkerClient, how: str) -> None:
    key = worker.request("crash", {"how": how})
    (event,) = events_until_done(worker, key)
    assert event["kind"] == "failed" and "as told" in event["message"]
    assert ("details" in event) == (how != "known") and "\n" not in event["message"]
    if how == "unknown":
        assert 'extra_jobs.py", line' in event["details"] and "ZeroDivisionError: as told" in event["message"]
    with pytest.raises(FrameTwinError, match="as told"):
        worker.call("crash", {"how": how})
    with pytest.raises(FrameTwinError, match="nan failed unexpectedly"):
        worker.call("nan")
    assert worker.call("count")["steps"] == 3


def test_requests_that_no_worker_knows(worker: WorkerClient) -> None:
    with pytest.raises(FrameTwinError, match="the request 'levitate' is unknown, the worker knows simulate, fit"):
        worker.call("levitate")


@posix
@pytest.mark.parametrize(
    ("how", "words"),
    [("kill", "was killed (SIGKILL)"), ("abort", "was killed (SIGSEGV)"), ("leave", "ended with the exit code 3")],
)
def test_a_worker_that_dies_is_reported_once_and_the_next_one_works(how: str, words: str) -> None:
    with extra_client() as client:
        client.call("count")
        key = client.request("crash", {"how": how})
        events = events_until_done(client, key)
        assert len(events) == 1 and events[0]["kind"] == "ended"
        assert events[0]["message"].startswith(f"The worker {words}, its last words: ")
        assert ("about to" in events[0]["message"]) == (how != "abort")  # a crash is said in more words than three
        assert f"about to {how}" in client.last_words
        if how == "abort":
            assert "Fatal Python error" in client.last_words and "in crash" in client.last_words
        assert type(error_of(events[0])) is FrameTwinError
        assert not client.alive and client.poll() == []
        with pytest.raises(FrameTwinError, match="exit code|was killed") as caught:
            client.request("count")
        assert "start another one" in str(caught.value)
    with extra_client() as fresh:
        assert fresh.call("count")["steps"] == 3


@posix
def test_a_worker_killed_from_outside_in_the_middle_of_a_call() -> None:
    with extra_client() as client:
        assert client.pid is not None

        def kill(step: Progress) -> None:
            os.kill(client.pid, signal.SIGKILL)

        with pytest.raises(FrameTwinError, match="was killed"):
            client.call("count", {"steps": 10**6, "pause": 0.01}, kill)


def test_closing_ends_the_process_and_what_it_does(tmp_path: Path) -> None:
    client = extra_client()
    client.start()
    key = client.request("write", {"out": tmp_path / "out"})
    until(lambda: any(event["event"] == "progress" for event in client.poll()), "its progress")
    assert len(list(tmp_path.iterdir())) == 1
    client.close(timeout=60.0)
    assert not client.alive and is_gone(client.pid) and list(tmp_path.iterdir()) == []
    until(lambda: key not in client._open, "the answer")
    last = client.poll()[-1]
    assert (last["id"], last["event"], last["kind"]) == (key, "error", "cancelled")
    client.close()
    with pytest.raises(FrameTwinError, match="is not running"):
        client.request("count")
    with pytest.raises(FrameTwinError, match="make another one"):
        client.start()


def test_closing_ends_even_what_does_not_listen() -> None:
    client = extra_client()
    client.start()
    client.request("stubborn")
    client.call("versions")
    time.sleep(0.1)
    began = time.monotonic()
    client.close()
    assert is_gone(client.pid) and time.monotonic() - began < 5.0


def test_two_clients_have_a_worker_each() -> None:
    with extra_client() as one, extra_client() as two:
        assert one.pid != two.pid
        key = one.request("count", {"steps": 10**6, "pause": 0.01})
        assert two.call("count")["steps"] == 3
        one.cancel(key)
        assert events_until_done(one, key)[-1]["kind"] == "cancelled"


CHILD = """
import sys, time
from worker_cases import extra_client
client = extra_client()
client.start()
client.request("write", {"out": sys.argv[1]})
while not any(event["event"] == "progress" for event in client.poll()):
    time.sleep(0.01)
print(client.pid, flush=True)
"""


@posix
@pytest.mark.parametrize("end", ["kill", "leave", "raise"])
def test_the_worker_goes_with_its_parent(end: str, tmp_path: Path) -> None:
    last = {"kill": "time.sleep(600)", "leave": "", "raise": "raise ValueError"}[end]
    out = tmp_path / "deep" / "out"
    parent = subprocess.Popen(
        [sys.executable, "-c", CHILD + last, str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={
            **os.environ,
            VARIABLE: worker_python(),
            "PYTHONPATH": os.pathsep.join([str(EXTRA_JOBS.parent), str(Path(frametwin.__file__).parents[1])]),
        },
    )
    try:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        if end == "kill":
            assert not is_gone(pid) and list(tmp_path.iterdir())
            parent.kill()
        parent.wait(timeout=60)
        parent.stdout.close()
    finally:
        parent.kill()
    until(lambda: is_gone(pid), "the worker's end")
    assert list(tmp_path.iterdir()) == []  # nothing half-written
