"""How far a job is, as a whole and in its present stage, and how it ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from frametwin.wording import duration_text

SHOWN = 0.02
"""Share of a job for reading and showing its result."""

EARLY = 0.02
"""Share of a job before which nothing is said of the time left."""


@dataclass
class Status:
    """What there is to tell of the present job, or of the last one.

    Attributes
    ----------
    title
        Of the job.
    stage, iteration, total, loss
        As in `frametwin.progress.Progress`.
    stages, part
        As in `frametwin.blender.background.runner.Job`.
    error, message
        Whether the last job failed, and how it ended, in words; empty while one runs.
    cancelled
        Whether it was the user who ended it.
    overall
        How much of the whole job is done, 0..1; never goes back. Stages that are not among ``stages`` belong to the one
        before them; without ``stages`` the job has but one.
    """

    title: str = ""
    stage: str = ""
    stages: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    part: tuple[int, int] = (0, 1)
    iteration: int = 0
    total: int = 0
    loss: float | None = None
    error: bool = False
    cancelled: bool = False
    message: str = ""
    overall: float = 0.0
    _began: float = field(default_factory=perf_counter)

    @classmethod
    def of(
        cls, title: str, stage: str, stages: Mapping[str, tuple[float, float]], part: tuple[int, int], before: Status
    ) -> Status:
        """That of a job that begins; one that follows another goes on where that has ended."""
        made = cls(title, stage, stages, part)
        if part[0] > 0:
            made._began, made.overall = before._began, part[0] / part[1]
        return made

    @property
    def share(self) -> float:
        """How much of the stage is done, 0..1."""
        return min(1.0, self.iteration / self.total) if self.total else 0.0

    @property
    def seconds_left(self) -> float | None:
        """Of the whole job, as it goes; ``None`` where nothing can be said yet."""
        if self.overall < EARLY:
            return None
        return (perf_counter() - self._began) * (1.0 / self.overall - 1.0)

    @property
    def line(self) -> str:
        """One line about the stage: what it is, steps, loss, and the time left of the whole job."""
        words = [self.stage or "starting"]
        if self.total:
            words.append(f"{self.iteration}/{self.total}")
        if self.loss is not None:
            words.append(f"loss {self.loss:.2g}")
        return ", ".join([*words, *self._left()])

    @property
    def overall_line(self) -> str:
        """One line about the whole job: what is being done, how much of it is, the time left."""
        words = [f"{self.title}: {self.stage or 'starting'}"]
        if self.overall > 0.0:
            words.append(f"{100.0 * self.overall:.0f} %")
        return ", ".join([*words, *self._left()])

    def step(self, event: Mapping[str, Any]) -> None:
        """Take over an event of progress."""
        self.stage, self.iteration, self.total = event["stage"], event["iteration"], event["total"]
        self.loss = event["loss"]
        known = self.stages or {self.stage: (0.0, 1.0)}
        if self.stage in known:
            begin, end = known[self.stage]
            self._reach((1.0 - SHOWN) * (begin + (end - begin) * self.share))

    def result(self, stage: str) -> None:
        """The result is there and is being read or shown."""
        self.stage, self.iteration, self.total, self.loss = stage, 0, 0, None
        self._reach(1.0 - SHOWN)

    def end(self, message: str, error: bool = False, cancelled: bool = False) -> None:
        """The job has ended."""
        self.message, self.error, self.cancelled, self.stage = message, error, cancelled, ""

    def _reach(self, done: float) -> None:
        self.overall = max(self.overall, (self.part[0] + done) / self.part[1])

    def _left(self) -> list[str]:
        left = self.seconds_left
        return [] if left is None or left < 1.0 else [f"{duration_text(left)} left"]
