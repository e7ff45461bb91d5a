"""Calibration boards to be rendered, described without Blender: ``boards.json`` (``frametwin-boards``, version 1)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import checked_array
from frametwin.cameras import Camera, from_nerfstudio, to_nerfstudio
from frametwin.checked_json import Fields
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json

FORMAT, VERSION = "frametwin-boards", 1
BOARDS_FILE = "boards.json"
_ANEW = "generate the dataset again"


@dataclass(frozen=True, eq=False)
class Body:
    """A board or a block as flat pieces, in its own axes.

    Attributes
    ----------
    white, black : (N, 4, 3) array, mm
        Corners of the pieces, in order around each; the black ones lie a little before the white.
    """

    white: NDArray[np.float64]
    black: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoardShot:
    """One picture of a body.

    Attributes
    ----------
    file : below the folder that is rendered into, with forward slashes.
    body : by name.
    pose : (4, 4) array, mm
        From the body's axes to the world.
    camera : that takes it.
    seed : of paths and sensor noise.
    """

    file: str
    body: str
    pose: NDArray[np.float64]
    camera: Camera
    seed: int


@dataclass(frozen=True, eq=False)
class BoardScene:
    """Bodies by name, and the pictures that are wanted of them."""

    bodies: dict[str, Body]
    shots: tuple[BoardShot, ...]


def write_board_scene(path: PathLike, scene: BoardScene) -> None:
    """Write the file; reading it gives back the same bits.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    shots = [
        {
            "file": shot.file,
            "body": shot.body,
            "pose": shot.pose,
            "camera": to_nerfstudio(shot.camera, shot.camera.name),
            "seed": shot.seed,
        }
        for shot in scene.shots
    ]
    bodies = {name: {"white": body.white, "black": body.black} for name, body in scene.bodies.items()}
    write_json(Path(path), {"format": FORMAT, "version": VERSION, "bodies": bodies, "shots": shots})


def read_board_scene(path: PathLike) -> BoardScene:
    """Read the file.

    Raises
    ------
    InputError
        If it is missing or damaged, or of another format or version.
    """
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    fields = Fields(data, Path(path), _ANEW)
    bodies = {name: _body(values, path, name) for name, values in fields.object("bodies").items()}
    shots = tuple(_shot(item, bodies, path, i) for i, item in enumerate(fields.objects("shots")))
    return BoardScene(bodies, shots)


def _body(values: Any, path: PathLike, name: str) -> Body:
    if not isinstance(values, dict):
        raise InputError.at(path, f"bodies.{name}", "is not an object", _ANEW)
    parts = (checked_array(values.get(key), "f", (None, 4, 3), str(path), f"bodies.{name}.{key}") for key in _COLOURS)
    return Body(*parts)


def _shot(item: Fields, bodies: dict[str, Body], path: PathLike, i: int) -> BoardShot:
    file, body = item.text("file"), item.text("body")
    parts = PurePosixPath(file).parts
    if PurePosixPath(file).is_absolute() or ".." in parts or "\\" in file or ":" in file:
        raise InputError.at(path, f"shots[{i}].file", f"{file!r} is not a file of the sample", _ANEW)
    if body not in bodies:
        raise InputError.at(path, f"shots[{i}].body", f"there is no body {body!r}", _ANEW)
    pose = checked_array(item.data.get("pose"), "f", (4, 4), str(path), f"shots[{i}].pose")
    camera = from_nerfstudio(item.object("camera"), source=f"{path}: shots[{i}].camera")
    return BoardShot(file, body, pose, camera, item.whole("seed"))


_COLOURS = ("white", "black")
