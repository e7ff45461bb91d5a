"""Following a stream from its first picture to its last: events told, the latest twin written."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from frametwin.cameras import Camera
from frametwin.fields.store import save_field
from frametwin.files import staged_directory
from frametwin.fitting.api import FIELD_FILE, FitResult
from frametwin.formats import write_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.tracking.event_log import EventLog
from frametwin.tracking.events import Event
from frametwin.tracking.moments import Moment, Stream
from frametwin.tracking.settings import TrackSettings
from frametwin.tracking.sources import Followed, of_job
from frametwin.tracking.tracker import Tracked, Tracker
from frametwin.twin import twin as twin_files

EVENTS_FILE = "events.jsonl"

POLL = 0.02
"""Seconds between two looks for pictures."""


@dataclass(frozen=True)
class Summary:
    """How a stream was followed.

    Attributes
    ----------
    moments, passed_over : int
        Looked at, and come too fast to be looked at.
    events : mapping of str to int
        How many of each kind.
    seconds : float
        That a moment took, in the middle: reading its pictures, following them, and telling.
    """

    moments: int
    passed_over: int
    events: dict[str, int]
    seconds: float


@dataclass(eq=False)
class Session:
    """Follows a stream.

    Attributes
    ----------
    followed : Followed
    cameras : sequence of Camera
    stream : Stream
    out : Path
        A run folder that does not exist, or an earlier one of the same kind that is written over; see `live_run`.
    settings : TrackSettings
    backgrounds : sequence of (H, W, 3) array of uint8 or None, optional
        The views before printing.
    say : callable
        Told of every event as it happens.
    progress : ProgressCallback, optional
        Called at every look for pictures, and able to stop.
    write_every : float, s
        How often the twin is written at most; it is written at the end, too.
    idle : float or None, s
        End when nothing has come for so long; by default never.
    """

    followed: Followed
    cameras: Sequence[Camera]
    stream: Stream
    out: Path
    settings: TrackSettings = field(default_factory=TrackSettings)
    backgrounds: Sequence[np.ndarray | None] | None = None
    say: Callable[[Event], None] = lambda event: None
    progress: ProgressCallback | None = None
    write_every: float = 0.5
    idle: float | None = None

    def run(self) -> Summary:
        """Follow until the stream ends, or nothing comes any more.

        Raises
        ------
        InputError
            If a picture is not one of its camera, or the folder cannot be written.
        Cancelled
            If ``progress`` returns ``False``; the twin is written first.
        """
        self._count: Counter[str] = Counter()
        self._took: list[float] = []
        self._passed_over, self._written, self._unwritten = 0, -np.inf, False
        self._log: EventLog | None = None
        self._tracker = self._tracking()
        since = time.monotonic()
        try:
            while not self.stream.ended:
                report(self.progress, Progress("following", len(self._took), 0))
                self._go_on()
                began = time.perf_counter()
                moment = self.stream.next()
                if moment is not None:
                    since = time.monotonic()
                    self._follow(moment)
                    self._took.append(time.perf_counter() - began)
                elif self.idle is not None and time.monotonic() - since > self.idle:
                    break
                else:
                    time.sleep(POLL)
        finally:
            if self._unwritten:
                self._write()
            if self._log is not None:
                self._log.__exit__(None, None, None)
            self.stream.close()
        middle = float(np.median(self._took)) if self._took else 0.0
        return Summary(len(self._took), self._passed_over, dict(self._count), middle)

    def _tracking(self) -> Tracker:
        chosen = self.followed
        return Tracker(
            chosen.frame,
            self.cameras,
            chosen.twin,
            awaited=chosen.awaited,
            backgrounds=self.backgrounds,
            settings=self.settings,
            batch=chosen.batch,
        )

    def _follow(self, moment: Moment) -> None:
        tracked: Tracked = self._tracker.follow(moment.pictures, moment.time, moment.sources)
        self._passed_over += moment.passed_over
        self._unwritten = True
        if time.monotonic() - self._written >= self.write_every:
            self._write()
        for event in tracked.events:
            self._tell(replace(event, frame=len(self._took)))
        self._now = moment.time

    def _go_on(self) -> None:
        """Follow the next batch where the job has been answered."""
        job = self.followed.job
        if job is None or not self.followed.gone_on or job.current is None:
            return
        self.followed = of_job(job)
        self._tracker = self._tracking()
        if self._took:
            self._tell(Event("batch", self._now, len(self._took), {"batch": self.followed.batch}))

    def _tell(self, event: Event) -> None:
        self._count[event.kind] += 1
        self.say(event)
        if self._log is not None:
            self._log.add(event)

    def _write(self) -> None:
        if not self._tracker.has_followed:
            return
        live_run(self.out, self._tracker.result(), self.followed.frame)
        self._written, self._unwritten = time.monotonic(), False
        if self._log is None:
            self._log = EventLog(self.out / EVENTS_FILE)


def live_run(folder: Path, result: FitResult, frame: Wireframe) -> None:
    """Write a run folder that is read while it is written: each of its files is whole at any moment.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    if (folder / twin_files.FILE_NAME).is_file():
        _write_files(folder, result, frame)
        return
    with staged_directory(folder) as stage:
        _write_files(stage, result, frame)


def _write_files(folder: Path, result: FitResult, frame: Wireframe) -> None:
    write_frame(folder / "frame.json", frame)
    save_field(folder / FIELD_FILE, result.field)
    twin_files.write_twin(folder, result.twin)
