"""What COLMAP's text and binary models have in common: lens models, and the camera of a lens and a pose.

Source: COLMAP's documentation, "Camera Models" and "Output Format", and ``src/colmap/sensor/models.h``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from frametwin.cameras.camera import DISTORTION_KEYS, FISHEYE, PERSPECTIVE, Camera
from frametwin.errors import InputError

Floats = NDArray[np.float64]

MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fl_x", "fl_y", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    FISHEYE: ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fl_x", "fl_y", "cx", "cy"),
}
"""The parameters of each lens model in the order of the file."""


@dataclass(frozen=True)
class Intrinsics:
    """A lens as a model has it.

    Attributes
    ----------
    model
        ``OPENCV`` or ``OPENCV_FISHEYE``: the one of ours that COLMAP's is a case of.
    width, height
        Picture size in pixels, not checked yet.
    values
        The parameters by name, as `MODELS` has them.
    """

    model: str
    width: float
    height: float
    values: dict[str, float]


def keys_of(where: str, model: str) -> tuple[str, ...]:
    """The parameters of a lens model.

    Raises
    ------
    InputError
        If it is not in `MODELS`; ``where`` is the place in the file.
    """
    if model not in MODELS:
        raise InputError.at(where, "MODEL", f"{model} is not supported", f"use one of {', '.join(MODELS)}")
    return MODELS[model]


def intrinsics_of(where: str, model: str, width: float, height: float, values: Sequence[float]) -> Intrinsics:
    """The lens of a model's parameters.

    Raises
    ------
    InputError
        For rational coefficients (k4 to k6), which ``Camera`` does not have.
    """
    named = dict(zip(keys_of(where, model), values, strict=True))
    lens = FISHEYE if model.endswith("FISHEYE") else PERSPECTIVE
    if lens == PERSPECTIVE and any(named.get(key, 0.0) != 0.0 for key in ("k4", "k5", "k6")):
        raise InputError.at(where, "k4 k5 k6", "rational distortion is not supported", "calibrate with OPENCV")
    return Intrinsics(lens, width, height, named)


def posed_camera(where: str, name: str, lens: Intrinsics, pose: Sequence[float]) -> Camera:
    """The camera of a picture.

    Parameters
    ----------
    where
        Its place in the file, for messages.
    name
        The picture's.
    lens
        The camera's.
    pose
        World to camera: quaternion (w, x, y, z), then translation in mm.

    Raises
    ------
    InputError
        If the quaternion is none, or ``Camera`` refuses a value.
    """
    values = lens.values
    return Camera(
        name=name,
        width=lens.width,  # type: ignore[arg-type]  # Camera checks that it is whole
        height=lens.height,  # type: ignore[arg-type]
        fl_x=values.get("f", values.get("fl_x", 0.0)),
        fl_y=values.get("f", values.get("fl_y", 0.0)),
        cx=values["cx"],
        cy=values["cy"],
        camera_to_world=_camera_to_world(where, pose),
        distortion=np.array([values.get(key, 0.0) for key in DISTORTION_KEYS[lens.model]]),
        model=lens.model,
        source=where,
    )


def _camera_to_world(where: str, pose: Sequence[float]) -> Floats:
    quaternion, translation = np.array(pose[:4]), np.array(pose[4:])
    length = np.linalg.norm(quaternion)
    if not abs(length - 1.0) < 1e-3:
        raise InputError.at(where, "QW QX QY QZ", "the quaternion is not of length 1", "export the model again")
    if not np.isfinite(translation).all():
        raise InputError.at(where, "TX TY TZ", "the position is not finite", "export the model again")
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
