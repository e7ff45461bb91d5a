"""The worker process: one job at a time, told to stop at any moment, and never there without its parent."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import threading
import traceback
from collections import deque
from dataclasses import dataclass, field
from importlib import metadata
from time import monotonic
from typing import Any

from frametwin import __version__
from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.progress import Progress
from frametwin.scratch import VARIABLE, hold_scratch, remove_scratch
from frametwin.worker.job_table import JOBS, run_job
from frametwin.worker.protocol import PROTOCOL, ProtocolError, decode, finite
from frametwin.worker.streams import EventWriter, TooLong, read_lines

GRACE = 1.0
"""Seconds that a job has to reach its next report of progress once nobody wants it any more."""

PROGRESS_PAUSE = 0.05
CURVES_PAUSE = 0.25
"""Seconds between two events of a kind; stages begin and end without delay."""

PACKAGES = ("numpy", "scipy", "numba", "torch", "bpy")
_FIELDS = {"id", "request", "parameters", "curves"}


def main(requests: int, events: int) -> None:
    """Serve, then leave the process at once: whatever libraries want to do at exit can hang, and matters to nobody."""
    faulthandler.enable()  # a crash in compiled code leaves its last words
    if VARIABLE in os.environ:
        hold_scratch(os.environ[VARIABLE])  # it stays in use for a moment should the client be killed
    worker = Worker(requests, events)
    worker.catch_signals()
    worker.serve()
    sys.stderr.flush()
    leave(0)


def leave(code: int) -> None:
    """End this process at once, and its scratch folder with it; libraries may hang when they are left to end."""
    remove_scratch(os.environ.get(VARIABLE))
    os._exit(code)


def versions() -> dict[str, Any]:
    """What this process is, without importing anything heavy."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "protocol": PROTOCOL,
        "frametwin": __version__,
        "python": ".".join(map(str, sys.version_info[:3])),
        "executable": sys.executable,
        "pid": os.getpid(),
        "cores": cores,
        "jobs": list(JOBS),
        **{name: _version_of(name) for name in PACKAGES},
    }


