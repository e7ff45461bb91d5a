"""Ctrl-C and the signals that ask a process to end: once seen, they are not forgotten."""

from __future__ import annotations

import signal
import sys
import threading
from time import perf_counter
from types import FrameType
from typing import Any

IMPATIENCE = 3.0
"""Seconds in which a further signal is taken for the same wish, while the first one is being obeyed."""

_seen = threading.Event()
_when = 0.0


_caught: list[signal.Signals] = []


def requested() -> bool:
    """Whether the user has asked to stop.

    Libraries sometimes swallow the exception that a signal raises; long work asks here as well.
    """
    return _seen.is_set()


def install() -> None:
    """Let the signals that ask to stop raise `KeyboardInterrupt`, for the rest of the process."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        # A signal that whoever started this process wants ignored, as nohup does, stays ignored.
        if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, _stop)
            _caught.append(number)
    report = sys.unraisablehook

    def quiet(unraisable: Any) -> None:
        # A compiled library was at work in a callback when the signal came; the wish has been noted.
        if not (requested() and issubclass(unraisable.exc_type, KeyboardInterrupt)):
            report(unraisable)

    sys.unraisablehook = quiet


def ignore() -> None:
    """Let nothing disturb the end of the process: its exit code is settled."""
    for number in _caught:
        signal.signal(number, signal.SIG_IGN)


def _stop(number: int, frame: FrameType | None) -> None:
    global _when
    if _seen.is_set() and perf_counter() - _when < IMPATIENCE:
        return  # a second Ctrl-C must not stop the first one from tidying up
    _when = perf_counter()
    _seen.set()
    raise KeyboardInterrupt
