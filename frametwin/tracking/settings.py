"""Settings of a twin that follows a stream of pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from frametwin.fitting.changes import Changeable
from frametwin.fitting.fast_settings import Stage
from frametwin.ranges import above, check_settings, some, within

Millimetres = Annotated[float, above(0.0, up_to=1e6, noun="millimetres")]
Seconds = Annotated[float, within(0.0, 60.0, "seconds")]
Stages = Annotated[tuple[Stage, ...], some("one stage or more")]


@dataclass(frozen=True, kw_only=True)
class TrackSettings(Changeable):
    """How a twin follows its pictures, and what is told of.

    Attributes
    ----------
    threshold : float, mm
        By how much a joint must have moved since it was last told of.
    patience : float, s
        How long a strut must be dark, or a joint be elsewhere, before it is told. A single disturbed picture says
        nothing.
    settle : float, s
        How long no view may show anything but the print, before the arm counts as gone.
    follow : tuple of Stage
        Steps of every picture; they reach as far as a joint moves from one picture to the next.
    search : tuple of Stage
        Blurred steps that go before, where struts are not found any more.
    finish : tuple of Stage
        Last steps of every picture, from those views and pixels alone that agree with the rest.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    threshold: Millimetres = 1.0
    patience: Seconds = 0.4
    settle: Seconds = 0.5
    follow: Stages = (Stage(detail=1.8, blur=0.7, iterations=2, pieces=6, pull=0.01, drag=0.12, longest=1.5),)
    search: Stages = (
        Stage(detail=0.9, blur=1.5, iterations=4, pieces=4, pull=0.01, drag=0.4),
        Stage(detail=0.9, blur=0.7, iterations=3, pieces=4, pull=0.01, drag=0.12),
        Stage(detail=1.8, blur=0.7, iterations=2, pieces=6, pull=0.01, drag=0.12, longest=1.5),
    )
    finish: Stages = (
        Stage(detail=3.6, blur=0.4, iterations=1, pieces=8, pull=0.005, drag=0.08, longest=1.5, share=0.8),
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def finest(self) -> float:
        """Largest apparent radius in pixels of the typical strut that any stage looks at."""
        return max(stage.detail for stage in (*self.follow, *self.search, *self.finish))
