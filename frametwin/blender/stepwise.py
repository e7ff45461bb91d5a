"""Work in small steps, for a timer that may not hold the interface, or all at once."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

Value = TypeVar("Value")


def run_steps(steps: Generator[None, None, Value]) -> Value:
    """Do all steps; gives what they return."""
    while True:
        try:
            next(steps)
        except StopIteration as done:
            result: Value = done.value
            return result
