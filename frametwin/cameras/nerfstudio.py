"""Cameras as ``transforms.json`` has them: nerfstudio's, instant-ngp's, NeRF-synthetic's and Blender exporters'.

References: nerfstudio's documentation, "Data conventions"; instant-ngp's "Tips for training NeRF models". Axes are
OpenGL's, x to the right, y up, and the camera looks along -z.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import checked_array
from frametwin.cameras.camera import DISTORTION_KEYS, FISHEYE, MAX_PIXELS, PERSPECTIVE, Camera
from frametwin.cameras.conversions import OPENGL_AXES
from frametwin.errors import InputError

Floats = NDArray[np.float64]

MODELS = {
    PERSPECTIVE: PERSPECTIVE,
    "PINHOLE": PERSPECTIVE,
    "SIMPLE_PINHOLE": PERSPECTIVE,
    "PERSPECTIVE": PERSPECTIVE,
    "SIMPLE_RADIAL": PERSPECTIVE,
    "RADIAL": PERSPECTIVE,
    "FULL_OPENCV": PERSPECTIVE,
    FISHEYE: FISHEYE,
    "SIMPLE_RADIAL_FISHEYE": FISHEYE,
    "RADIAL_FISHEYE": FISHEYE,
}
"""Names of lens models, and which of ours each is a case of."""

COEFFICIENTS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
LISTED = ("k1", "k2", "k3", "k4", "p1", "p2")
"""The order in which nerfstudio's ``distortion_params`` stand."""

ANGLES = {"camera_angle_x": "fl_x", "camera_angle_y": "fl_y"}
"""Angles of view in radians, and the focal lengths that they tell."""


def to_nerfstudio(camera: Camera, file_path: str) -> dict[str, Any]:
    """One entry of ``frames`` of a nerfstudio ``transforms.json``.

    Parameters
    ----------
    camera
        The camera.
    file_path
        Its picture, relative to the file, with forward slashes.

    Returns
    -------
    ``file_path``, ``transform_matrix`` (4 x 4 camera to world, OpenGL axes, mm), ``fl_x fl_y cx cy w h`` and,
    only for a camera that distorts, its coefficients; ``camera_model`` for a fisheye. The name of the camera is the
    picture's.
    """
    frame: dict[str, Any] = {
        "file_path": file_path,
        "transform_matrix": (camera.camera_to_world @ OPENGL_AXES).tolist(),
        "fl_x": camera.fl_x,
        "fl_y": camera.fl_y,
        "cx": camera.cx,
        "cy": camera.cy,
        "w": camera.width,
        "h": camera.height,
    }
    if camera.model != PERSPECTIVE:
        frame["camera_model"] = camera.model
    if camera.has_distortion:
        frame |= dict(zip(DISTORTION_KEYS[camera.model], camera.distortion.tolist(), strict=True))
    return frame


def transforms_of(cameras: Sequence[Camera], file_paths: Sequence[str]) -> dict[str, Any]:
    """What a nerfstudio ``transforms.json`` tells of cameras: ``camera_model`` and ``frames``.

    The lens model at the top is that of all cameras. Where they have several, each tells its own, and the one at the
    top, which nerfstudio asks for, is ``OPENCV``.

    Parameters
    ----------
    cameras, file_paths
        See `to_nerfstudio`.
    """
    frames = [to_nerfstudio(camera, path) for camera, path in zip(cameras, file_paths, strict=True)]
    models = {camera.model for camera in cameras}
    if len(models) > 1:
        for frame, camera in zip(frames, cameras, strict=True):
            frame["camera_model"] = camera.model
    return {"camera_model": models.pop() if len(models) == 1 else PERSPECTIVE, "frames": frames}


def from_nerfstudio(
    frame: Mapping[str, Any],
    *,
    shared: Mapping[str, Any] | None = None,
    name: str | None = None,
    size: tuple[int, int] | None = None,
    source: str = "transforms.json",
) -> Camera:
    """The camera of one entry of ``frames`` of a ``transforms.json``.

    Intrinsics are ``fl_x fl_y cx cy w h``, or the angle of view ``camera_angle_x``. Beside an angle, pixels are square
    unless there is a ``camera_angle_y``, the principal point is the middle, and the size that of the picture.
    Distortion is ``k1 k2 k3 k4 p1 p2`` one by one, or as a list ``distortion_params``.

    Parameters
    ----------
    frame
        The entry.
    shared
        The top level of the file, whose intrinsics count where the entry has none of its own.
    name
        The camera's name; the entry's ``file_path`` when absent.
    size
        Width and height of the picture in pixels, for files that leave it to the picture.
    source
        File and entry for error messages.

    Raises
    ------
    InputError
        For a missing field, a camera model or coefficient that is neither of OpenCV's perspective nor of its fisheye
        model, or values that ``Camera`` refuses.
    """
    values = _merged(shared or {}, frame, source)
    model = _model(values, source)
    if any(key in values for key in ANGLES):
        _complete(values, size, source)
    for key in ("transform_matrix", "fl_x", "fl_y", "cx", "cy", "w", "h", *COEFFICIENTS):
        # Checked here under the names of the file; Camera knows them by its own.
        if key not in COEFFICIENTS or key in values:
            values[key] = _number(values, key, source) if key != "transform_matrix" else _matrix(values, source)
    keys = DISTORTION_KEYS[model]
    for key in COEFFICIENTS:
        if key not in keys and values.get(key, 0.0) != 0.0:
            remedy = f"calibrate with {' '.join(keys)} only"
            raise InputError.at(source, key, f"the coefficient is not supported with {model}", remedy)
    camera = Camera(
        name=str(values.get("file_path", "camera")) if name is None else name,
        width=values["w"],
        height=values["h"],
        fl_x=values["fl_x"],
        fl_y=values["fl_y"],
        cx=values["cx"],
        cy=values["cy"],
        camera_to_world=values["transform_matrix"],
        distortion=np.array([values.get(key, 0.0) for key in keys]),
        model=model,
        source=source,
    )
    return replace(camera, camera_to_world=camera.camera_to_world @ OPENGL_AXES)


