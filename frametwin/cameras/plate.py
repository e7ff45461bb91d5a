"""Markers on the plate: a board that lies still in the world, so that every picture tells where its camera is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import is_plain_text
from frametwin.cameras.standing import rigid_pose
from frametwin.errors import InputError
from frametwin.files import check_format

Floats = NDArray[np.float64]

FORMAT, VERSION = "frametwin-plate", 1
FILE_NAME = "plate.json"
"""In a capture whose cameras no rig of FrameTwin tells of."""


@dataclass(frozen=True, eq=False)
class Plate:
    """A board that lies still.

    Attributes
    ----------
    board
        As it is written on the command line; see `frametwin.calibration.boards`.
    pose : (4, 4) array, mm
        From the board's axes to the world.
    """

    board: str
    pose: Floats

    def moved(self, motion: Floats) -> Plate:
        """The plate in a world that differs by a rigid motion (4, 4)."""
        return replace(self, pose=motion @ self.pose)

    def as_dict(self) -> dict[str, Any]:
        """As it stands in a file."""
        return {"board": self.board, "transform_matrix": self.pose.tolist()}


def parse_plate(value: Any, path: Path) -> Plate | None:
    """The plate that a file gives, if it gives one.

    Raises
    ------
    InputError
        If it is no board with a rigid pose. Whether the board is one that can be printed is not asked here.
    """
    if value is None:
        return None
    if not isinstance(value, dict) or not is_plain_text(value.get("board")):
        remedy = "give an object with board (such as plate:10x7:40:30:APRILTAG_36h11) and transform_matrix"
        raise InputError.at(path, "plate", "is not a board and its pose", remedy)
    remedy = "give the rotation and position in mm of the board's middle in the world"
    pose = rigid_pose(value.get("transform_matrix"), path, "plate.transform_matrix", remedy)
    return Plate(str(value["board"]), pose)


def parse_plate_file(data: dict[str, Any], path: Path) -> Plate:
    """The plate that a ``plate.json`` holds.

    Raises
    ------
    InputError
        If it is of another format, or `parse_plate` refuses it.
    """
    check_format(data, path, FORMAT, VERSION)
    plate = parse_plate({key: data.get(key) for key in ("board", "transform_matrix")}, path)
    assert plate is not None
    return plate
