"""Ctrl-C and the signals that ask a process to end: once seen, they are not forgotten."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

_seen = threading.Event()


def requested() -> bool:
    """Whether the user has asked to stop.

    Libraries sometimes swallow the exception that a signal raises; long work asks here as well.
    """
    return _seen.is_set()


def _stop(number: int, frame: FrameType | None) -> None:
    _seen.set()
    raise KeyboardInterrupt


@contextlib.contextmanager
def handled() -> Iterator[None]:
    """Let the signals that ask to stop raise `KeyboardInterrupt` while the block runs."""
    _seen.clear()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK"):
            number = getattr(signal, name, None)
            # A signal that whoever started this process wants ignored, as nohup does, stays ignored.
            if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, _stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
