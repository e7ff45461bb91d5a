"""Starting a worker and talking to it, also from inside of Blender: numpy and the standard library are enough.

A program that may not wait pumps::

    client = WorkerClient(find_python())
    client.start()
    fit = client.request("fit", {"capture": folder, "out": run}, curves=True)
    ...
    for event in client.poll(20):     # from a timer; see frametwin.worker.protocol for the events
        ...
    client.close()

Others call: ``client.call("fit", {...}, progress)``. Threads of the client's own only read and write its pipes.
"""

from __future__ import annotations

import atexit
import os
import threading
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from frametwin.errors import FrameTwinError, InputError, error_from
from frametwin.progress import Progress, ProgressCallback
from frametwin.scratch import make_scratch, remove_scratch, scratch_environment
from frametwin.worker.child import Child
from frametwin.worker.event_queue import Event, EventQueue
from frametwin.worker.handshake import check_versions, start_problem
from frametwin.worker.interpreter import REMEDY, find_python, worker_environment

__all__ = ["WorkerClient", "error_of", "find_python"]

ENDED = "ended"
"""Kind of the errors that say that the worker is gone; all others come from the worker itself."""

_GONE = "gone"  # an event of the client's own
_clients: weakref.WeakSet[WorkerClient] = weakref.WeakSet()


