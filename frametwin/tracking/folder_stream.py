"""A folder into which pictures drop."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from frametwin.capture.image_files import image_size, read_image_bytes
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.imaging.decoding import decoded, eight_bits
from frametwin.tracking.moments import Moment
from frametwin.wording import name_order

SUFFIXES = (".png", ".jpg", ".jpeg")
SEPARATORS = "-_."
NO_MOMENTS = ("background",)
"""Folders beside the pictures that are none of them."""

GRACE = 1.0
"""Seconds after its first picture from which a moment is taken without those that are still missing."""

WORKERS = 2


class FolderStream:
    """Moments out of a folder, in the order of their names; numbers in them count as such: 9 comes before 10.

    Pictures of one moment carry its name and their cameras': ``0007/left.png``, ``left/0007.png``, ``left-0007.png`` or
    ``0007-left.png``. A picture that is still growing is waited for.

    Parameters
    ----------
    folder : path
    names : sequence of str
        Of the cameras.
    every : bool
        Take every moment, however late; by default the newest, as somebody does who wants to know how things are.
    rate : float, Hz, optional
        How many moments a second there are; by default the times of the files tell.

    Raises
    ------
    InputError
        If there is no such folder.
    """

    def __init__(self, folder: PathLike, names: Sequence[str], every: bool = False, rate: float | None = None) -> None:
        self.folder, self.names = Path(folder), tuple(names)
        if not self.folder.is_dir():
            raise InputError.at(folder, "folder", "does not exist", "make the folder into which pictures are put")
        self._every, self._rate = every, rate
        self._last = ""  # the name of the last moment; names rise
        # A name that begins or ends with another's is looked for before that.
        self._longest_first = sorted(self.names, key=len, reverse=True)
        self._first_seen: dict[str, float] = {}
        self._taken = 0
        self._pool = ThreadPoolExecutor(WORKERS)

    @property
    def ended(self) -> bool:
        """Never: more may come."""
        return False

    def next(self) -> Moment | None:
        """The next moment that is complete, or that has waited long enough for its last pictures."""
        waiting, now = self._waiting(), time.monotonic()
        for name in waiting:
            self._first_seen.setdefault(name, now)
        for name in sorted(waiting, key=name_order, reverse=not self._every):
            files = waiting[name]
            late = now - self._first_seen[name] > GRACE
            if len(files) < len(self.names) and not late:
                if self._every:
                    return None  # its turn comes first
                continue
            pictures = list(self._pool.map(self._read, [files.get(camera) for camera in self.names]))
            if not late and any(picture is None for picture in pictures):
                if self._every:
                    return None
                continue
            order = name_order(name)
            passed_over = sum(name_order(other) < order for other in waiting)
            return self._moment(name, pictures, files, passed_over)
        return None

    def close(self) -> None:
        """Let go of the threads."""
        self._pool.shutdown(wait=False)

    def _moment(self, name: str, pictures: list[np.ndarray | None], files: dict[str, Path], passed_over: int) -> Moment:
        self._last, self._taken, order = name, self._taken + 1 + passed_over, name_order(name)
        self._first_seen = {other: self._first_seen[other] for other in self._first_seen if name_order(other) > order}
        when = _latest(files.values()) if self._rate is None else (self._taken - 1) / self._rate
        sources = [str(files.get(camera, camera)) for camera in self.names]
        return Moment(name, when, pictures, passed_over, sources)

    def _waiting(self) -> dict[str, dict[str, Path]]:
        """Files by moment and camera, of moments after the last."""
        found: dict[str, dict[str, Path]] = {}
        last = name_order(self._last)
        for moment, camera, path in self._files():
            if name_order(moment) > last:
                found.setdefault(moment, {})[camera] = path
        return found

    def _files(self) -> Iterator[tuple[str, str, Path]]:
        for item in _listed(self.folder):
            if item.suffix.lower() in SUFFIXES:
                yield from self._named(item)
            elif item.name in self.names:
                yield from ((path.stem, item.name, path) for path in _listed(item) if _is_picture(path))
            elif name_order(item.name) > name_order(self._last) and item.name not in NO_MOMENTS and item.is_dir():
                pictures = (path for path in _listed(item) if _is_picture(path) and path.stem in self.names)
                yield from ((item.name, path.stem, path) for path in pictures)

    def _named(self, path: Path) -> Iterator[tuple[str, str, Path]]:
        """A picture that carries both names in its own."""
        for camera in self._longest_first:
            for mark in SEPARATORS:
                if path.stem.startswith(camera + mark):
                    yield path.stem[len(camera) + 1 :], camera, path
                    return
                if path.stem.endswith(mark + camera):
                    yield path.stem[: -len(camera) - 1], camera, path
                    return

    def _read(self, path: Path | None) -> np.ndarray | None:
        """The picture, or ``None`` where it is missing or not whole yet."""
        if path is None:
            return None
        try:
            data = read_image_bytes(path)
            image_size(path, data)  # of what is cut short the decoder would print complaints of its own
            return eight_bits(decoded(data, path))
        except InputError:
            return None


def _is_picture(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def _listed(folder: Path) -> list[Path]:
    """What is in a folder and not hidden; files come and go."""
    try:
        return [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError:
        return []


def _latest(files: Iterable[Path]) -> float:
    times = []
    for path in files:
        try:
            times.append(path.stat().st_mtime)
        except OSError:
            continue
    return max(times, default=0.0)