def _version_of(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


@dataclass(eq=False)
class RunningJob:
    """A request for a job."""

    id: str
    name: str
    parameters: dict[str, Any]
    curves: bool = False
    cancelled: threading.Event = field(default_factory=threading.Event)


class DoubleId(ProtocolError):
    """A request has the id of another one that is not done."""


def _id_of(message: dict[str, Any]) -> str:
    key = message.get("id")
    if not isinstance(key, str) or not 1 <= len(key) <= 100:
        raise ProtocolError("the request has no id, which is a text of up to 100 characters")
    return key


def _task_of(key: str, message: dict[str, Any]) -> RunningJob:
    request, parameters, curves = message.get("request"), message.get("parameters", {}), message.get("curves", False)
    if not isinstance(request, str) or request not in JOBS:
        raise ProtocolError(f"the request {request!r} is unknown, the worker knows {', '.join(JOBS)}")
    for name in message:
        if name not in _FIELDS:
            raise ProtocolError(f"a request has no field {name!r}, its parameters belong under 'parameters'")
    if not isinstance(parameters, dict):
        raise ProtocolError("the parameters are not an object")
    if not isinstance(curves, bool):
        raise ProtocolError("curves is not true or false")
    return RunningJob(key, request, parameters, curves)


def _error(key: str | None, kind: str, message: str, **more: Any) -> dict[str, Any]:
    return {"event": "error", "id": key, "kind": kind, "message": " ".join(message.split()), **more}


def _failed(task: RunningJob, error: BaseException) -> dict[str, Any]:
    """The event for an exception that nobody foresaw; called while it is handled."""
    problem = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    message = f"{task.name} failed unexpectedly ({problem})."
    return _error(task.id, "failed", message, details=traceback.format_exc())


class Worker:
    """Runs jobs in the calling thread while another one listens.

    Parameters
    ----------
    requests, events
        Descriptors; see `frametwin.worker.streams`.
    """

    def __init__(self, requests: int, events: int) -> None:
        self._requests = requests
        self._out = EventWriter(events, self.end)
        self._wake = threading.Condition()
        self._waiting: deque[RunningJob] = deque()
        self._current: RunningJob | None = None
        self._ended = False

    def catch_signals(self) -> None:
        """Let the signals that ask a process to end do so also while compiled code is at work.

        Those that whoever started this process wants ignored, as nohup does, stay ignored.
        """
        known = [getattr(signal, name) for name in ("SIGTERM", "SIGINT", "SIGHUP") if hasattr(signal, name)]
        numbers = [number for number in known if signal.getsignal(number) not in (signal.SIG_IGN, None)]
        for number in numbers:
            signal.signal(number, lambda *_: self.end() if os.name == "nt" else None)
        if os.name == "nt":
            return
        heard, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)

        def listen() -> None:
            while number := os.read(heard, 1):
                if number[0] in numbers:
                    if self._ended and number[0] == signal.SIGTERM:  # a second Ctrl-C changes nothing
                        leave(128 + number[0])
                    self.end()

        threading.Thread(target=listen, name="signals", daemon=True).start()

    def serve(self) -> None:
        """Do what is asked until the input ends."""
        self._out.send({"event": "ready", **versions()})
        threading.Thread(target=self._listen, name="requests", daemon=True).start()
        while (task := self._next()) is not None:
            event = self._outcome(task)
            with self._wake:
                self._current = None  # its id is free before its answer is heard
            self._send_last(task, event)

    def end(self) -> None:
        """Give up what is under way and end the process, within the grace in any case."""
        with self._wake:
            if self._ended:
                return
            self._ended = True
            self._waiting.clear()
            if self._current is not None:
                self._current.cancelled.set()
            self._wake.notify_all()
        end = threading.Timer(GRACE, leave, args=(1,))
        end.daemon = True
        end.start()

    # --- Listening

    def _listen(self) -> None:
        try:
            for line in read_lines(self._requests):
                if self._receive(line):
                    return
        finally:
            self.end()

    def _receive(self, line: bytes | TooLong) -> bool:
        """Obey a line; whether it is the last one."""
        key = None
        try:
            if isinstance(line, TooLong):
                raise ProtocolError("the line is too long")
            message = decode(line)
            request = message.get("request")
            if request == "quit":
                return True
            key = _id_of(message)
            if request == "cancel":
                self._cancel(key)
            elif request in ("versions", "hello"):
                self._out.send({"event": "result", "id": key, "result": versions()})
            else:
                self._add(_task_of(key, message))
        except DoubleId as error:
            self._out.send(_error(None, "protocol", f"{error}."))  # its id is that of another request
        except ProtocolError as error:
            self._out.send(_error(key, "protocol", f"{error}."))
        return False

    def _add(self, task: RunningJob) -> None:
        with self._wake:
            if task.id in {other.id for other in (*self._waiting, self._current) if other is not None}:
                raise DoubleId(f"a request with the id {task.id} is under way already")
            if not self._ended:
                self._waiting.append(task)
                self._wake.notify_all()

    def _cancel(self, key: str) -> None:
        with self._wake:
            waiting = [task for task in self._waiting if task.id == key]
            for task in waiting:
                self._waiting.remove(task)
            if self._current is not None and self._current.id == key:
                self._current.cancelled.set()
        for task in waiting:
            self._out.send(_error(task.id, "cancelled", f"{task.name} was cancelled before it began."))

    # --- Working

    def _next(self) -> RunningJob | None:
        with self._wake:
            while not self._waiting and not self._ended:
                self._wake.wait()
            if self._ended:
                return None
            self._current = self._waiting.popleft()
            return self._current

    def _outcome(self, task: RunningJob) -> dict[str, Any]:
        """Do a job; whatever it raises becomes its last event."""
        try:
            result = run_job(task.name, task.parameters, Reporter(task, self._out))
            return {"event": "result", "id": task.id, "result": result}
        except Cancelled as error:
            return _error(task.id, error.kind, f"{task.name} was cancelled: {error}.")
        except FrameTwinError as error:
            return _error(task.id, **error.as_dict())
        except ModuleNotFoundError as error:
            if error.name is None or error.name.partition(".")[0] == "frametwin":
                return _failed(task, error)
            problem = f"lacks {error.name}, which {task.name} needs here"
            lacking = InputError.at(sys.executable, "Python", problem, "let the worker run in one that has it")
            return _error(task.id, **lacking.as_dict())
        except BaseException as error:
            return _failed(task, error)

    def _send_last(self, task: RunningJob, event: dict[str, Any]) -> None:
        try:
            self._out.send(event)
        except (TypeError, ValueError) as error:
            message = f"{task.name} failed unexpectedly (its result cannot be sent: {error})."
            self._out.send(_error(task.id, "failed", message, details=traceback.format_exc()))


class Reporter:
    """The progress callback of a job: sends events, not too many, and says when to stop."""

    def __init__(self, task: RunningJob, out: EventWriter) -> None:
        self._task, self._out = task, out
        self._place: tuple[str, bool] | None = None  # stage, and whether it is done
        self._sent = self._drawn = float("-inf")

    def __call__(self, step: Progress) -> bool:
        """Tell of a step; ``False`` if the job is not wanted any more."""
        if self._task.cancelled.is_set():
            return False
        now = monotonic()
        event = {
            "id": self._task.id,
            "stage": step.stage,
            "iteration": step.iteration,
            "total": step.total,
            "loss": finite(step.loss),
        }
        place = (step.stage, step.iteration >= step.total)
        if now - self._sent >= PROGRESS_PAUSE or place != self._place:
            self._out.send({"event": "progress", **event})
            self._sent, self._place = now, place
        if self._task.curves and step.control_points is not None and now - self._drawn >= CURVES_PAUSE:
            self._out.send({"event": "curves", **event, "control_points": step.control_points.astype("<f4")})
            self._drawn = now
        return True
