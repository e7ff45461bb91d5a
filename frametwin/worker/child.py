"""A child process that is spoken to in JSON lines: its pipes, its last words and its end."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from time import monotonic
from typing import IO, Any

from frametwin.worker.event_queue import Event
from frametwin.worker.protocol import LONGEST_LINE, ProtocolError, decode, encode
from frametwin.worker.streams import TooLong, read_lines

LINES_KEPT = 50


class Child:
    """A process and the three threads that read and write its pipes.

    Parameters
    ----------
    command
        Program and arguments.
    cwd, environment
        Its working folder and all of its environment variables.
    hear
        Called with every event, from a thread.
    gone
        Called once when the process has ended and all of its events have been heard, from a thread, with the
        `obituary`.

    Raises
    ------
    OSError, ValueError
        If it cannot be started.
    """

    def __init__(
        self,
        command: Sequence[str],
        cwd: str | os.PathLike[str] | None,
        environment: Mapping[str, str],
        hear: Callable[[Event], None],
        gone: Callable[[str], None],
    ) -> None:
        self._hear, self._gone = hear, gone
        self._words: deque[str] = deque(maxlen=LINES_KEPT)
        self._outgoing: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._owner = os.getpid()
        options: dict[str, Any] = {}
        if os.name == "nt":
            options["creationflags"] = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        self.process = subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            cwd=cwd,
            env=dict(environment),
            **options,
        )
        self._listeners = [
            threading.Thread(target=self._hear_words, name="worker's words", daemon=True),
            threading.Thread(target=self._hear_events, name="worker's events", daemon=True),
        ]
        for thread in (*self._listeners, threading.Thread(target=self._write, name="worker's requests", daemon=True)):
            thread.start()

    @property
    def running(self) -> bool:
        """Whether the process has not ended."""
        return self.process.poll() is None

    @property
    def last_words(self) -> str:
        """The last lines that it wrote to standard error, or that were no events."""
        return "\n".join(self._words)

    def send(self, message: Mapping[str, Any]) -> None:
        """Send a message; never waits.

        Raises
        ------
        ValueError, TypeError
            See `frametwin.worker.protocol.encode`.
        """
        self._outgoing.put(encode(message))

    def end(self, farewell: Mapping[str, Any], timeout: float) -> None:
        """Say farewell and close its input, then terminate it, then kill it: gone after about ``timeout`` seconds."""
        if self._owner != os.getpid():
            return  # a fork of the process that started it
        self.send(farewell)
        self._outgoing.put(None)
        for share, push in ((0.7, self.process.terminate), (0.2, self.process.kill)):
            if self._ended(share * timeout):
                break
            with contextlib.suppress(OSError):
                push()
        self._ended(5.0)
        deadline = monotonic() + 0.2
        for thread in self._listeners:
            if thread is not threading.current_thread():
                thread.join(max(0.0, deadline - monotonic()))

    def obituary(self) -> str:
        """How it ended, and what it said last, in one line."""
        words = " / ".join(line.strip() for line in list(self._words)[-3:] if line.strip())
        return f"{_end_of(self.process.poll())}{f', its last words: {words}' if words else ', without a word'}"

    def _ended(self, timeout: float) -> bool:
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def _write(self) -> None:
        assert self.process.stdin is not None
        with contextlib.suppress(OSError, ValueError), self.process.stdin as stream:
            while (line := self._outgoing.get()) is not None:
                rest = memoryview(line)
                while rest:
                    rest = rest[stream.write(rest) :]

    def _hear_events(self) -> None:
        for line in _lines(self.process.stdout):
            try:
                event = decode(line)
                if not isinstance(event.get("event"), str):
                    raise ProtocolError("the line is no event")
            except ProtocolError:
                self._words.append(line.decode("utf-8", "replace"))
                continue
            self._hear(event)
        self.process.wait()
        self._listeners[0].join(1.0)  # the last words may still be on their way
        self._gone(self.obituary())

    def _hear_words(self) -> None:
        for line in _lines(self.process.stderr):
            self._words.append(line.decode("utf-8", "replace").rstrip())


def _lines(stream: IO[bytes] | None) -> Iterator[bytes]:
    assert stream is not None
    with stream:
        for line in read_lines(stream.fileno(), 4 * LONGEST_LINE):
            if not isinstance(line, TooLong):
                yield line


def _end_of(code: int | None) -> str:
    if code is None:
        return "ended"
    if code >= 0:
        return f"ended with the exit code {code if code < 1 << 16 else hex(code)}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"was killed ({name})"
