"""Cameras, or films, by OpenCV."""

from __future__ import annotations

import time
from collections.abc import Sequence

import cv2
import numpy as np

from frametwin.errors import InputError
from frametwin.tracking.moments import Moment


class CameraStream:
    """Moments of cameras that are grabbed together and decoded afterwards.

    Parameters
    ----------
    sources : sequence of str
        One for each camera of the rig, in its order: the number of a device, or what else OpenCV opens, such as the
        address of a network camera or a film.
    rate : float, Hz, optional
        How many moments a second there are; by default the clock tells, as it must with cameras.

    Raises
    ------
    InputError
        If one of them cannot be opened.
    """

    def __init__(self, sources: Sequence[str], rate: float | None = None) -> None:
        self._rate, self._taken, self._ended = rate, 0, False
        self._began = time.monotonic()
        self._captures: list[cv2.VideoCapture] = []
        self._sources = tuple(sources)
        for source in sources:
            capture = cv2.VideoCapture(int(source) if source.isdecimal() else source)
            self._captures.append(capture)
            if not capture.isOpened():
                self.close()
                remedy = "give the number of a device that is plugged in, or an address or film that OpenCV can open"
                raise InputError.at(source, "camera", "cannot be opened", remedy)
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # old pictures are of no use

    @property
    def ended(self) -> bool:
        """Whether all films are over."""
        return self._ended

    def next(self) -> Moment | None:
        """What the cameras see now; ``None`` where none of them gives anything any more."""
        there = [capture.grab() for capture in self._captures]
        now = time.monotonic() - self._began if self._rate is None else self._taken / self._rate
        pictures = [_picture(capture) if ok else None for capture, ok in zip(self._captures, there, strict=True)]
        if all(picture is None for picture in pictures):
            self._ended = True
            return None
        self._taken += 1
        return Moment(f"{self._taken - 1:06d}", now, pictures, sources=self._sources)

    def close(self) -> None:
        """Let go of the cameras."""
        for capture in self._captures:
            capture.release()


def _picture(capture: cv2.VideoCapture) -> np.ndarray | None:
    ok, picture = capture.retrieve()
    return np.asarray(picture) if ok else None