class WorkerClient:
    """A worker process, for one user; a context manager.

    Parameters
    ----------
    python
        The Python that has the libraries; see `find_python`.
    cwd
        The working folder of the worker; by default that of this process.
    environment
        Environment variables to set, or with ``None`` to remove.
    package_root
        To take ``frametwin`` from the folder that holds it and not from where it is installed.
    command
        The whole command that starts the worker, where that is not ``python -m frametwin.worker``: a Blender is told
        differently what to run. ``python`` then only names it in messages.
    remedy
        What to do about a Python that cannot be used, where that is not to install FrameTwin there by hand.

    Attributes
    ----------
    versions
        What the worker says of itself, once it has been started: versions, ``cores``, ``jobs``.
    """

    def __init__(
        self,
        python: str | os.PathLike[str],
        *,
        cwd: str | os.PathLike[str] | None = None,
        environment: Mapping[str, str | None] | None = None,
        package_root: str | os.PathLike[str] | None = None,
        command: Sequence[str] | None = None,
        remedy: str | None = None,
    ) -> None:
        self.python = os.fspath(python)
        self._remedy = remedy
        self._command = [self.python, "-m", "frametwin.worker"] if command is None else list(command)
        self.versions: dict[str, Any] = {}
        self._cwd = cwd
        self._environment = worker_environment(self.python, package_root, environment)
        self._scratch: Path | None = None  # where the worker and its libraries put down files; both ends remove it
        self._child: Child | None = None
        self._events = EventQueue()
        self._open: set[str] = set()  # ids of requests that are not answered yet
        self._lock = threading.Lock()  # of the requests
        self._count = 0
        self._gone = self._closing = False

    def __enter__(self) -> WorkerClient:
        if self._child is None:
            self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether the process is there and takes requests."""
        return self._child is not None and not self._closing and self._child.running

    @property
    def pid(self) -> int | None:
        """Number of the process, once it has been started."""
        return None if self._child is None else self._child.process.pid

    @property
    def last_words(self) -> str:
        """The last lines that the worker wrote to standard error."""
        return "" if self._child is None else self._child.last_words

    # --- Beginning and end

    def start(self, timeout: float = 60.0) -> dict[str, Any]:
        """Start the process and wait until it is ready, usually a fraction of a second.

        Returns
        -------
        `versions`.

        Raises
        ------
        InputError
            If the Python cannot be run, has no FrameTwin, or another version of it; the message says what to do.
        """
        if self._child is not None:
            raise FrameTwinError("this client has been started before; make another one")
        if self._cwd is not None and not os.path.isdir(self._cwd):
            raise InputError.at(self._cwd, "working folder", "does not exist", "give a folder that exists")
        self._scratch = make_scratch()
        environment = {**self._environment, **scratch_environment(self._scratch)}
        try:
            self._child = Child(self._command, self._cwd, environment, self._hear, self._bury)
        except (OSError, ValueError) as error:
            remove_scratch(self._scratch)
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError.at(self.python, "Python", f"cannot be run ({reason})", self._remedy or REMEDY) from error
        _clients.add(self)
        try:
            ready = self._events.wait_for(lambda event: event["event"] in ("ready", _GONE), timeout)
            if ready is None:
                problem = f"did not answer within {timeout:g} s"
                raise InputError.at(self.python, "worker", problem, self._remedy or REMEDY)
            if ready["event"] == _GONE:
                raise start_problem(self.python, self._child.obituary(), self.last_words, self._remedy)
            check_versions(self.python, ready, self._remedy)
        except BaseException:
            self.close()
            raise
        self.versions = {name: value for name, value in ready.items() if name != "event"}
        return self.versions

    def close(self, timeout: float = 1.0) -> None:
        """End the process: ask it, then tell it, then kill it; it is gone after at most about ``timeout`` seconds.

        A job that is under way is given up. With 0 seconds it has no chance to tidy up.
        """
        with self._lock:
            self._closing = True
        if self._child is not None:
            self._child.end({"request": "quit"}, timeout)
        remove_scratch(self._scratch)
        _clients.discard(self)

    # --- Requests and events

    def request(self, name: str, parameters: Mapping[str, Any] | None = None, *, curves: bool = False) -> str:
        """Ask for a job without waiting; its events come by `poll`.

        Parameters
        ----------
        name
            One of ``versions["jobs"]``, or ``"versions"``.
        parameters
            For JSON; arrays and paths (made absolute) are welcome.
        curves
            Whether the curves are wanted while the job runs.

        Returns
        -------
        The id that its events carry.

        Raises
        ------
        FrameTwinError
            If the worker is not running.
        """
        with self._lock:
            if self._child is None or self._closing:
                raise FrameTwinError("the worker is not running; start another one")
            if self._gone:
                raise FrameTwinError(f"the worker {self._child.obituary()}; start another one")
            self._count += 1
            key = str(self._count)
            message: dict[str, Any] = {"id": key, "request": name, "parameters": dict(parameters or {})}
            self._child.send(message | {"curves": True} if curves else message)
            self._open.add(key)
        return key

    def poll(self, limit: int = 50) -> list[Event]:
        """Events that have come, the oldest first, at most ``limit``; never waits.

        If the worker ends by itself, every open request gets an ``error`` of the kind ``"ended"`` in words.
        """
        return [event for event in self._events.take(limit) if event["event"] != _GONE]

    def call(
        self,
        name: str,
        parameters: Mapping[str, Any] | None = None,
        progress: ProgressCallback | None = None,
        *,
        curves: bool = False,
    ) -> dict[str, Any]:
        """Ask for a job and wait for its result.

        Parameters
        ----------
        name, parameters, curves
            As for `request`.
        progress
            Told of every step; if it returns ``False``, the job is cancelled.

        Raises
        ------
        InputError, Held, Cancelled
            As the job.
        FrameTwinError
            If the job fails otherwise, or the worker ends.
        """
        key = self.request(name, parameters, curves=curves)
        cancelled = False
        try:
            while True:
                event = self._events.wait_for(lambda found: found.get("id") == key)
                assert event is not None
                if event["event"] == "result":
                    return dict(event["result"])
                if event["event"] == "error":
                    raise error_of(event)
                if progress is not None and not cancelled and progress(_progress_of(event)) is False:
                    self.cancel(key)
                    cancelled = True
        except BaseException:
            self._forget(key)
            raise

    def cancel(self, key: str) -> None:
        """Ask a job to stop at its next step; it answers with an ``error`` of the kind ``"cancelled"``.

        If that takes too long (a long computation between two steps), `close` ends it with its process.
        """
        if self._child is not None and not self._closing:
            self._child.send({"request": "cancel", "id": key})

    def _forget(self, key: str) -> None:
        """Stop a request in whose answer nobody is interested any more."""
        with self._lock:
            unanswered = key in self._open
            self._open.discard(key)
        if unanswered:
            self.cancel(key)
        self._events.drop(lambda event: event.get("id") == key)

    # --- What the child's threads call

    def _hear(self, event: Event) -> None:
        key = event.get("id")
        if key is not None:
            with self._lock:
                if key not in self._open:
                    return
                if event["event"] in ("result", "error"):
                    self._open.discard(key)
                self._events.put(event)
        else:
            self._events.put(event)

    def _bury(self, obituary: str) -> None:
        """Answer the open requests of a worker that is gone."""
        with self._lock:
            self._gone = True
            orphans, self._open = sorted(self._open, key=int), set()
            words = "was closed" if self._closing else obituary
        for key in orphans:
            self._events.put({"event": "error", "id": key, "kind": ENDED, "message": f"The worker {words}."})
        self._events.put({"event": _GONE})


def error_of(event: Mapping[str, Any]) -> FrameTwinError:
    """The exception for an ``error`` event, with the parts of its sentence."""
    error = error_from(event)
    if event.get("details"):
        error.add_note(event["details"])
    return error


def _progress_of(event: Event) -> Progress:
    return Progress(event["stage"], event["iteration"], event["total"], event["loss"], event.get("control_points"))


def _close_all() -> None:
    for client in list(_clients):
        client.close(0.5)


atexit.register(_close_all)
