"""The worker's standard streams: lines in, events out, and nobody else between."""

from __future__ import annotations

import io
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from frametwin.worker.protocol import LONGEST_LINE, encode

CHUNK = 1 << 16


def take_standard_streams() -> tuple[int, int]:
    """Keep standard input and output for the protocol alone.

    Whatever libraries, compiled code and child processes read from then on is empty, and what they print to standard
    output goes to standard error.

    Returns
    -------
    Descriptors of requests and events, which child processes do not inherit.
    """
    requests, events = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    try:
        os.fstat(2)
    except OSError:
        os.dup2(nothing, 2)
    os.dup2(2, 1)
    os.close(nothing)
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False)  # noqa: SIM115 - for as long as the process lives
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(encoding="utf-8", errors="backslashreplace", line_buffering=True)
    sys.stdout = sys.stderr
    return requests, events


class TooLong(Exception):
    """A line that is longer than any request; it has been skipped."""


def read_lines(descriptor: int, longest: int = LONGEST_LINE) -> Iterator[bytes | TooLong]:
    """Lines without their ends, until the input does; a `TooLong` in place of one that is. Empty lines are skipped."""
    waiting = bytearray()
    skipping = False
    while chunk := _read(descriptor):
        start = len(waiting)
        waiting += chunk
        while (end := waiting.find(b"\n", start)) >= 0:
            line = bytes(waiting[:end]).strip()
            del waiting[: end + 1]
            start = 0
            if line and not skipping:
                yield line if len(line) <= longest else TooLong()
            skipping = False
        if len(waiting) > longest:
            if not skipping:
                yield TooLong()
            skipping = True
        if skipping:
            waiting.clear()
    if waiting.strip() and not skipping:
        yield bytes(waiting).strip()


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, CHUNK)
    except OSError:  # on Windows, a pipe whose other end is gone
        return b""


class EventWriter:
    """Writes events, whole and one after the other, from any thread.

    Parameters
    ----------
    descriptor
        Where to.
    broken
        Called once when nobody is listening any more.
    """

    def __init__(self, descriptor: int, broken: Callable[[], None]) -> None:
        self._descriptor, self._broken = descriptor, broken
        self._lock = threading.Lock()
        self._gone = False

    def send(self, event: Mapping[str, Any]) -> None:
        """Write one.

        Raises
        ------
        ValueError, TypeError
            See `frametwin.worker.protocol.encode`; then nothing has been written.
        """
        rest = memoryview(encode(event))
        with self._lock:
            if self._gone:
                return
            try:
                while rest:
                    rest = rest[os.write(self._descriptor, rest) :]
                return
            except OSError:
                self._gone = True
        self._broken()
