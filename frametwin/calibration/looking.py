"""Looking for a board in all pictures: how it was printed, where it is seen, and why a picture is of no use."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Board, corner_points
from frametwin.calibration.detection import (
    Look,
    Sighting,
    dictionaries_seen,
    find_corners,
    object_points,
    possible_looks,
)
from frametwin.calibration.pictures import Picture, read_grey
from frametwin.errors import InputError
from frametwin.progress import Progress, ProgressCallback, report

PROBES = 6
"""Pictures of a camera in which all ways of printing are tried at first."""

ENOUGH = 6
"""Corners without which a picture is not used."""


@dataclass(frozen=True)
class LeftOut:
    """A picture, or some corners of it, that is not used."""

    camera: str
    picture: str
    reason: str

    def as_dict(self, step: str) -> dict[str, str]:
        """As it stands in ``rig.json``."""
        return {"step": step, "camera": self.camera, "picture": self.picture, "reason": self.reason}


@dataclass(frozen=True, eq=False)
class Looked:
    """What was seen.

    Attributes
    ----------
    board
        As it turned out to be.
    looks
        The way of printing by camera; cameras that never see the board are not in it.
    sizes
        Width and height of the pictures of each camera.
    sightings
        All that can be used.
    left_out
        The others.
    notes
        Sentences for the user.
    """

    board: Board
    looks: dict[str, Look]
    sizes: dict[str, tuple[int, int]]
    sightings: tuple[Sighting, ...]
    left_out: tuple[LeftOut, ...]
    notes: tuple[str, ...] = ()

    def of(self, camera: str) -> tuple[Sighting, ...]:
        """Those of one camera."""
        return tuple(sighting for sighting in self.sightings if sighting.camera == camera)


@dataclass(eq=False)
class _Search:
    """Pictures that were read while looking, and what is wrong with the others."""

    left_out: list[LeftOut] = field(default_factory=list)
    sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    hashes: dict[str, Picture] = field(default_factory=dict)

    def read(self, picture: Picture) -> NDArray[np.uint8] | None:
        """A picture, or None with the reason noted."""
        try:
            grey = read_grey(picture.path)
        except InputError as error:
            self.note(picture, str(error).removeprefix(f"{picture.path}: ").rstrip("."))
            return None
        size = (grey.shape[1], grey.shape[0])
        usual = self.sizes.setdefault(picture.camera, size)
        if size != usual:
            self.note(picture, f"is {size[0]} x {size[1]} pixels where the others are {usual[0]} x {usual[1]}")
            return None
        key = picture.camera + hashlib.sha256(grey.tobytes()).hexdigest()
        first = self.hashes.setdefault(key, picture)
        if first.name != picture.name:
            self.note(picture, f"is the same picture as {first.name}")
            return None
        return grey

    def note(self, picture: Picture, reason: str) -> None:
        if all((note.camera, note.picture) != (picture.camera, picture.name) for note in self.left_out):
            self.left_out.append(LeftOut(picture.camera, picture.name, reason))


def look_for(
    pictures: dict[str, list[Picture]],
    board: Board,
    source: Path,
    known: dict[str, Look] | None = None,
    progress: ProgressCallback | None = None,
    stage: str = "looking for the board",
) -> Looked:
    """Find a board in pictures of several cameras.

    Parameters
    ----------
    pictures
        By camera.
    board
        As the user wrote it.
    source
        The folder, for messages.
    known
        The way of printing by camera, where it has been seen before.
    progress
        Called after each picture.
    stage
        What to call this in progress.

    Raises
    ------
    InputError
        If no camera sees the board, or one has it mirrored while others have not.
    """
    search, total = _Search(), sum(len(items) for items in pictures.values())
    looks: dict[str, Look] = {}
    sightings: list[Sighting] = []
    notes: list[str] = []
    done = 0
    for camera, items in pictures.items():
        tried = _looks_in_turn(board, [*(known or {}).values(), *looks.values()])
        choice = _recognise(search, items, board, tried)
        if choice is None and not sightings and (other := _as_squares(board)) is not None:
            choice = _recognise(search, items, other, tried)
            if choice is not None:
                notes.append(
                    f"The board has {board.columns} x {board.rows} squares, so {other.columns} x {other.rows} inner "
                    f"corners: it is {other.text}"
                )
                board = other
        for picture in items:
            grey = search.read(picture)
            if grey is not None:
                sighting = None if choice is None else _sighting(search, picture, grey, board, choice)
                sightings += [] if sighting is None else [sighting]
                if choice is None:
                    search.note(picture, "the board was not found")
            done += 1
            report(progress, Progress(stage, done, total))
        if choice is not None:
            looks[camera] = choice
    if not sightings:
        raise _nothing_seen(search, pictures, board, source)
    notes += _told(looks, board, source)
    return Looked(board, looks, search.sizes, tuple(sightings), tuple(search.left_out), tuple(notes))


def _looks_in_turn(board: Board, liked: Sequence[Look]) -> list[Look]:
    """All ways of printing, those first that were seen elsewhere."""
    every = list(possible_looks(board))
    return sorted(every, key=lambda look: (-liked.count(look), every.index(look)))


def _recognise(search: _Search, items: Sequence[Picture], board: Board, looks: Sequence[Look]) -> Look | None:
    """The way in which the board is printed: the one in which most corners are found."""
    if len(looks) == 1 and board.kind != "checkerboard":
        return looks[0]
    whole = len(corner_points(board))
    order = np.unique(np.linspace(0, len(items) - 1, min(PROBES, len(items))).astype(int)).tolist()
    rest = [i for i in range(len(items)) if i not in order]
    for chosen in (order, rest):
        greys = [grey for i in chosen if (grey := search.read(items[i])) is not None]
        counts: dict[Look, int] = dict.fromkeys(looks, 0)
        for look in looks:
            counts[look] = sum(len(find_corners(grey, board, look)[0]) for grey in greys)
            if greys and counts[look] >= 0.6 * whole * len(greys):
                return look
        best = max(looks, key=lambda look: counts[look])
        if counts[best] >= ENOUGH:
            return best
    return None


def _as_squares(board: Board) -> Board | None:
    """The checkerboard of which someone has counted the squares."""
    if board.kind != "checkerboard" or min(board.columns, board.rows) < 4:
        return None
    return replace(board, columns=board.columns - 1, rows=board.rows - 1)


def _sighting(search: _Search, picture: Picture, grey: NDArray[np.uint8], board: Board, look: Look) -> Sighting | None:
    corners, pixels = find_corners(grey, board, look)
    if len(corners) < ENOUGH:
        found = f"only {len(corners)} of {len(corner_points(board))} corners were found"
        search.note(picture, found if len(corners) else "the board was not found")
        return None
    return Sighting(picture.camera, picture.name, corners, object_points(board, corners, look), pixels)


def _told(looks: dict[str, Look], board: Board, source: Path) -> list[str]:
    """Sentences on how the board was printed."""
    mirrored = [camera for camera, look in looks.items() if look.mirrored]
    if mirrored and len(mirrored) < len(looks):
        straight = next(camera for camera in looks if camera not in mirrored)
        problem = f"its pictures are mirrored and those of {straight} are not"
        remedy = "turn off the mirroring of the webcam (or its software) and take them again"
        raise InputError.at(source / mirrored[0], "camera", problem, remedy)
    words = sorted({look.words for look in looks.values() if look.words})
    notes = [f"The board is {text}; it was found all the same" for text in words]
    if mirrored:
        notes[-1] += ", and is taken for a mirrored print: if it is not, the cameras mirror their pictures"
    return notes


def _nothing_seen(search: _Search, pictures: dict[str, list[Picture]], board: Board, source: Path) -> InputError:
    """The error when no board was found, with what was seen in its place."""
    greys = []
    for items in pictures.values():
        for picture in items[:: max(1, len(items) // 2)][:2]:
            try:
                greys.append(read_grey(picture.path))
            except InputError:
                continue
    if not greys:
        first = search.left_out[0]
        return InputError.at(source, first.picture, first.reason, "give pictures that can be read")
    remedy = "check --board: its kind, columns x rows, and that it is sharp and seen whole"
    if board.kind != "checkerboard":
        seen = [name for name in dictionaries_seen(greys[:4]) if name != board.dictionary]
        if seen:
            remedy = f"markers of {seen[0]} are seen: check kind, columns x rows and dictionary of --board"
    return InputError.at(source, "pictures", f"{board.text} was found in none of them", remedy)
