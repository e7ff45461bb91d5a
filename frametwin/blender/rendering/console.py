"""Keeping Blender's chatter out of the streams that programs read."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator


@contextlib.contextmanager
def quiet_console() -> Iterator[None]:
    """Send what Blender itself writes to standard output and standard error to nowhere.

    It writes with the C library, past Python's streams: the file descriptors are what must be redirected, and the
    C library's own buffer emptied before they come back. If the block fails, its last words are added to the error.
    """
    with contextlib.ExitStack() as stack:
        log = stack.enter_context(tempfile.TemporaryFile())
        _flush()
        for descriptor in (1, 2):
            try:
                saved = os.dup(descriptor)
            except OSError:  # a program with a window need not have the stream
                continue
            stack.callback(_restore, saved, descriptor)
            os.dup2(log.fileno(), descriptor)
        try:
            yield
        except Exception as error:
            _flush()
            words = last_words(log.fileno())
            if words:
                error.add_note(f"Blender said: {words}")
            raise


def last_words(descriptor: int, length: int = 2000) -> str:
    """The end of an open file as text, without changing where it is written next."""
    end = os.lseek(descriptor, 0, os.SEEK_CUR)
    os.lseek(descriptor, max(0, end - length), os.SEEK_SET)
    text = os.read(descriptor, length)
    os.lseek(descriptor, end, os.SEEK_SET)
    return text.decode("utf-8", errors="replace").strip()


def _restore(saved: int, descriptor: int) -> None:
    _flush()
    os.dup2(saved, descriptor)
    os.close(saved)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # closed, or none at all
            stream.flush()
    with contextlib.suppress(AttributeError, OSError):
        library = ctypes.cdll.ucrtbase if sys.platform == "win32" else ctypes.CDLL(None)
        library.fflush(None)
