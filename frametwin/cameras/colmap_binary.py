"""COLMAP's binary models, ``cameras.bin`` and ``images.bin``, and whichever model a folder holds.

Source: COLMAP's documentation, "Output Format", "Binary File Format", and ``src/colmap/sensor/models.h``: everything is
little-endian; a count of 64 bits, then the records. Poses and pixels are those of the text models (see
`frametwin.cameras.colmap`), and so are millimetres.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from frametwin.cameras.camera import Camera
from frametwin.cameras.colmap import TEXT, parse_colmap_text, read_colmap_text
from frametwin.cameras.colmap_lens import Intrinsics, intrinsics_of, keys_of, posed_camera
from frametwin.errors import InputError
from frametwin.files import PathLike, read_bytes

BINARY = ("cameras.bin", "images.bin")
"""The files of a binary model that tell of cameras."""

MODEL_NAMES = (
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
    "SIMPLE_DIVISION",
    "DIVISION",
    "SIMPLE_FISHEYE",
    "FISHEYE",
    "EUCM",
    "EQUIRECTANGULAR",
)
"""Lens models by their number in the file."""

REMEDY = "export the model from COLMAP again, or copy the file whole"

_CAMERA = struct.Struct("<IiQQ")  # id, model, width, height
_IMAGE = struct.Struct("<I7dI")  # id, quaternion and translation, camera
_COUNT = struct.Struct("<Q")
_POINT_BYTES = 24  # x, y, and the number of a point in space


def model_files(folder: PathLike) -> tuple[Path, ...]:
    """The files of the model in a folder, the binary ones first as in COLMAP itself; empty if there is none."""
    place = Path(folder)
    for names in (BINARY, TEXT):
        if all((place / name).is_file() for name in names):
            return tuple(place / name for name in names)
    return ()


def read_colmap(folder: PathLike) -> list[Camera]:
    """Cameras of a COLMAP model, binary or text, one for each picture, in the order of its file of pictures.

    Parameters
    ----------
    folder
        The folder that holds ``cameras`` and ``images``, each ``.bin`` or ``.txt``; where there are both, the binary
        ones count, as in COLMAP itself.

    Raises
    ------
    InputError
        As `read_colmap_binary` and `read_colmap_text`.
    """
    place = Path(folder)
    found = model_files(place)
    binary = found[0].name in BINARY if found else any((place / name).is_file() for name in BINARY)
    return read_colmap_binary(place) if binary else read_colmap_text(place)


def read_colmap_binary(folder: PathLike) -> list[Camera]:
    """Cameras of a COLMAP binary model, one for each picture, in the order of ``images.bin``.

    Parameters
    ----------
    folder
        The folder that holds ``cameras.bin`` and ``images.bin``; ``points3D.bin`` need not be there.

    Returns
    -------
    Cameras named like their pictures.

    Raises
    ------
    InputError
        For a missing or damaged file, a lens model that is not in `MODELS`, rational coefficients (k4 to k6), or
        values that ``Camera`` refuses.
    """
    files = [Path(folder) / name for name in BINARY]
    return parse_colmap({file: read_bytes(file) for file in files})


def parse_colmap(contents: Mapping[Path, bytes]) -> list[Camera]:
    """Cameras of the two files of a model, as `model_files` names them, and what each holds; see `read_colmap`."""
    (cameras_file, cameras), (images_file, images) = contents.items()
    if cameras_file.name not in BINARY:
        return parse_colmap_text((cameras_file, cameras), (images_file, images))
    return _read_images(_Bytes(images, images_file), _read_lenses(_Bytes(cameras, cameras_file)))


@dataclass
class _Bytes:
    """The bytes of a file, and how far they have been read."""

    data: bytes
    path: Path
    offset: int = 0

    def count(self, what: str, least: int) -> int:
        """How many records follow, none of which has fewer bytes than ``least``."""
        (count,) = self.take(_COUNT, what)
        if count * least > self.left:
            problem = f"{count} are told, more than the file can hold"
            raise InputError.at(self.path, what, problem, REMEDY)
        return int(count)

    def take(self, kind: struct.Struct, what: str) -> tuple:
        """The next values."""
        if kind.size > self.left:
            raise InputError.at(self.path, what, "the file is cut short", REMEDY)
        values = kind.unpack_from(self.data, self.offset)
        self.offset += kind.size
        return values

    def text(self, what: str) -> str:
        """The text up to the next zero."""
        end = self.data.find(b"\0", self.offset)
        if end < 0:
            raise InputError.at(self.path, what, "the file is cut short", REMEDY)
        raw, self.offset = self.data[self.offset : end], end + 1
        try:
            return raw.decode("utf-8")
        except UnicodeDecodeError:
            raise InputError.at(self.path, what, "the name is not UTF-8 text", "rename the picture") from None

    def finish(self, what: str) -> None:
        """Refuse bytes that belong to nothing: what was read before them may be misread as well."""
        if self.left:
            raise InputError.at(self.path, what, f"{self.left} bytes follow the last one", REMEDY)

    @property
    def left(self) -> int:
        return len(self.data) - self.offset


def _read_lenses(file: _Bytes) -> dict[int, Intrinsics]:
    lenses = {}
    for i in range(file.count("cameras", _CAMERA.size)):
        where = f"{file.path}: cameras[{i}]"
        number, model, width, height = file.take(_CAMERA, f"cameras[{i}]")
        if not 0 <= model < len(MODEL_NAMES):
            raise InputError.at(where, "MODEL", f"the number {model} is not known", REMEDY)
        name = MODEL_NAMES[model]
        parameters = struct.Struct(f"<{len(keys_of(where, name))}d")
        lenses[number] = intrinsics_of(where, name, width, height, file.take(parameters, f"cameras[{i}].PARAMS"))
    file.finish("cameras")
    return lenses


def _read_images(file: _Bytes, lenses: dict[int, Intrinsics]) -> list[Camera]:
    cameras = []
    for i in range(file.count("images", _IMAGE.size + 1 + _COUNT.size)):
        where = f"{file.path}: images[{i}]"
        _, *pose, camera = file.take(_IMAGE, f"images[{i}]")
        name = file.text(f"images[{i}].NAME")
        points = file.count(f"images[{i}].POINTS2D", _POINT_BYTES)
        file.offset += points * _POINT_BYTES
        if camera not in lenses:
            raise InputError.at(where, "CAMERA_ID", f"{camera} is not in {BINARY[0]}", "add it there")
        cameras.append(posed_camera(where, name, lenses[camera], pose))
    file.finish("images")
    return cameras
