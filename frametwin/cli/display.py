"""Progress on standard error: a bar on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import os
import sys
import threading
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING

import click

from frametwin.cli import interrupts
from frametwin.progress import Progress

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

PAUSE = 2.0
"""Seconds between lines of one stage, where there is no terminal."""

PATIENCE = 5.0
"""Seconds of silence between two stages after which a word is said about it."""

HINT = "Still working: the first run on a machine compiles what it needs, which can take a minute."


class Display:
    """A progress callback that shows stage, iteration, loss and time left, and stops when the user wants it.

    Use it as a context manager. With ``quiet`` it shows nothing, but still stops.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._show = None if quiet else (_Bar() if _is_terminal() else _Lines())
        self._timer: threading.Timer | None = None
        self._hinted = False

    def __enter__(self) -> Display:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop_timer()
        if self._show is not None:
            self._show.close()

    def __call__(self, progress: Progress) -> bool:
        """Show a report; ``False`` when the user has asked to stop."""
        if interrupts.requested():
            return False
        self._stop_timer()
        if self._show is not None:
            self._show.update(progress)
            if progress.iteration in (0, progress.total) and not self._hinted:
                self._timer = threading.Timer(PATIENCE, self._hint)
                self._timer.daemon = True
                self._timer.start()
        return True

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _hint(self) -> None:
        self._hinted = True
        if self._show is not None:
            self._show.say(HINT)


def _is_terminal() -> bool:
    return sys.stderr.isatty() and os.environ.get("TERM", "") != "dumb"


def _loss(progress: Progress) -> str:
    return "" if progress.loss is None else f"loss {progress.loss:.4g}"


class _Clock:
    """Time left, from the mean pace since the present count began. Stages that count on share one count."""

    def __init__(self) -> None:
        self.total, self.last = -1, -1
        self.began = self.first = 0.0

    def restarts(self, progress: Progress) -> bool:
        """Note a report; whether a new count begins with it."""
        new = progress.total != self.total or progress.iteration < self.last
        if new:
            self.began, self.first = perf_counter(), float(progress.iteration)
        self.total, self.last = progress.total, progress.iteration
        return new

    def left(self) -> str:
        """Seconds left, as text; empty as long as nothing can be said."""
        done, rest = self.last - self.first, self.total - self.last
        if done <= 0.0 or rest <= 0:
            return ""
        seconds = (perf_counter() - self.began) / done * rest
        if seconds < 1.0:
            return ""
        return f"{seconds:.0f} s left" if seconds < 100.0 else f"{seconds / 60.0:.0f} min left"


class _Lines:
    """Lines of text: one when a stage begins, one when it ends, and one every few seconds."""

    def __init__(self) -> None:
        self.clock, self.stage, self.shown = _Clock(), "", 0.0
        self.whole = False  # whether the last report had its count full
        self.kept: Progress | None = None  # the last report, if it was not shown

    def update(self, progress: Progress) -> None:
        if progress.stage != self.stage:
            self.close()
        self.clock.restarts(progress)
        whole = progress.total > 0 and progress.iteration >= progress.total
        same, self.whole = progress.stage == self.stage and whole <= self.whole, whole
        if same and perf_counter() - self.shown < PAUSE:
            self.kept = progress
            return
        self._write(progress)

    def _write(self, progress: Progress) -> None:
        self.stage, self.shown, self.kept = progress.stage, perf_counter(), None
        count = f"{progress.iteration}/{progress.total}" if progress.total else f"{progress.iteration}"
        details = ", ".join(text for text in (_loss(progress), self.clock.left()) if text)
        click.echo(f"{progress.stage} {count}" + (f" ({details})" if details else ""), err=True)

    def say(self, sentence: str) -> None:
        """Show a sentence."""
        click.echo(sentence, err=True)

    def close(self) -> None:
        """Show the end of a stage that stopped before its count was full."""
        if self.kept is not None:
            self._write(self.kept)


class _Bar:
    """One bar of the present count."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn
        from rich.progress import Progress as RichProgress

        self.clock = _Clock()
        self.bars: Bars = RichProgress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[loss]}"),
            TextColumn("{task.fields[left]}"),
            console=Console(stderr=True),
            transient=True,
        )
        self.task: TaskID | None = None
        self.bars.start()

    def update(self, progress: Progress) -> None:
        if self.clock.restarts(progress) and self.task is not None:
            self.bars.remove_task(self.task)
            self.task = None
        total = progress.total or None
        if self.task is None:
            self.task = self.bars.add_task(progress.stage, total=total, loss="", left="")
        self.bars.update(
            self.task,
            description=progress.stage,
            completed=progress.iteration,
            total=total,
            loss=_loss(progress),
            left=self.clock.left(),
        )

    def say(self, sentence: str) -> None:
        """Show a sentence above the bar."""
        self.bars.console.print(sentence, markup=False, highlight=False)

    def close(self) -> None:
        """Remove the bar."""
        self.bars.stop()
