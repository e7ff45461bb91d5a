"""Events on their way from the reading thread to whoever wants them, without piling up."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic
from typing import Any

Event = dict[str, Any]


class EventQueue:
    """First in, first out; but of progress and of curves only the newest of each stage waits.

    Whoever does not look for a while (a program that renders) finds no heap of outdated curves.
    """

    def __init__(self) -> None:
        self._events: list[Event] = []
        self._changed = threading.Condition()

    def put(self, event: Event) -> None:
        """Add an event."""
        with self._changed:
            key = _replaceable(event)
            if key is not None:
                self._events = [old for old in self._events if _replaceable(old) != key]
            self._events.append(event)
            self._changed.notify_all()

    def take(self, limit: int) -> list[Event]:
        """The oldest events, at most ``limit``, without waiting."""
        with self._changed:
            taken, self._events = self._events[:limit], self._events[limit:]
            return taken

    def wait_for(self, wanted: Callable[[Event], bool], timeout: float | None = None) -> Event | None:
        """The oldest event that is wanted, the others left alone; ``None`` when the seconds have passed."""
        deadline = None if timeout is None else monotonic() + timeout
        with self._changed:
            while True:
                for i, event in enumerate(self._events):
                    if wanted(event):
                        return self._events.pop(i)
                left = None if deadline is None else deadline - monotonic()
                if left is not None and left <= 0.0:
                    return None
                # In slices: Windows hears no Ctrl-C during an endless wait.
                self._changed.wait(0.5 if left is None else min(left, 0.5))

    def drop(self, unwanted: Callable[[Event], bool]) -> None:
        """Remove events."""
        with self._changed:
            self._events = [event for event in self._events if not unwanted(event)]


def _replaceable(event: Event) -> tuple[Any, ...] | None:
    """What newer event may take this one's place, if any."""
    if event.get("event") not in ("progress", "curves"):
        return None
    return event["event"], event.get("id"), event.get("stage")
