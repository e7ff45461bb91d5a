"""Cameras of Blender as plain numbers, exact both ways."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.cameras.camera import Camera
from frametwin.errors import InputError

Floats = NDArray[np.float64]

OPENGL_AXES = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL and Blender look along -z with y up
SENSOR_FITS = ("AUTO", "HORIZONTAL", "VERTICAL")


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
