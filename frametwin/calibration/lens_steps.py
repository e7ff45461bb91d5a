"""``calibrate intrinsics``: a rig of lenses from a folder of pictures for each camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from frametwin.calibration.boards import Board
from frametwin.calibration.intrinsics import Lens, calibrate_lens
from frametwin.calibration.looking import look_for
from frametwin.calibration.page import Evidence
from frametwin.calibration.pictures import list_pictures
from frametwin.calibration.rig_folder import Seen, now
from frametwin.cameras.rig_file import Rig, noted
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.progress import Progress, ProgressCallback, report


def calibrate_intrinsics(
    folder: PathLike, board: Board, model: str, progress: ProgressCallback | None = None
) -> tuple[Rig, Seen, Evidence]:
    """Find the lens of every camera.

    Parameters
    ----------
    folder
        With a folder of pictures for each camera.
    board
        What is seen in them.
    model
        ``OPENCV`` or ``OPENCV_FISHEYE``.
    progress
        Called now and then.

    Returns
    -------
    rig
        Without poses.
    seen
        The sightings that were used.
    evidence
        For the page.

    Raises
    ------
    InputError
        If the board is not found, or the pictures of a camera do not tell its lens.
    """
    pictures = list_pictures(folder)
    looked = look_for(pictures, board, Path(folder), progress=progress)
    blind = [camera for camera in pictures if camera not in looked.looks]
    if blind:
        remedy = "take pictures in which it sees the board, or remove its folder"
        raise InputError.at(Path(folder) / blind[0], "pictures", "the board was found in none of them", remedy)
    lenses: list[Lens] = []
    for i, camera in enumerate(pictures):
        watch = _watch(progress, i, len(pictures))
        lenses.append(calibrate_lens(camera, looked.sizes[camera], looked.of(camera), model, watch))
    report(progress, Progress("finding lenses", len(pictures), len(pictures)))
    unused = [*looked.left_out, *(note for lens in lenses for note in lens.left_out)]
    rig = Rig(
        cameras=tuple(lens.camera for lens in lenses),
        board=looked.board.text,
        date=now(),
        notes=noted("intrinsics", (*looked.notes, *(note for lens in lenses for note in lens.notes))),
        left_out=tuple(note.as_dict("intrinsics") for note in unused),
    )
    used = tuple(sighting for lens in lenses for sighting in lens.used)
    residuals = tuple(left for lens in lenses for left in lens.residuals)
    return rig, Seen(looked.board, looked.looks, used), Evidence(used, residuals)


def _watch(progress: ProgressCallback | None, done: int, total: int) -> Callable[[], None]:
    return lambda: report(progress, Progress("finding lenses", done, total))
