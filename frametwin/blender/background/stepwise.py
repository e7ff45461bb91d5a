"""Work in small steps, for a timer that may not hold the interface, or all at once."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeVar

Value = TypeVar("Value")

TURN = "turn"
"""Yielded in the place of nothing where Blender is to have its turn, to evaluate the scene, before the next step."""


def run_steps(steps: Generator[Any, None, Value]) -> Value:
    """Do all steps; gives what they return."""
    while True:
        try:
            next(steps)
        except StopIteration as done:
            result: Value = done.value
            return result
