"""How a command's process deals with memory that it has freed."""

from __future__ import annotations

import contextlib
import ctypes
import sys

LARGEST = 32 * 2**20
"""Bytes of the largest block that is kept; larger ones glibc always gives back."""

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # as in malloc.h


def keep_freed_memory() -> None:
    """Keep what is freed at hand, where glibc is: a fit asks for the same few pictures again and again.

    Given back, every page of them would be fetched and cleared by the system anew, a tenth of the time of a fit. The
    most that the process ever takes stays the same.
    """
    if not sys.platform.startswith("linux"):
        return
    with contextlib.suppress(OSError, AttributeError):  # another library of C, which has no such setting
        library = ctypes.CDLL(None)
        library.mallopt(_MMAP_THRESHOLD, LARGEST)
        library.mallopt(_TRIM_THRESHOLD, 2**31 - 1)
