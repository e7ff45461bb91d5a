"""What a rig was calibrated from: corners in pictures, kept beside it so that later steps need no pictures again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from frametwin.arrays import checked_array
from frametwin.calibration.boards import Board, corner_points, parse_board
from frametwin.calibration.detection import Look, Sighting, object_points
from frametwin.errors import InputError
from frametwin.files import check_format, read_json, write_json

FORMAT, VERSION = "frametwin-sightings", 1
LENSES, MOMENTS, OBJECT = "sightings_lenses.json", "sightings_moments.json", "sightings_object.json"


def write_sightings(path: Path, board: Board, looks: dict[str, Look], sightings: Sequence[Sighting]) -> None:
    """Write corners as they were used."""
    rows = [
        {
            "camera": sighting.camera,
            "picture": sighting.picture,
            "corners": sighting.corners.tolist(),
            "pixels": sighting.pixels.tolist(),
        }
        for sighting in sightings
    ]
    printed = {camera: vars(look) for camera, look in looks.items()}
    data = {"format": FORMAT, "version": VERSION, "board": board.text, "printed": printed, "sightings": rows}
    write_json(path, data)


def read_sightings(path: Path) -> tuple[Board, dict[str, Look], tuple[Sighting, ...]]:
    """Read corners.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    board = parse_board(str(data.get("board")), str(path))
    looks = {}
    for camera, values in _dict(data.get("printed"), path, "printed").items():
        values = _dict(values, path, f"printed.{camera}")
        looks[camera] = Look(*(values.get(key) is True for key in ("inverted", "mirrored", "legacy")))
    rows = data.get("sightings")
    if not isinstance(rows, list):
        raise InputError.at(path, "sightings", "is not a list", "calibrate again")
    return board, looks, tuple(_sighting(row, i, board, looks, path) for i, row in enumerate(rows))


def _sighting(row: Any, i: int, board: Board, looks: dict[str, Look], path: Path) -> Sighting:
    values = _dict(row, path, f"sightings[{i}]")
    camera, picture = values.get("camera"), values.get("picture")
    if not isinstance(picture, str) or camera not in looks:
        raise InputError.at(path, f"sightings[{i}]", "names no camera and picture", "calibrate again")
    corners = checked_array(values.get("corners"), "i", (None,), str(path), f"sightings[{i}].corners")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(corner_points(board)):
        raise InputError.at(path, f"sightings[{i}].corners", "are not on the board", "calibrate again")
    pixels = checked_array(values.get("pixels"), "f", (len(corners), 2), str(path), f"sightings[{i}].pixels")
    return Sighting(str(camera), picture, corners, object_points(board, corners, looks[camera]), pixels)


def _dict(value: Any, path: Path, place: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError.at(path, place, "is not an object", "calibrate again")
    return value
