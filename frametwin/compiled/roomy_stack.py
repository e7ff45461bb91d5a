"""Calls with room for all that they call in turn on the interpreter's stack.

CPython keeps the frames of calls in chunks of 16 kB. Where a chunk ends, a call asks the system for another one and its
return gives it back (``_PyThreadState_PushFrame`` in CPython's ``Python/pystate.c``). What calls a small function again
and again from there does little else. Compilers, deep in calls for minutes, come past such places: without this, the
first fit in Python 3.11 spent 33 of 114 processor seconds in the system. A call that asks for much room gets a chunk in
which all that it calls has its frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

ROOM = 1 << 17
"""Slots of eight bytes: 1 MB, which the chunk of the call is made twice as large for."""


def with_room(function: Callable[P, R], *args: P.args, **named: P.kwargs) -> R:
    """What a function returns, or raises, when it is called with room on the stack."""
    return function(*args, **named)


with_room.__code__ = with_room.__code__.replace(co_stacksize=ROOM)
