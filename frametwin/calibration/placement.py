"""``calibrate place``: the world becomes the robot's, by an object that stands at a known place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Board, looks_the_same_turned
from frametwin.calibration.detection import Sighting
from frametwin.calibration.extrinsics import Placed, adjust_moments, look_at_moments, watching
from frametwin.calibration.joint import Joint
from frametwin.calibration.page import Evidence
from frametwin.calibration.pose_graph import find_start
from frametwin.calibration.poses import board_poses, rms_of
from frametwin.calibration.rig_folder import Seen, now
from frametwin.cameras.plate import Plate
from frametwin.cameras.rig_file import Rig, noted
from frametwin.cameras.standing import standing_at
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.progress import ProgressCallback

Floats = NDArray[np.float64]

DISAGREES = 3.0
"""An object whose corners miss by so many times those of the board is not as large as it should be."""


def place_rig(
    rig: Rig,
    lenses: Seen,
    moments: Seen,
    folder: PathLike,
    thing: Board,
    at: tuple[float, ...],
    progress: ProgressCallback | None = None,
) -> tuple[Placed, Seen]:
    """Move a rig into the robot's world, with everything adjusted once more and the object held.

    Parameters
    ----------
    rig
        With known poses, in whichever world.
    lenses, moments
        What it was found from.
    folder
        With a folder of pictures of the object for each camera that sees it; all show it at the same place.
    thing
        The object: the cuboid, or a board that lies face up.
    at
        Where its origin is in the robot's axes (mm), and its turn about z (degrees).
    progress
        Called now and then.

    Returns
    -------
    placed
        The rig in the robot's world.
    seen
        The sightings of the object.

    Raises
    ------
    InputError
        If no camera sees the object, or its direction cannot be told.
    """
    if looks_the_same_turned(thing):
        remedy = "use one with an odd and an even count of inner corners, such as 9x6, or a charuco board"
        raise InputError.at("--object", thing.text, "looks the same after half a turn", remedy)
    if rig.world == "none":
        raise InputError.at("rig.json", "world", "the poses are not known", "run frametwin calibrate extrinsics first")
    looked = look_at_moments(rig, replace(lenses, looks={}), folder, thing, progress)
    sightings = tuple(sighting for sighting in looked.sightings if len(sighting.corners) >= 6)
    pose = standing_at(at)
    motion = pose @ np.linalg.inv(_pose_in_rig(rig, sightings))
    moved = rig.moved(motion)
    places = {camera.name: _known(camera.camera_to_world) for camera in moved.cameras}
    start = find_start(moved.cameras, moments.sightings, looks_the_same_turned(moments.board))
    to_rig = places[moved.cameras[0].name] @ np.linalg.inv(start.cameras[moved.cameras[0].name])
    boards = {moment: to_rig @ board for moment, board in start.boards.items()}
    joint = Joint(moved.cameras, places, (), start.sightings, boards, sightings, pose)
    adjusted, _ = adjust_moments(joint, lenses.sightings, watching(progress, "adjusting all cameras"))
    figures = _figures(adjusted.solution.residuals[-len(adjusted.joint.thing) :], adjusted.joint.thing)
    notes = _notes(figures, rig, looked.notes)
    earlier, unused = rig.before("place"), (*looked.left_out, *adjusted.left_out)
    result = replace(
        rig,
        cameras=tuple(adjusted.camera(i) for i in range(len(rig.cameras))),
        world="robot",
        plate=Plate(looked.board.text, pose) if looked.board.kind == "plate" else None,
        placed_by={"object": looked.board.text, "at": list(at), **figures},
        date=now(),
        notes=(*earlier[0], *noted("place", notes)),
        left_out=(*earlier[1], *(note.as_dict("place") for note in unused)),
    )
    seen = replace(moments, sightings=adjusted.joint.moments)
    evidence = Evidence(adjusted.joint.sightings, adjusted.solution.residuals)
    return Placed(result, seen, evidence), Seen(looked.board, looked.looks, adjusted.joint.thing)


def _known(pose: Floats | None) -> Floats:
    assert pose is not None
    return pose


def _pose_in_rig(rig: Rig, sightings: tuple[Sighting, ...]) -> Floats:
    """Where the object is in the rig's present world: of all single views' poses the one that suits all views."""
    best: tuple[float, Floats] | None = None
    for sighting in sightings:
        camera = rig.camera(sighting.camera)
        for _, local in board_poses(camera.model, camera.lens, sighting):
            pose = _known(camera.camera_to_world) @ local
            error = sum(min(_error(rig, pose, other), 50.0) for other in sightings)
            if best is None or error < best[0]:
                best = (error, pose)
    if best is None:
        raise InputError.at("--object", "pictures", "no view of it gives its pose", "take the pictures again, sharp")
    return best[1]


def _error(rig: Rig, pose: Floats, sighting: Sighting) -> float:
    camera = rig.camera(sighting.camera)
    return rms_of(camera.model, camera.lens, np.linalg.inv(_known(camera.camera_to_world)) @ pose, sighting)


def _figures(residuals: tuple[Floats, ...], sightings: tuple[Sighting, ...]) -> dict[str, Any]:
    together = np.concatenate(residuals)
    return {
        "rms_px": float(np.sqrt((together**2).sum(axis=1).mean())),
        "cameras": sorted({sighting.camera for sighting in sightings}),
        "corners": len(together),
    }


def _notes(figures: dict[str, Any], rig: Rig, notes: tuple[str, ...]) -> list[str]:
    found = [note.replace("The board", "The object") for note in notes]
    usual = float(np.median([camera.residuals.get("rms_px", 0.2) for camera in rig.cameras]))
    if len(figures["cameras"]) < min(3, len(rig.cameras)):
        found.append(f"The object was seen by {' and '.join(figures['cameras'])} only; let more cameras see it")
    if figures["rms_px"] > max(DISAGREES * usual, 1.0):
        found.append(
            f"The object's corners miss by {figures['rms_px']:.2f} px, the board's by {usual:.2f} px: one of the two"
            " was not printed at the size that was given, or the object moved"
        )
    return found


def folder_of(path: PathLike) -> Path:
    """The folder of a rig that may be given by its ``rig.json``."""
    rig = Path(path)
    return rig if rig.is_dir() or rig.suffix != ".json" else rig.parent
