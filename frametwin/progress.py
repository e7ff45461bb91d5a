"""Progress and cancellation: a callback, never a print."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
