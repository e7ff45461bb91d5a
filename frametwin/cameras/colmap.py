"""COLMAP's text models: ``cameras.txt`` and ``images.txt``.

Poses there are world to camera with OpenCV axes, as a unit quaternion (w, x, y, z) and a translation; the
pixel in row i and column j has its centre at (j + 0.5, i + 0.5), as here. COLMAP has no unit: FrameTwin reads
and writes mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frametwin.cameras.camera import FISHEYE, Camera
from frametwin.cameras.colmap_lens import Intrinsics, intrinsics_of, keys_of, posed_camera
from frametwin.errors import InputError
from frametwin.files import decode_text, read_bytes, write_text

Floats = NDArray[np.float64]

TEXT = ("cameras.txt", "images.txt")
"""The files of a text model that tell of cameras."""


def read_colmap_text(folder: str | Path) -> list[Camera]:
    """Cameras of a COLMAP text model, one for each picture, in the order of ``images.txt``.

    Parameters
    ----------
    folder
        The folder that holds ``cameras.txt`` and ``images.txt``.

    Returns
    -------
    Cameras named like their pictures.

    Raises
    ------
    InputError
        For a missing or damaged file, a lens model that is not in `MODELS`, rational coefficients (k4 to k6), or
        values that ``Camera`` refuses.
    """
    files = [Path(folder) / name for name in TEXT]
    return parse_colmap_text(*((file, read_bytes(file)) for file in files))


def parse_colmap_text(lenses: tuple[Path, bytes], images: tuple[Path, bytes]) -> list[Camera]:
    """Cameras of the two files of a text model, each given by its name and what it holds; see `read_colmap_text`."""
    intrinsics = _read_intrinsics(*lenses)
    path = images[0]
    lines = iter(_lines(*images))
    cameras = []
    for number, line in lines:
        if not line:
            continue
        next(lines, None)  # the picture's 2D points, perhaps none
        fields = line.split(maxsplit=9)
        where = f"{path}: line {number}"
        if len(fields) != 10:
            raise InputError.at(where, "picture", "has not ten values", "export the model from COLMAP again")
        pose = _numbers(where, "pose", fields[1:8])
        if fields[8] not in intrinsics:
            raise InputError.at(where, "CAMERA_ID", f"{fields[8]} is not in cameras.txt", "add it there")
        cameras.append(posed_camera(where, fields[9], intrinsics[fields[8]], pose))
    return cameras


def write_colmap_text(folder: str | Path, cameras: Sequence[Camera]) -> None:
    """Write ``cameras.txt``, ``images.txt`` and an empty ``points3D.txt``, which COLMAP asks for.

    Parameters
    ----------
    folder
        Where to; made when absent.
    cameras
        One picture each, under the camera's name. The model is PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE, the
        simplest that holds the distortion. Numbers are written in full, so reading gives the same camera.

    Raises
    ------
    InputError
        If two cameras have the same name, or a name has a line break.
    """
    folder = Path(folder)
    names = [camera.name for camera in cameras]
    for name in names:
        if names.count(name) > 1 or len(name.splitlines()) != 1 or name != name.strip():
            raise InputError.at(
                folder / "images.txt",
                "NAME",
                f"{name!r} cannot stand for one picture",
                "give each a plain name",
            )
    intrinsics = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"]
    images = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", "# POINTS2D[] as X Y POINT3D_ID"]
    for index, camera in enumerate(cameras, start=1):
        model, values = _parameters(camera)
        intrinsics.append(f"{index} {model} {camera.width} {camera.height} {_text(values)}")
        quaternion = _quaternion(camera.world_to_camera[:3, :3])
        pose = [*quaternion, *camera.world_to_camera[:3, 3]]
        images += [f"{index} {_text(pose)} {index} {camera.name}", ""]
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "cameras.txt", "\n".join(intrinsics) + "\n")
    write_text(folder / "images.txt", "\n".join(images) + "\n")
    write_text(folder / "points3D.txt", "# POINT3D_ID X Y Z R G B ERROR TRACK[]\n")


def _read_intrinsics(path: Path, data: bytes) -> dict[str, Intrinsics]:
    found = {}
    for number, line in _lines(path, data):
        if not line:
            continue
        where, fields = f"{path}: line {number}", line.split()
        model = fields[1] if len(fields) > 1 else "none"
        count = len(keys_of(where, model))
        if len(fields) != 4 + count:
            raise InputError.at(
                where,
                "PARAMS",
                f"{model} has {count} parameters, not {len(fields) - 4}",
                "export the model again",
            )
        width, height, *values = _numbers(where, "PARAMS", fields[2:])
        found[fields[0]] = intrinsics_of(where, model, width, height, values)
    return found


def _lines(path: Path, data: bytes) -> list[tuple[int, str]]:
    text = decode_text(data, path)
    lines = enumerate((line.strip() for line in text.splitlines()), start=1)
    return [(number, line) for number, line in lines if not line.startswith("#")]


def _numbers(where: str, field: str, texts: Sequence[str]) -> list[float]:
    try:
        return [float(text) for text in texts]
    except ValueError:
        raise InputError.at(where, field, "not all values are numbers", "export the model again") from None


def _quaternion(rotation: Floats) -> Floats:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation (Shepperd, J. Guidance and Control 1(3), 1978)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    # Row k is 4 q_k q; the row of the largest component loses no digits.
    products = np.array(
        [
            [1 + a + e + i, h - f, c - g, d - b],
            [h - f, 1 + a - e - i, b + d, c + g],
            [c - g, b + d, 1 - a + e - i, f + h],
            [d - b, c + g, f + h, 1 - a - e + i],
        ]
    )
    row = products[np.argmax(np.diag(products))]
    return row / np.linalg.norm(row) * (1.0 if row[0] >= 0.0 else -1.0)


def _parameters(camera: Camera) -> tuple[str, list[float]]:
    values = [camera.fl_x, camera.fl_y, camera.cx, camera.cy]
    if not camera.has_distortion:
        return "PINHOLE", values
    if camera.model == FISHEYE:
        return FISHEYE, [*values, *camera.distortion]
    k1, k2, p1, p2, k3 = camera.distortion
    if k3 == 0.0:
        return "OPENCV", [*values, k1, k2, p1, p2]
    return "FULL_OPENCV", [*values, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]


def _text(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
