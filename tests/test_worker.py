"""The worker process as such: lines in, events out, and its end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worker_cases import EXTRA_JOBS

from frametwin.progress import Progress
from frametwin.worker import server, streams
from frametwin.worker.event_queue import EventQueue
from frametwin.worker.protocol import LONGEST_LINE, ProtocolError, decode, encode
from frametwin.worker.server import GRACE

posix = pytest.mark.skipif(os.name == "nt", reason="Windows has no signals that one process sends to another")


class Pipes:
    """A worker without a client: its bare pipes."""

    def __init__(self, before: Callable[[], Any] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "frametwin.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(EXTRA_JOBS)},
            preexec_fn=None if os.name == "nt" else before,
        )
        self.guard = threading.Timer(120.0, self.process.kill)  # a test fails, it does not hang
        self.guard.daemon = True
        self.guard.start()

    def send(self, line: bytes | str | dict[str, Any]) -> None:
        data = json.dumps(line) if isinstance(line, dict) else line
        data = data.encode() if isinstance(data, str) else data
        assert self.process.stdin is not None
        self.process.stdin.write(data + b"\n")
        self.process.stdin.flush()

    def hear(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        event: dict[str, Any] = json.loads(self.process.stdout.readline())
        return event

    def rest(self) -> list[dict[str, Any]]:
        assert self.process.stdout is not None
        return [json.loads(line) for line in self.process.stdout.readlines()]

    def end(self) -> None:
        self.guard.cancel()
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            assert stream is not None
            stream.close()


@pytest.fixture
def pipes() -> Iterator[Pipes]:
    found = Pipes()
    assert found.hear()["event"] == "ready"
    yield found
    found.end()


def test_nothing_heavy_is_loaded_before_a_job_needs_it() -> None:
    code = (
        "import sys, frametwin.worker.server as s; s.versions(); "
        "print(sorted({'numpy', 'scipy', 'torch', 'numba', 'cv2', 'bpy'} & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


# --- Lines


BAD = [
    (b"hello", None, "the line is not JSON"),
    (b'{"id": "1", "request"', None, "the line is not JSON"),
    (b'{"id": "1", "request": "\xff"}', None, "the line is not UTF-8"),
    (b"[1, 2]", None, "the line is not a JSON object"),
    (b"[" * 100_000, None, "the line is not usable JSON"),
    (b'{"n": ' + b"9" * 10_000 + b"}", None, "the line is not usable JSON"),
    (b'{"request": "simulate"}', None, "the request has no id"),
    (b'{"request": "simulate", "id": 7}', None, "the request has no id"),
    (b'{"id": "1"}', "1", "the request None is unknown"),
    (b'{"id": "1", "request": 5}', "1", "the request 5 is unknown"),
    (b'{"id": "1", "request": "fly"}', "1", "the request 'fly' is unknown, the worker knows simulate, fit"),
    (b'{"id": "1", "request": "fit", "capture": "c"}', "1", "a request has no field 'capture'"),
    (b'{"id": "1", "request": "fit", "parameters": []}', "1", "the parameters are not an object"),
    (b'{"id": "1", "request": "fit", "curves": 1}', "1", "curves is not true or false"),
    (b'{"id": "1", "request": "echo", "parameters": {"values": [{"dtype": "<f4", "shape": [3], "base64": "AAA="}]}}',
     None, "an array in the line is damaged"),
    (b'{"id": "1", "request": "echo", "parameters": {"values": [{"dtype": "|O", "shape": [], "base64": ""}]}}',
     None, "an array in the line is damaged"),
    (b"x" * (LONGEST_LINE + 2), None, "the line is too long"),
]  # fmt: skip


def test_bad_lines_are_answered_and_the_worker_goes_on(pipes: Pipes) -> None:
    for line, key, words in BAD:
        pipes.send(line)
        event = pipes.hear()
        assert (event["event"], event["kind"], event["id"]) == ("error", "protocol", key), line[:80]
        assert event["message"].startswith(words) and event["message"].endswith(".")
    pipes.send(b"\n  \r\n")  # nothing is no line
    pipes.send({"id": "2", "request": "count", "parameters": {"steps": 1}})
    assert [pipes.hear()["event"] for _ in range(2)] == ["progress", "result"]


def test_an_id_is_taken_until_its_answer(pipes: Pipes) -> None:
    slow = {"id": "a", "request": "count", "parameters": {"steps": 10**6, "pause": 0.01}}
    pipes.send(slow)
    pipes.send(slow)
    found = next(event for event in iter(pipes.hear, None) if event["event"] == "error")
    assert found["id"] is None and found["kind"] == "protocol" and "the id a is under way" in found["message"]
    pipes.send({"request": "cancel", "id": "a"})
    found = next(event for event in iter(pipes.hear, None) if event["event"] == "error")
    assert found["id"] == "a" and found["kind"] == "cancelled"
    pipes.send({"id": "a", "request": "count", "parameters": {"steps": 0}})
    assert pipes.hear() == {"event": "result", "id": "a", "result": {"steps": 0}}


def test_versions_are_told_while_a_job_runs(pipes: Pipes) -> None:
    pipes.send({"id": "a", "request": "count", "parameters": {"steps": 10**6, "pause": 0.01}})
    pipes.send({"id": "b", "request": "versions"})
    found = next(event for event in iter(pipes.hear, None) if event["event"] == "result")
    assert found["id"] == "b" and found["result"]["pid"] == pipes.process.pid


def test_progress_is_told_now_and_then_but_never_late(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(server, "monotonic", lambda: now[0])
    source, sink = os.pipe()
    task = server.RunningJob("a", "job", {}, curves=True)
    reporter = server.Reporter(task, streams.EventWriter(sink, lambda: None))
    for step in range(101):
        assert reporter(Progress("counting", step, 100, None, np.full((1, 4, 3), step)))
        now[0] += 0.01
    assert reporter(Progress("next", 0, 7, 0.5))
    task.cancelled.set()
    assert not reporter(Progress("next", 1, 7, 0.5))
    os.close(sink)
    events = [decode(line) for line in streams.read_lines(source) if isinstance(line, bytes)]
    os.close(source)
    told = [event["iteration"] for event in events if event["event"] == "progress"]
    drawn = [event["iteration"] for event in events if event["event"] == "curves"]
    assert told[0] == 0 and told[-2:] == [100, 0] and 15 <= len(told) <= 24
    assert drawn[0] == 0 and 4 <= len(drawn) <= 5
    assert events[-1] == {
        "event": "progress", "id": "a", "stage": "next", "iteration": 0, "total": 7, "loss": 0.5
    }  # fmt: skip


# --- The end


WRITING = {"id": "a", "request": "write"}


def writing(pipes: Pipes, folder: Path) -> None:
    """Let the worker be in the middle of writing a folder."""
    pipes.send({**WRITING, "parameters": {"out": str(folder / "out")}})
    assert pipes.hear()["event"] == "progress"
    assert len(list(folder.iterdir())) == 1


def quit_it(pipes: Pipes) -> None:
    pipes.send({"request": "quit"})


def close_its_input(pipes: Pipes) -> None:
    assert pipes.process.stdin is not None
    pipes.process.stdin.close()


def close_its_output(pipes: Pipes) -> None:
    assert pipes.process.stdout is not None
    pipes.process.stdout.close()


def terminate(pipes: Pipes) -> None:
    pipes.process.terminate()


def interrupt(pipes: Pipes) -> None:
    pipes.process.send_signal(signal.SIGINT)


ENDS = [quit_it, close_its_input, close_its_output, *([] if os.name == "nt" else [terminate, interrupt])]


@pytest.mark.parametrize("end", ENDS)
def test_it_ends_in_the_middle_of_a_job_and_leaves_nothing(end: Any, pipes: Pipes, tmp_path: Path) -> None:
    writing(pipes, tmp_path)
    pipes.send({"id": "b", "request": "count"})
    end(pipes)
    assert pipes.process.wait(timeout=60) == 0
    assert list(tmp_path.iterdir()) == []
    assert pipes.process.stderr is not None and pipes.process.stderr.read() == b""
    if end is not close_its_output:
        events = [event for event in pipes.rest() if event["event"] != "progress"]
        assert [(event["id"], event["event"], event["kind"]) for event in events] == [("a", "error", "cancelled")]


@pytest.mark.parametrize("end", [end for end in ENDS if end is not close_its_output])
def test_it_ends_when_there_is_nothing_to_do(end: Any, pipes: Pipes) -> None:
    end(pipes)
    assert pipes.process.wait(timeout=60) == 0


def test_a_job_that_does_not_listen_has_a_second(pipes: Pipes) -> None:
    pipes.send({"id": "a", "request": "count", "parameters": {"steps": 3, "pause": 600.0}})
    assert pipes.hear()["event"] == "progress"
    began = time.monotonic()
    close_its_input(pipes)
    assert pipes.process.wait(timeout=60) == 1
    assert 0.5 * GRACE < time.monotonic() - began < GRACE + 10.0


@posix
def test_a_second_signal_is_obeyed_at_once(pipes: Pipes) -> None:
    pipes.send({"id": "a", "request": "count", "parameters": {"steps": 3, "pause": 600.0}})
    assert pipes.hear()["event"] == "progress"
    quit_it(pipes)
    time.sleep(0.1)
    terminate(pipes)
    assert pipes.process.wait(timeout=60) == 128 + signal.SIGTERM


@posix
def test_what_nohup_has_ignored_stays_ignored() -> None:
    pipes = Pipes(lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    assert pipes.hear()["event"] == "ready"
    pipes.process.send_signal(signal.SIGHUP)
    pipes.send({"id": "a", "request": "count", "parameters": {"steps": 3, "pause": 0.1}})
    assert next(event for event in iter(pipes.hear, None) if event["event"] != "progress")["event"] == "result"
    pipes.end()


# --- Streams


def test_lines_of_any_length_come_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "CHUNK", 7)
    lines = [b"a", b"", b"bcdefghijklmno", b"too long for this one", b"pq", b"exactly ten", b"no end"]

    def read(longest: int) -> list[bytes | None]:
        source, sink = os.pipe()
        os.write(sink, b"\r\n".join(lines))
        os.close(sink)
        try:
            found = list(streams.read_lines(source, longest))
        finally:
            os.close(source)
        return [None if isinstance(line, streams.TooLong) else line for line in found]

    assert read(1000) == [line for line in lines if line]
    assert read(14) == [b"a", b"bcdefghijklmno", None, b"pq", b"exactly ten", b"no end"]


def test_an_event_is_written_whole_or_not_at_all() -> None:
    source, sink = os.pipe()
    broken: list[int] = []
    writer = streams.EventWriter(sink, lambda: broken.append(1))
    big = {"event": "x", "values": np.arange(100_000.0)}
    threads = [threading.Thread(target=writer.send, args=(big,)) for _ in range(3)]
    for thread in threads:
        thread.start()
    found = []
    for line in streams.read_lines(source):
        assert isinstance(line, bytes)
        found.append(decode(line))
        if len(found) == 3:
            break
    for thread in threads:
        thread.join()
    assert all(np.array_equal(event["values"], np.arange(100_000.0)) for event in found)
    with pytest.raises(ValueError):
        writer.send({"event": "y", "value": float("inf")})
    os.close(source)
    writer.send({"event": "z"})
    writer.send({"event": "z"})
    assert broken == [1]
    os.close(sink)


def test_paths_and_arrays_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    line = encode({"path": Path("ä"), "numbers": np.float32([[1.5], [2.5]]), "n": np.int64(3)})
    assert line.endswith(b"\n") and line.count(b"\n") == 1
    assert json.loads(line) == {
        "path": str(tmp_path / "ä"),
        "numbers": {"dtype": "<f4", "shape": [2, 1], "base64": "AADAPwAAIEA="},
        "n": 3,
    }
    with pytest.raises(ProtocolError, match="damaged"):
        decode(b'{"a": {"dtype": "<f4", "shape": [-1], "base64": "AADAPw=="}}')


def test_of_progress_only_the_newest_of_a_stage_waits() -> None:
    events = EventQueue()
    for step in range(5):
        events.put({"event": "progress", "id": "1", "stage": "a", "iteration": step})
        events.put({"event": "curves", "id": "1", "stage": "a", "iteration": step})
        events.put({"event": "progress", "id": "2", "stage": "a", "iteration": step})
    events.put({"event": "progress", "id": "1", "stage": "b", "iteration": 0})
    events.put({"event": "result", "id": "1"})
    events.put({"event": "result", "id": "2"})
    second = events.wait_for(lambda event: event["id"] == "2", 0.0)
    assert second == {"event": "progress", "id": "2", "stage": "a", "iteration": 4}
    assert events.wait_for(lambda event: event["id"] == "3", 0.01) is None
    taken = events.take(10)
    assert [(event["event"], event.get("iteration")) for event in taken] == [
        ("progress", 4), ("curves", 4), ("progress", 0), ("result", None), ("result", None)
    ]  # fmt: skip
    assert events.take(10) == []
