"""Calls with room on the interpreter's stack."""

from __future__ import annotations

import sys

import pytest

from frametwin.compiled.roomy_stack import with_room

CALLS = 1000


def divided(number: float, by: float = 1.0) -> float:
    return number / by


def faults_of_calls(depth: int) -> int:
    """Pages that the system had to give while a small function was called again and again, so deep in calls."""
    if depth:
        return faults_of_calls(depth - 1)
    resource = pytest.importorskip("resource", reason="page faults are counted on Unix alone")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(CALLS):
        divided(1.0)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


def test_what_a_function_returns_and_raises_comes_back() -> None:
    assert with_room(divided, 3.0, by=2.0) == 1.5
    with pytest.raises(ZeroDivisionError):
        with_room(divided, 1.0, by=0.0)


@pytest.mark.skipif(sys.implementation.name != "cpython", reason="it is about the stack of CPython")
def test_no_call_under_it_asks_the_system_for_memory_again_and_again() -> None:
    assert max(with_room(faults_of_calls, depth) for depth in range(200)) < CALLS / 10
