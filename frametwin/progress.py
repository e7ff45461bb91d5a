"""Progress and cancellation: a callback, never a print."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

from frametwin.errors import Cancelled

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Progress:
    """One report of a long piece of work.

    Attributes
    ----------
    stage
        What is being done, such as ``"reading images"``.
    iteration, total
        Steps done so far in this stage and steps in all; ``total`` is 0 where it is not known.
    loss
        The present loss, where there is one.
    control_points
        (E, 4, 3) the present curves in mm, where there are any.
    """

    stage: str
    iteration: int
    total: int
    loss: float | None = None
    control_points: np.ndarray | None = None


ProgressCallback = Callable[[Progress], bool | None]
"""Called with each `Progress`; returning ``False`` (and nothing else) stops the work."""


def report(callback: ProgressCallback | None, progress: Progress) -> None:
    """Hand ``progress`` to ``callback``.

    Raises
    ------
    Cancelled
        If the callback returns ``False``; ``None`` and ``True`` mean to go on.
    """
    if callback is not None and callback(progress) is False:
        raise Cancelled(f"stopped during {progress.stage} at step {progress.iteration} of {progress.total}")


class ProgressLines:
    """Progress as lines of text, for scripts: one when a stage begins, and one every few seconds.

    Parameters
    ----------
    write
        Gets each line.
    prefix
        What every line begins with.
    """

    PAUSE = 2.0
    """Seconds between two lines about one stage."""

    def __init__(self, write: Callable[[str], object], prefix: str = "") -> None:
        self._write, self._prefix, self._stage, self._shown = write, prefix, "", 0.0

    def __call__(self, progress: Progress) -> None:
        if progress.stage == self._stage and perf_counter() - self._shown < self.PAUSE:
            return
        self._stage, self._shown = progress.stage, perf_counter()
        count = f" {progress.iteration}/{progress.total}" if progress.total else ""
        self._write(f"{self._prefix}{progress.stage}{count}")
