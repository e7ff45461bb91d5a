"""``calibrate extrinsics``: where the cameras stand to each other, from boards seen at the same moments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Board, looks_the_same_turned
from frametwin.calibration.detection import Sighting
from frametwin.calibration.intrinsics import SPOILS
from frametwin.calibration.joint import Adjusted, Joint, adjust, without_doubles
from frametwin.calibration.looking import LeftOut, Looked, look_for
from frametwin.calibration.page import Evidence
from frametwin.calibration.pictures import list_pictures
from frametwin.calibration.pose_graph import Start, find_start
from frametwin.calibration.poses import board_poses
from frametwin.calibration.rig_folder import Seen, now
from frametwin.cameras.rig_file import Rig, noted
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.progress import Progress, ProgressCallback, report

Floats = NDArray[np.float64]

LEAST_CONTRADICTORY_PX = 0.3
"""Corners of one picture that miss by less never contradict each other."""

LOOSE = 2.5
"""Corners that miss by so many times more between cameras than within one tell that moments are none."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A rig whose poses are known, with what it was found from."""

    rig: Rig
    moments: Seen
    evidence: Evidence


def calibrate_extrinsics(
    rig: Rig, lenses: Seen, folder: PathLike, board: Board | None = None, progress: ProgressCallback | None = None
) -> Placed:
    """Find the poses of all cameras of a rig; the world is its first camera.

    Parameters
    ----------
    rig
        With known lenses.
    lenses
        What they were found from.
    folder
        With a folder of pictures for each camera; equal names are the same moment.
    board
        What is seen in them; by default that of the lenses.
    progress
        Called now and then.

    Raises
    ------
    InputError
        If cameras are missing, or not tied together by boards that two of them see at one moment.
    """
    looked = look_at_moments(rig, lenses, folder, lenses.board if board is None else board, progress)
    symmetric = looks_the_same_turned(looked.board)
    watch = watching(progress, "adjusting all cameras")
    sightings, contradictory = without_contradictory(rig, looked.sightings)
    start = find_start(rig.cameras, sightings, symmetric)
    _check_tied(start, Path(folder))
    joint = Joint(rig.cameras, start.cameras, (), start.sightings, start.boards)
    adjusted, notes = adjust_moments(joint, lenses.sightings, watch)
    earlier = rig.before("extrinsics")
    unused = (*looked.left_out, *contradictory, *adjusted.left_out)
    result = replace(
        rig,
        cameras=tuple(adjusted.camera(i) for i in range(len(rig.cameras))),
        world="camera",
        placed_by={},
        plate=None,
        board=looked.board.text,
        date=now(),
        notes=(*earlier[0], *noted("extrinsics", (*looked.notes, *notes))),
        left_out=(*earlier[1], *(note.as_dict("extrinsics") for note in unused)),
    )
    moments = Seen(looked.board, looked.looks, adjusted.joint.moments)
    return Placed(result, moments, Evidence(adjusted.joint.sightings, adjusted.solution.residuals))


def look_at_moments(
    rig: Rig, lenses: Seen, folder: PathLike, board: Board, progress: ProgressCallback | None
) -> Looked:
    """Find a board in the pictures of a rig's cameras.

    Raises
    ------
    InputError
        If a camera has no pictures, is not of the rig, or its pictures have another size.
    """
    pictures = list_pictures(folder)
    for name in pictures:
        if name not in rig.names:
            remedy = f"name the folders as the rig's cameras: {', '.join(rig.names)}"
            raise InputError.at(Path(folder) / name, "camera", "the rig has no such camera", remedy)
    looked = look_for(pictures, board, Path(folder), lenses.looks, progress)
    for name, size in looked.sizes.items():
        camera = rig.camera(name)
        if size != (camera.width, camera.height):
            problem = (
                f"its pictures are {size[0]} x {size[1]} pixels, those of its lens {camera.width} x {camera.height}"
            )
            raise InputError.at(Path(folder) / name, "size", problem, "take them in the same size, without cropping")
    return looked


def without_contradictory(rig: Rig, sightings: Sequence[Sighting]) -> tuple[tuple[Sighting, ...], list[LeftOut]]:
    """Leave out sightings that no place of the board explains, whatever the other cameras see."""
    kept, left_out = [], []
    for sighting in sightings:
        camera = rig.camera(sighting.camera)
        poses = board_poses(camera.model, camera.lens, sighting)
        usual = float(camera.residuals.get("rms_px", LEAST_CONTRADICTORY_PX))
        error = poses[0][0] if poses else np.inf
        if error > max(SPOILS * usual, LEAST_CONTRADICTORY_PX):
            words = f"its corners contradict each other: they miss by {error:.2f} px where {usual:.2f} px are usual"
            reason = f"{words}; it is blurred, seen too steeply, or the board bends"
            left_out.append(LeftOut(sighting.camera, sighting.picture, reason))
        else:
            kept.append(sighting)
    return tuple(kept), left_out


def watching(progress: ProgressCallback | None, stage: str) -> Callable[[], None]:
    """A function that reports one step more each time it is called."""
    count = iter(range(10**9))
    return lambda: report(progress, Progress(stage, next(count), 0))


def _check_tied(start: Start, folder: Path) -> None:
    if len(start.groups) > 1:
        first, second = (", ".join(group) for group in start.groups[:2])
        problem = f"no moment ties {second} to {first}"
        remedy = "hold the board where a camera of both sees it at the same moment (equal file names)"
        raise InputError.at(folder, "cameras", problem, remedy)


def adjust_moments(
    joint: Joint, alone: tuple[Sighting, ...], watch: Callable[[], object] | None
) -> tuple[Adjusted, list[str]]:
    """Adjust moments and lenses together; where moments are not quite moments, they count for less.

    Parameters
    ----------
    joint
        Without sightings of single cameras.
    alone
        Those, from which the lenses were found.
    watch
        Called now and then.
    """
    together = replace(joint, alone=without_doubles(alone, joint.moments))
    adjusted = adjust(together, watch)
    usual = float(np.median([camera.residuals["rms_px"] for camera in joint.cameras]))
    found = _median_rms(adjusted)
    if found <= max(LOOSE * usual, 0.2):
        return adjusted, []
    motion = found * _millimetres_in_a_pixel(adjusted)
    loose = adjust(replace(joint, alone=without_doubles(alone, joint.moments), motion_mm=motion), watch)
    note = (
        f"Corners miss by {found:.2f} px between cameras where they miss by {usual:.2f} px within one: the board moved"
        f" by about {motion:.1f} mm between the pictures of a moment; trigger the cameras together, or stand it on"
        " something"
    )
    return loose, [note]


def _millimetres_in_a_pixel(adjusted: Adjusted) -> float:
    """At the boards of the moments, usually."""
    found = []
    for sighting in adjusted.joint.moments:
        i = [camera.name for camera in adjusted.joint.cameras].index(sighting.camera)
        eye = adjusted.solution.bundle.eyes[i]
        board = adjusted.joint.boards[sighting.picture]
        found.append(float(np.linalg.norm(board[:3, 3] - eye.camera_to_world[:3, 3])) / float(eye.lens[0]))
    return float(np.median(found))


def _median_rms(adjusted: Adjusted) -> float:
    first, count = len(adjusted.joint.alone), len(adjusted.joint.moments)
    return float(np.median([adjusted.solution.rms(first + i) for i in range(count)]))
