"""What the colours of struts mean: maps from low to high, states that have a colour of their own, and the legend."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache

import numpy as np

BINS = 32
"""Stops of a colour map; between them it is linear in scene-linear light."""

SEQUENTIAL, DIVERGING, GREY = "Blue to Yellow", "Purple to Green", "Black to White"
MAPS = (SEQUENTIAL, DIVERGING, GREY)
"""Names of the colour maps, from good to bad (`DIVERGING`: from far below to far above)."""

MISSING_COLOUR = (0.9, 0.02, 0.05)
UNKNOWN_COLOUR = (0.2, 0.2, 0.2)
PLAN_COLOUR = (0.72, 0.55, 0.42)


class State(IntEnum):
    """What a strut is, apart from what was measured of it: number of the attribute ``state``."""

    PRINTED = 0
    UNPRINTED = 1
    NEXT = 2
    MISSED = 3
    LOST = 4
    ADAPTED = 5
    PLAN = 6


@dataclass(frozen=True)
class Look:
    """How struts of a state are shown: words of the legend, scene-linear colour, and share of the radius drawn."""

    words: str
    colour: tuple[float, float, float]
    radius: float


LOOKS = {
    State.PRINTED: Look("printed", UNKNOWN_COLOUR, 1.0),  # the colour of those without a value
    State.UNPRINTED: Look("still to print", (0.2, 0.24, 0.3), 0.35),
    State.NEXT: Look("still to print, adapted", (0.1, 0.6, 0.2), 0.35),
    State.MISSED: Look("would have missed", (0.85, 0.03, 0.6), 0.6),
    State.LOST: Look("lost", (0.25, 0.02, 0.02), 0.6),
    State.ADAPTED: Look("still to print, adapted", (0.1, 0.6, 0.2), 1.0),
    State.PLAN: Look("plan", PLAN_COLOUR, 0.2),
}
"""By state; none of the colours is on a map."""


@dataclass(frozen=True, eq=False)
class Legend:
    """What the colours mean.

    Attributes
    ----------
    quantity
        Its key.
    unit
        Of the range.
    low, high
        Ends of the range.
    colours
        (BINS, 3) scene-linear, from the good end to the bad one.
    automatic
        Whether the range is that of the values.
    falling
        Whether the good end is the high one.
    colour_map
        One of `MAPS`.
    """

    quantity: str
    unit: str
    low: float
    high: float
    colours: np.ndarray
    automatic: bool = False
    falling: bool = False
    colour_map: str = SEQUENTIAL

    @property
    def ends(self) -> tuple[float, float]:
        """The values of the first and of the last colour."""
        return (self.high, self.low) if self.falling else (self.low, self.high)

    def colour_of(self, values: np.ndarray) -> np.ndarray:
        """(..., 3) scene-linear colours of values (...,); of NaN, that of what has no value."""
        first, last = self.ends
        place = np.clip((np.nan_to_num(values) - first) / (last - first), 0.0, 1.0) * (BINS - 1)
        shown = np.stack([np.interp(place, np.arange(BINS), self.colours[:, i]) for i in range(3)], axis=-1)
        return np.where(np.isnan(values)[..., None], UNKNOWN_COLOUR, shown)


@cache
def colour_map(name: str = SEQUENTIAL) -> np.ndarray:
    """(BINS, 3) scene-linear colours in even steps of Oklab (B. Ottosson, 2020); read-only.

    Raises
    ------
    KeyError
        If there is no such map.
    """
    t = np.linspace(0.0, 1.0, BINS)
    colours = {SEQUENTIAL: _sequential, DIVERGING: _diverging, GREY: _grey}[name](t)
    colours.setflags(write=False)
    return colours


def _sequential(t: np.ndarray) -> np.ndarray:
    """From dark blue to light yellow."""
    hue = np.radians(280.0 - 175.0 * t)
    return _linear(0.45 + 0.45 * t, 0.1 * np.cos(hue), 0.1 * np.sin(hue))


def _diverging(t: np.ndarray) -> np.ndarray:
    """From purple over a light grey to green, both ends equally dark."""
    side = np.abs(2.0 * t - 1.0)
    hue = np.radians(np.where(t < 0.5, 305.0, 145.0))
    return _linear(0.92 - 0.42 * side, 0.12 * side * np.cos(hue), 0.12 * side * np.sin(hue))


def _grey(t: np.ndarray) -> np.ndarray:
    """From a dark grey to white."""
    return _linear(0.3 + 0.65 * t, 0.0 * t, 0.0 * t)


def _linear(lightness: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scene-linear RGB of Oklab."""
    to_lms = np.array(
        [[1, 0.3963377774, 0.2158037573], [1, -0.1055613458, -0.0638541728], [1, -0.0894841775, -1.291485548]]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.707614701],
        ]
    )
    return np.clip((np.stack([lightness, a, b], axis=1) @ to_lms.T) ** 3 @ to_rgb.T, 0.0, 1.0)
