"""Folders of pictures of boards: one for each camera, equal names at the same moment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.capture.image_files import image_size
from frametwin.errors import InputError
from frametwin.files import PathLike

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


@dataclass(frozen=True)
class Picture:
    """A picture of a board.

    Attributes
    ----------
    camera
        Name of the camera.
    name
        The file's name without its ending.
    path
        The file.
    """

    camera: str
    name: str
    path: Path


def list_pictures(folder: PathLike) -> dict[str, list[Picture]]:
    """Pictures of each camera, by name.

    Parameters
    ----------
    folder
        With a folder of pictures for each camera; pictures of a single camera may also lie in it directly.

    Raises
    ------
    InputError
        If there is no such folder, it holds no pictures, or two of a camera have the same name.
    """
    root = Path(folder)
    if not root.is_dir():
        raise InputError.at(root, "folder", "there is no such folder", "give the folder with the pictures")
    found = {place.name: _pictures_in(place, place.name) for place in sorted(root.iterdir()) if place.is_dir()}
    found = {name: pictures for name, pictures in found.items() if pictures}
    if not found:
        name = root.resolve().name
        found = {name: _pictures_in(root, name)}
    if not any(found.values()):
        remedy = "put a folder of PNG or JPEG pictures for each camera into it"
        raise InputError.at(root, "folder", "holds no pictures", remedy)
    return found


def _pictures_in(folder: Path, camera: str) -> list[Picture]:
    files = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in ENDINGS and file.is_file()]
    files = [file for file in files if not file.name.startswith(".")]
    names = [file.stem for file in files]
    for file in files:
        if names.count(file.stem) > 1:
            remedy = "keep one of them: pictures are told apart by their names without endings"
            raise InputError.at(folder, file.stem, "is the name of two pictures", remedy)
    return [Picture(camera, file.stem, file) for file in files]


def read_grey(path: Path) -> NDArray[np.uint8]:
    """A picture (H, W) as it is stored: a turn that is only noted in the file is not applied.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    if path.suffix.lower() in (".png", ".jpg", ".jpeg"):
        image_size(path)  # says what is wrong with a file that is cut short
    data = np.fromfile(path, dtype=np.uint8)
    grey = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if data.size else None
    if grey is None:
        raise InputError.at(path, "image", "cannot be decoded", "save it again, as PNG or JPEG")
    return np.asarray(grey, dtype=np.uint8)
