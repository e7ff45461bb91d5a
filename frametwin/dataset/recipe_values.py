"""Kinds of values that recipes hold: numbers or ranges of them, each within its limits."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field


class Refused(ValueError):
    """A value that cannot be: what to do, and what is wrong where the value itself does not say it."""

    def __init__(self, remedy: str, problem: str = "") -> None:
        super().__init__(f"{problem}: {remedy}" if problem else remedy)
        self.remedy, self.problem = remedy, problem


def _pair(value: Any) -> Any:
    """A single number is the range from it to itself."""
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _rising(value: tuple[float, float]) -> tuple[float, float]:
    if not (math.isfinite(value[0]) and math.isfinite(value[1]) and value[0] <= value[1]):
        raise Refused("give a number, or two rising ones as [low, high]")
    return value


def limits(low: float, high: float) -> Any:
    """Numbers from ``low`` to ``high``."""

    def check(value: tuple[float, float]) -> tuple[float, float]:
        if not (low <= value[0] and value[1] <= high):
            raise Refused(f"give numbers from {low:g} to {high:g}")
        return value

    return AfterValidator(check)


Range = Annotated[tuple[float, float], BeforeValidator(_pair), AfterValidator(_rising)]
Share = Annotated[Range, limits(0.0, 1.0)]
Count = Annotated[
    tuple[
        Annotated[int, Field(ge=0, le=1_000_000, strict=True)], Annotated[int, Field(ge=0, le=1_000_000, strict=True)]
    ],
    BeforeValidator(_pair),
    AfterValidator(_rising),
]
Millimetres = Annotated[Range, limits(0.0, 1e4)]
Degrees = Annotated[Range, limits(-360.0, 360.0)]
Side = Annotated[int, Field(ge=8, le=16384, strict=True)]
Weight = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Table(BaseModel):
    """A table of the file: unknown keys and values of another kind are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
