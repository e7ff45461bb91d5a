"""Writing a rig folder whole: cameras, what they were calibrated from, and the page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from frametwin.calibration.boards import Board
from frametwin.calibration.detection import Look, Sighting
from frametwin.calibration.page import Evidence, write_page
from frametwin.calibration.sightings_file import LENSES, MOMENTS, OBJECT, read_sightings, write_sightings
from frametwin.cameras.rig_file import FILE_NAME, Rig, write_rig
from frametwin.errors import InputError
from frametwin.files import PathLike, staged_directory


@dataclass(frozen=True, eq=False)
class Seen:
    """A board, how it was printed by camera, and its sightings."""

    board: Board
    looks: dict[str, Look]
    sightings: tuple[Sighting, ...]


def read_seen(rig: PathLike, name: str) -> Seen | None:
    """What one step saw, if that step was done."""
    folder = Path(rig)
    folder = folder if folder.is_dir() else folder.parent
    if not (folder / name).exists():
        return None
    return Seen(*read_sightings(folder / name))


def need_seen(rig: PathLike, name: str, step: str) -> Seen:
    """The same, where the step has to have been done.

    Raises
    ------
    InputError
        If it was not.
    """
    seen = read_seen(rig, name)
    if seen is None:
        remedy = f"run frametwin calibrate {step} first, and keep the files of the rig together"
        raise InputError.at(rig, name, "is missing", remedy)
    return seen


def now() -> str:
    """Day and time for ``rig.json``."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def write_folder(
    folder: PathLike,
    rig: Rig,
    *,
    lenses: Seen | None,
    moments: Seen | None = None,
    thing: Seen | None = None,
    evidence: Evidence | None = None,
    overwrite: bool = False,
) -> None:
    """Write a rig folder, whole or not at all.

    Raises
    ------
    InputError
        If there is something else, or it cannot be written.
    """
    require_rig_or_free(folder, overwrite)
    with staged_directory(folder, overwrite) as staged:
        write_rig(staged, replace(rig, date=rig.date or now()))
        for name, seen in ((LENSES, lenses), (MOMENTS, moments), (OBJECT, thing)):
            if seen is not None:
                write_sightings(staged / name, seen.board, seen.looks, seen.sightings)
        write_page(staged / "report.html", rig, evidence or Evidence())


def require_rig_or_free(folder: PathLike, overwrite: bool) -> None:
    """Refuse to replace a folder that is not a rig."""
    path = Path(folder)
    if overwrite and path.is_dir() and any(path.iterdir()) and not (path / FILE_NAME).is_file():
        raise InputError.at(path, "folder", f"holds no {FILE_NAME}, so it is not a rig", "choose another --out")
    if not overwrite and path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise InputError.at(path, "folder", "exists and is not empty", "choose another --out, or give --overwrite")