def _merged(shared: Mapping[str, Any], frame: Mapping[str, Any], source: str) -> dict[str, Any]:
    """What holds for a view: its own values over those that all share, whichever way each is written."""
    common, own = (_one_way(level, source) for level in (shared, frame))
    hidden: tuple[str, ...] = ()
    if "distortion_params" in frame:
        hidden += COEFFICIENTS
    if own.keys() & {*ANGLES, *ANGLES.values()}:
        hidden += tuple(ANGLES)
    if own.keys() & ANGLES.keys():
        hidden += tuple(ANGLES.values())
    return {**{key: value for key, value in common.items() if key not in hidden}, **own}


def _one_way(level: Mapping[str, Any], source: str) -> dict[str, Any]:
    """One level of the file with its coefficients one by one, and without angles where focal lengths say more."""
    values = _coefficients_spread(level, source)
    for angle, focal in ANGLES.items():
        if focal in values or "fl_x" in values:
            values.pop(angle, None)
    return values


def _coefficients_spread(level: Mapping[str, Any], source: str) -> dict[str, Any]:
    """The fields of one level of the file, with a list of coefficients as single ones."""
    values = dict(level)
    listed = values.pop("distortion_params", None)
    if listed is None:
        return values
    remedy = f"give the numbers {' '.join(LISTED)}, or {' '.join(LISTED[:4])}"
    numbers = checked_array(listed, "f", (None,), source, "distortion_params", remedy).tolist()
    if len(numbers) not in (4, 6):
        raise InputError.at(source, "distortion_params", f"holds {len(numbers)} numbers", remedy)
    for key, number in zip(LISTED, numbers, strict=False):
        if key in values and values[key] != number:
            raise InputError.at(source, key, "is another number in distortion_params", "leave one of the two")
        values[key] = number
    return values


def _model(values: Mapping[str, Any], source: str) -> str:
    """The lens model by its own name."""
    model = values.get("camera_model", FISHEYE if values.get("is_fisheye") is True else PERSPECTIVE)
    if not isinstance(model, str) or model not in MODELS:
        shown = repr(model) if isinstance(model, str) and len(model) <= 60 else "this one"
        raise InputError.at(source, "camera_model", f"{shown} is not supported", f"use one of {', '.join(MODELS)}")
    return MODELS[model]


def _complete(values: dict[str, Any], size: tuple[int, int] | None, source: str) -> None:
    """Fill in what an angle of view and the picture's size tell."""
    if size is not None:
        values.setdefault("w", size[0])
        values.setdefault("h", size[1])
    width, height = (_number(values, key, source) for key in ("w", "h"))
    for key, side in (("w", width), ("h", height)):
        if not 1 <= side <= MAX_PIXELS:
            raise InputError.at(
                source, key, f"{side:g} is not from 1 to {MAX_PIXELS}", "give the picture size in pixels"
            )
    for (angle, focal), side in zip(ANGLES.items(), (width, height), strict=True):
        if angle not in values:
            continue
        radians = _number(values, angle, source)
        if not 1e-6 < radians < math.pi - 1e-6:
            problem = f"{radians:g} is not an angle of view between 0 and pi"
            raise InputError.at(source, angle, problem, "give it in radians")
        values.setdefault(focal, 0.5 * side / math.tan(0.5 * radians))
    for key, other in (("fl_x", "fl_y"), ("fl_y", "fl_x")):
        values.setdefault(key, values.get(other))
    values.setdefault("cx", 0.5 * width)
    values.setdefault("cy", 0.5 * height)


def _number(values: Mapping[str, Any], key: str, source: str) -> float:
    return float(checked_array(values.get(key), "f", (), source, key))


def _matrix(values: Mapping[str, Any], source: str) -> Floats:
    return checked_array(values.get("transform_matrix"), "f", (4, 4), source, "transform_matrix")
