"""What a stream gives: the pictures of one moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True, eq=False)
class Moment:
    """The pictures of one moment.

    Attributes
    ----------
    name : str
        By which the stream knows it.
    time : float, s
        When they were taken, by the stream's clock.
    pictures : sequence of (H, W) or (H, W, 3) array of uint8 or None
        One a camera; ``None`` where it gave none.
    passed_over : int
        Moments since the last one that came too fast to be looked at.
    sources : sequence of str
        What each picture is called where something is wrong with it; none where the cameras' names serve.
    """

    name: str
    time: float
    pictures: Sequence[np.ndarray | None]
    passed_over: int = 0
    sources: Sequence[str] = ()


class Stream(Protocol):
    """Where pictures come from."""

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        ...

    def next(self) -> Moment | None:
        """The next moment, if there is one yet."""
        ...

    def close(self) -> None:
        """Let go of cameras."""
        ...
