"""Cameras of nerfstudio (OpenGL axes) and Blender as plain numbers, exact both ways."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import checked_array
from frametwin.cameras.camera import Camera
from frametwin.errors import InputError

Floats = NDArray[np.float64]

OPENGL_AXES = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL and Blender look along -z with y up
DISTORTION_KEYS = ("k1", "k2", "p1", "p2", "k3")
NUMBERS = ("fl_x", "fl_y", "cx", "cy", "w", "h", *DISTORTION_KEYS)
NERFSTUDIO_SHAPES: dict[str, tuple[int, ...]] = {"transform_matrix": (4, 4), **dict.fromkeys(NUMBERS, ())}
PERSPECTIVE_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE")
SENSOR_FITS = ("AUTO", "HORIZONTAL", "VERTICAL")


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
    only for a camera that distorts, ``k1 k2 p1 p2 k3``. The name of the camera is the picture's.
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
    if camera.has_distortion:
        frame |= dict(zip(DISTORTION_KEYS, camera.distortion.tolist(), strict=True))
    return frame


def from_nerfstudio(
    frame: Mapping[str, Any],
    *,
    shared: Mapping[str, Any] | None = None,
    name: str | None = None,
    source: str = "transforms.json",
) -> Camera:
    """The camera of one entry of ``frames`` of a nerfstudio ``transforms.json``.

    Parameters
    ----------
    frame
        The entry.
    shared
        The top level of the file, whose intrinsics count where the entry has none of its own.
    name
        The camera's name; the entry's ``file_path`` when absent.
    source
        File and entry for error messages.

    Raises
    ------
    InputError
        For a missing field, a camera model or coefficient that is not OpenCV's perspective one, or values
        that ``Camera`` refuses.
    """
    values = {**(shared or {}), **frame}
    for key, shape in NERFSTUDIO_SHAPES.items():
        # Checked here under the names of the file; Camera knows them by its own.
        if key not in DISTORTION_KEYS or key in values:
            values[key] = checked_array(values.get(key), "f", shape, source, key)
    model = values.get("camera_model", "OPENCV")
    if model not in PERSPECTIVE_MODELS:
        raise InputError.at(
            source,
            "camera_model",
            f"{model!r} is not supported",
            f"use one of {', '.join(PERSPECTIVE_MODELS)}",
        )
    for key in ("k4", "k5", "k6"):
        if values.get(key, 0) != 0:
            raise InputError.at(source, key, "the coefficient is not supported", "calibrate with k1 k2 p1 p2 k3 only")
    pinhole = Camera(
        name=str(values.get("file_path", "camera")) if name is None else name,
        width=values["w"],
        height=values["h"],
        fl_x=values["fl_x"],
        fl_y=values["fl_y"],
        cx=values["cx"],
        cy=values["cy"],
        camera_to_world=values["transform_matrix"],
        distortion=np.array([values.get(key, 0.0) for key in DISTORTION_KEYS]),
        source=source,
    )
    return replace(pinhole, camera_to_world=pinhole.camera_to_world @ OPENGL_AXES)


@dataclass(frozen=True, eq=False)
class BlenderCamera:
    """A Blender camera and the render settings that belong to it, as plain numbers.

    Attributes
    ----------
    matrix_world
        (4, 4) of the camera object, mm; the camera looks along its -z axis with y up.
    lens
        Focal length in mm.
    sensor_width, sensor_height
        Sensor size in mm; which one counts is up to ``sensor_fit``.
    sensor_fit
        "AUTO", "HORIZONTAL" or "VERTICAL", as in Blender.
    shift_x, shift_y
        Lens shift as a share of the fitted side.
    resolution_x, resolution_y
        Picture size in pixels (at 100 %).
    pixel_aspect_x, pixel_aspect_y
        Render settings of these names; 1 for square pixels.
    """

    matrix_world: Floats
    lens: float
    sensor_width: float
    sensor_height: float
    sensor_fit: str
    shift_x: float
    shift_y: float
    resolution_x: int
    resolution_y: int
    pixel_aspect_x: float = 1.0
    pixel_aspect_y: float = 1.0


def to_blender(camera: Camera, *, sensor_width: float = 36.0) -> BlenderCamera:
    """Settings with which Blender renders the picture of the camera.

    Parameters
    ----------
    camera
        A camera without distortion, which Blender's camera does not have.
    sensor_width
        Mm, free to choose; ``lens`` follows from it.

    Returns
    -------
    Settings with the fit "HORIZONTAL". Pixels are square when ``fl_x == fl_y``.

    Raises
    ------
    InputError
        If the camera distorts.
    """
    if camera.has_distortion:
        raise InputError.at(
            f"camera {camera.name}", "distortion", "Blender cannot render it", "use without_distortion()"
        )
    ratio = camera.fl_x / camera.fl_y  # height of a pixel over its width
    return BlenderCamera(
        matrix_world=camera.camera_to_world @ OPENGL_AXES,
        lens=camera.fl_x * sensor_width / camera.width,
        sensor_width=sensor_width,
        sensor_height=sensor_width * camera.height / camera.width,
        sensor_fit="HORIZONTAL",
        shift_x=(camera.width / 2.0 - camera.cx) / camera.width,
        shift_y=(camera.cy - camera.height / 2.0) * ratio / camera.width,
        resolution_x=camera.width,
        resolution_y=camera.height,
        pixel_aspect_x=max(1.0, 1.0 / ratio),  # Blender keeps both at 1 or above
        pixel_aspect_y=max(1.0, ratio),
    )


def from_blender(blender: BlenderCamera, name: str) -> Camera:
    """The camera that Blender's settings describe.

    Parameters
    ----------
    blender
        The settings. A scale of the object is not allowed for, apply it first.
    name
        The camera's name.

    Raises
    ------
    InputError
        For an unknown ``sensor_fit`` or values that ``Camera`` refuses.
    """
    if blender.sensor_fit not in SENSOR_FITS:
        raise InputError.at(
            f"camera {name}",
            "sensor_fit",
            f"{blender.sensor_fit!r} is not known",
            f"use one of {', '.join(SENSOR_FITS)}",
        )
    width, height = blender.resolution_x, blender.resolution_y
    ratio = blender.pixel_aspect_y / blender.pixel_aspect_x
    wide = blender.sensor_fit == "HORIZONTAL" or (blender.sensor_fit == "AUTO" and width >= ratio * height)
    sensor = blender.sensor_height if blender.sensor_fit == "VERTICAL" else blender.sensor_width
    side = width if wide else ratio * height  # the fitted side, in widths of a pixel
    focal = blender.lens * side / sensor
    camera = Camera(
        name=name,
        width=width,
        height=height,
        fl_x=focal,
        fl_y=focal / ratio,
        cx=width / 2.0 - blender.shift_x * side,
        cy=height / 2.0 + blender.shift_y * side / ratio,
        camera_to_world=blender.matrix_world,
        source=f"camera {name}",
    )
    return replace(camera, camera_to_world=camera.camera_to_world @ OPENGL_AXES)
