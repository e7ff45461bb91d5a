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

from frametwin.cameras.camera import DISTORTION_KEYS, FISHEYE, PERSPECTIVE, Camera
from frametwin.errors import InputError
from frametwin.files import read_text, write_text

Floats = NDArray[np.float64]

# The parameters of each model in the order of the file.
MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fl_x", "fl_y", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    FISHEYE: ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4"),
}


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
        For a missing or damaged file, a model that is not in ``MODELS``, rational coefficients (k4 to k6), or
        values that ``Camera`` refuses.
    """
    folder = Path(folder)
    intrinsics = _read_intrinsics(folder / "cameras.txt")
    path = folder / "images.txt"
    lines = iter(_lines(path))
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
        model, width, height, values = intrinsics[fields[8]]
        cameras.append(
            Camera(
                name=fields[9],
                width=width,  # type: ignore[arg-type]  # Camera checks that it is whole
                height=height,  # type: ignore[arg-type]
                fl_x=values.get("f", values.get("fl_x", 0.0)),
                fl_y=values.get("f", values.get("fl_y", 0.0)),
                cx=values["cx"],
                cy=values["cy"],
                camera_to_world=_camera_to_world(where, pose),
                distortion=np.array([values.get(key, 0.0) for key in DISTORTION_KEYS[model]]),
                model=model,
                source=where,
            )
        )
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


def _read_intrinsics(path: Path) -> dict[str, tuple[str, float, float, dict[str, float]]]:
    intrinsics = {}
    for number, line in _lines(path):
        if not line:
            continue
        where, fields = f"{path}: line {number}", line.split()
        model = fields[1] if len(fields) > 1 else "none"
        if model not in MODELS:
            raise InputError.at(where, "MODEL", f"{model} is not supported", f"use one of {', '.join(MODELS)}")
        keys = MODELS[model]
        if len(fields) != 4 + len(keys):
            raise InputError.at(
                where,
                "PARAMS",
                f"{model} has {len(keys)} parameters, not {len(fields) - 4}",
                "export the model again",
            )
        width, height, *values = _numbers(where, "PARAMS", fields[2:])
        named = dict(zip(keys, values, strict=True))
        lens = FISHEYE if model == FISHEYE else PERSPECTIVE
        if lens == PERSPECTIVE and any(named.get(key, 0.0) != 0.0 for key in ("k4", "k5", "k6")):
            raise InputError.at(where, "k4 k5 k6", "rational distortion is not supported", "calibrate with OPENCV")
        intrinsics[fields[0]] = (lens, width, height, named)
    return intrinsics


def _lines(path: Path) -> list[tuple[int, str]]:
    text = read_text(path)
    lines = enumerate((line.strip() for line in text.splitlines()), start=1)
    return [(number, line) for number, line in lines if not line.startswith("#")]


def _numbers(where: str, field: str, texts: Sequence[str]) -> list[float]:
    try:
        return [float(text) for text in texts]
    except ValueError:
        raise InputError.at(where, field, "not all values are numbers", "export the model again") from None


def _camera_to_world(where: str, pose: Sequence[float]) -> Floats:
    quaternion, translation = np.array(pose[:4]), np.array(pose[4:])
    length = np.linalg.norm(quaternion)
    if not abs(length - 1.0) < 1e-3:
        raise InputError.at(where, "QW QX QY QZ", "the quaternion is not of length 1", "export the model again")
    w, x, y, z = quaternion / length
    rotation = np.array(  # camera to world: the transpose of the quaternion's matrix
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ translation
    return matrix


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
