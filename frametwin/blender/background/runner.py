"""One long job at a time beside Blender: started, followed, cancelled and finished without holding the interface.

A thread starts the worker process and another one reads what it says (`frametwin.worker.client`); a timer calls
`Runner.pump` in the main thread, the only one that touches ``bpy``. Tests and scripts call it themselves.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from frametwin.blender.background.new_folder import NewFolder
from frametwin.blender.background.status import Status
from frametwin.blender.background.stepwise import TURN
from frametwin.errors import Cancelled, FrameTwinError
from frametwin.worker.client import ENDED, WorkerClient, error_of

EVENTS = 20
"""Most events that are looked at in one call of `Runner.pump`."""

TURN_SECONDS = 0.004
"""After which `Runner.pump` begins no other step; the last one may take as long again."""

GRACE = 0.4
"""Seconds in which a job may stop by itself when it is cancelled; then its process is killed."""

Steps = Generator[str | None, None, str]
"""Work in the main thread in small steps, see `TURN` for what they yield; what it returns is told to the user."""


@dataclass(frozen=True, eq=False)
class Job:
    """Something that a worker does.

    Attributes
    ----------
    title
        What to call it: ``"Fit"``.
    request, parameters
        One of the worker's jobs; ``None`` for what needs no worker but takes a while to ``load``.
    worker
        Gives the client that does it, not started yet. Called in the main thread; may raise `FrameTwinError`.
    kind
        Clients of the same kind are kept for the next job; ``None`` ends the process when the job is done.
    on_curves
        Shows (E, 4, 3) curves in mm while the job runs; ``None`` where nobody wants them.
    load
        Makes of the result what `finish` needs. Runs in a thread: it must not touch ``bpy``.
    finish
        Puts it into the scene, in steps of some milliseconds; cleans up after itself if it raises or is closed.
    clear
        Takes away what ``on_curves`` has shown; called once, however the job ends.
    out
        A folder that the worker makes, whole or not at all: nothing of it is left if the job is cancelled, however
        late. What is there before, or was made by others, stays. ``None`` where nothing is written.
    then
        Gives the job that follows if this one ends well; ``None`` for none.
    stages
        The stages that take time, and about which part of it each: ``(0.2, 1.0)`` for the last four fifths. Two that
        count their steps together have the same. See `Status.overall`.
    part
        Which of how many jobs that follow each other this is, from 0.
    labels
        What the interface calls fields that errors of the worker name: an error names what its user sees.
    """

    title: str
    finish: Callable[[Any], Steps]
    request: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    worker: Callable[[], WorkerClient] | None = None
    kind: str | None = None
    load: Callable[[dict[str, Any]], Any] = lambda result: result
    on_curves: Callable[[np.ndarray], None] | None = None
    clear: Callable[[], None] = lambda: None
    out: Path | None = None
    then: Callable[[], Job] | None = None
    stages: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    part: tuple[int, int] = (0, 1)
    labels: Mapping[str, str] = field(default_factory=dict)


class Runner:
    """Runs jobs, one at a time.

    Attributes
    ----------
    status
        For the interface.
    """

    def __init__(self) -> None:
        self.status = Status()
        self._job: Job | None = None
        self._client: WorkerClient | None = None
        self._kept: dict[str, WorkerClient] = {}
        self._key: str | None = None
        self._thread: threading.Thread | None = None
        self._answer: list[Any] = []  # of the thread: one value or one exception
        self._next: Callable[[Any], None] = lambda value: None  # what becomes of it, in the main thread
        self._steps: Steps | None = None
        self._result: Any = None
        self._held = False
        self._folder: NewFolder | None = None
        self._written = False  # whether the worker has said that the folder is there
        self._deadline: float | None = None  # of a job that was cancelled

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self._job is not None

    @property
    def finishing(self) -> bool:
        """Whether the result is being put into the scene, step by step."""
        return self._steps is not None

    @property
    def cancelling(self) -> bool:
        """Whether the job was asked to stop and has not yet."""
        return self._deadline is not None

    @property
    def pids(self) -> list[int]:
        """Numbers of the processes that are kept or at work."""
        clients = [*self._kept.values(), *([] if self._client is None else [self._client])]
        return [client.pid for client in clients if client.alive and client.pid is not None]

    # --- Beginning

    def start(self, job: Job) -> None:
        """Begin a job; returns at once.

        Raises
        ------
        FrameTwinError
            If another one is under way, or there is no worker for it.
        """
        if self._job is not None:
            raise FrameTwinError(f"{self._job.title} is still under way; wait for it or cancel it")
        self._held = self._written = False
        self._steps = self._result = self._deadline = None
        self._folder = None if job.out is None else NewFolder(job.out)
        if job.request is None or job.worker is None:
            self._job, self._client, self._key = job, None, None
            self.status = Status.of(job.title, "reading", job.stages, job.part, self.status)
            self._run_in_thread(lambda: job.load({}), self._loaded)
            return
        self._start_worker(job, job.request, job.worker)

    def _start_worker(self, job: Job, request: str, worker: Callable[[], WorkerClient]) -> None:
        kept = self._kept.get(job.kind) if job.kind is not None else None
        client = kept if kept is not None and kept.alive else worker()
        if kept is not None and client is not kept:
            self._kept.pop(job.kind or "")
        for kind in [kind for kind in self._kept if job.kind is not None and kind != job.kind]:
            _close_aside(self._kept.pop(kind))  # of another Python, which was given up for this one
        self._job, self._client, self._key = job, client, None
        self.status = Status.of(job.title, "starting", job.stages, job.part, self.status)
        fresh = client is not kept

        def begin() -> str:
            if fresh:
                client.start()
            return client.request(request, job.parameters, curves=job.on_curves is not None)

        self._run_in_thread(begin, self._began, lambda: client.close(0.0))

    def _began(self, key: str) -> None:
        self._key = key

    # --- The pump

    def pump(self, seconds: float = TURN_SECONDS) -> bool:
        """Take over what has come, in the main thread, for at most about ``seconds``; whether a job is under way."""
        if self._job is None:
            return False
        try:
            self._pump(perf_counter() + seconds)
        except Cancelled:
            self._end(False, "Cancelled", cancelled=True)
        except FrameTwinError as error:
            self._end(True, str(error))
        except Exception as error:  # a bug must not leave a job that never ends
            self._end(True, f"{self.status.title} failed unexpectedly: {type(error).__name__}: {error}")
        return self._job is not None

    def _pump(self, deadline: float) -> None:
        if self._deadline is not None and perf_counter() > self._deadline:
            self._kill()
            raise Cancelled
        if self._answer:
            value = self._answer.pop()
            self._thread = None
            if isinstance(value, BaseException):
                raise value
            self._next(value)
        if self._key is not None:
            self._listen(deadline)
        while self._steps is not None:  # one step at least, or a full queue of events would keep the end away
            turn = None
            try:
                turn = next(self._steps)
            except StopIteration as done:
                self._end(False, done.value or f"{self.status.title} done")
            if turn == TURN or perf_counter() >= deadline:
                break

    def _listen(self, deadline: float) -> None:
        assert self._client is not None and self._job is not None
        curves = None
        for event in self._client.poll(EVENTS):
            if event.get("id") != self._key:
                continue
            if event["event"] in ("progress", "curves"):
                self.status.step(event)
                curves = event.get("control_points", curves)
            elif event["event"] == "error":
                self._fail(event)
            elif event["event"] == "result":
                self._arrived(event["result"])
        if curves is not None and self._job.on_curves is not None and self._steps is None and perf_counter() < deadline:
            self._job.on_curves(curves)

    def _fail(self, event: Mapping[str, Any]) -> None:
        if event["kind"] == ENDED and self._folder is not None:
            _tidy_aside(self._folder, False)
        if event["kind"] == "cancelled" or self.cancelling:
            raise Cancelled
        if event["kind"] == ENDED:
            raise FrameTwinError(f"{event['message']} The next {self.status.title.lower()} starts a fresh one.")
        error = error_of(event)
        label = self._job.labels.get(error.field) if self._job is not None else None
        raise error if label is None else error.with_field(label)

    def _arrived(self, result: dict[str, Any]) -> None:
        assert self._job is not None
        job = self._job
        self._key, self._written = None, True
        if self.cancelling:
            raise Cancelled
        self.status.result("reading the result")
        self._run_in_thread(lambda: job.load(result), self._loaded)

    def _loaded(self, value: Any) -> None:
        assert self._job is not None
        self._result = value
        self.status.result("showing the result")
        self._steps = self._job.finish(value)

    def hold(self) -> None:
        """Take back what was put into the scene so far: its data-blocks are about to be exchanged, by an undo, say."""
        if self._steps is not None and self._job is not None:
            self._steps.close()
            self._steps = None
            self._held = True

    def resume(self) -> None:
        """Begin anew what `hold` took back."""
        if self._held and self._job is not None:
            self._steps = self._job.finish(self._result)
        self._held = False

    # --- End

    def cancel(self) -> None:
        """Stop the job: politely, and by force if `pump` finds it running after `GRACE`."""
        if self._job is None or self.cancelling:
            return
        self.status.stage = "stopping"
        self._deadline = perf_counter() + GRACE
        if self._client is None or self._written:  # nobody but this process is still at it
            self._end(False, "Cancelled", cancelled=True)
        elif self._key is not None:
            self._client.cancel(self._key)

    def _kill(self) -> None:
        """End the process of the job without waiting for it here."""
        client, folder = self._client, self._folder
        self._client = None
        if client is None:
            return
        self._forget(client)

        def kill() -> None:
            client.close(0.0)
            if folder is not None:
                _tidy(folder, _has_answered(client))

        threading.Thread(target=kill, name="end of a worker", daemon=True).start()

    def _end(self, error: bool, message: str, cancelled: bool = False) -> None:
        job, client, steps, reading = self._job, self._client, self._steps, self._thread
        assert job is not None
        if cancelled and self._written and self._folder is not None:
            _tidy_aside(self._folder, True, reading)
        self._job = self._client = self._key = self._steps = self._result = self._deadline = None
        self._answer, self._thread = [], None
        if steps is not None:
            steps.close()
        with suppress(ReferenceError):
            job.clear()
        if client is not None:
            self._keep_or_close(job, client)
        self.status.end(message, error, cancelled)
        if job.then is not None and not error and not cancelled:
            try:
                self.start(job.then())
            except FrameTwinError as problem:
                self.status.end(str(problem), error=True)

    def _keep_or_close(self, job: Job, client: WorkerClient) -> None:
        if job.kind is not None and client.alive and client.versions:
            self._kept[job.kind] = client
            return
        self._forget(client)
        _close_aside(client)

    def _forget(self, client: WorkerClient) -> None:
        self._kept = {kind: kept for kind, kept in self._kept.items() if kept is not client}

    def close(self) -> None:
        """End everything at once: no process and nothing shown is left. A job that runs is cancelled."""
        job, client, folder, written = self._job, self._client, self._folder, self._written
        clients = {*self._kept.values(), *([] if client is None else [client])}
        self._kept = {}
        if job is not None:
            self._client, self._written = None, False
            self._end(False, "Cancelled", cancelled=True)
        for each in clients:
            each.close(0.2)
        if job is not None and folder is not None:
            _tidy(folder, written or (client is not None and _has_answered(client)))

    def _run_in_thread(
        self, work: Callable[[], Any], then: Callable[[Any], None], dispose: Callable[[], None] = lambda: None
    ) -> None:
        """Do something that takes a while; ``then`` gets what it gives, in the main thread.

        If nobody wants it any more by then, ``dispose`` is called in its place, in the thread.
        """
        answer: list[Any] = []
        self._answer, self._next = answer, then

        def run() -> None:
            try:
                value = work()
            except BaseException as error:
                value = error
            answer.append(value)
            if self._answer is not answer:
                dispose()

        self._thread = threading.Thread(target=run, name="beginning or end of a job", daemon=True)
        self._thread.start()


def _has_answered(client: WorkerClient) -> bool:
    """Whether among what a worker said last, and nobody has heard, is that it has done the job."""
    return any(event["event"] == "result" for event in client.poll(10**6))


def _tidy(folder: NewFolder, written: bool) -> None:
    """Leave nothing of a job that was cancelled; a folder that the worker did not say it wrote may be another's."""
    if written:
        folder.remove()
    else:
        folder.remove_leftovers()


def _tidy_aside(folder: NewFolder, written: bool, reading: threading.Thread | None = None) -> None:
    """Do the same without waiting for it here, once nobody reads the folder any more."""

    def tidy() -> None:
        if reading is not None:
            reading.join()
        _tidy(folder, written)

    threading.Thread(target=tidy, name="end of a job", daemon=True).start()


def _close_aside(client: WorkerClient) -> None:
    """End a worker process without waiting for it here."""
    threading.Thread(target=client.close, args=(0.5,), name="end of a worker", daemon=True).start()
