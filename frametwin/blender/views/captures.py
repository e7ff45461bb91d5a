"""Captures from a scene: what has to be rendered, in the words of the worker's job ``render-capture``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from frametwin.blender.display.prints import ScenePrint
from frametwin.blender.views.backgrounds import add_background
from frametwin.blender.views.cameras import activate, cameras_in
from frametwin.cameras import Camera
from frametwin.capture.capture import read_capture
from frametwin.capture.scene import PhotoLook, Scene, to_dict
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.formats import frame_json

PICTURE = "frametwin_picture"
"""Custom property of a camera: the picture that was shown of it last, whatever lies over its view now."""


def capture_parameters(
    real: ScenePrint,
    cameras: Sequence[Camera],
    out: PathLike,
    *,
    style: str = "mask",
    samples: int = 8,
    seed: int = 0,
    engine: str = "auto",
) -> dict[str, Any]:
    """What the job ``render-capture`` has to know.

    Parameters
    ----------
    real
        The plan, the real geometry, and what is there of it.
    cameras
        Of the rig; their distortion is left out, since Blender cannot render it.
    out
        The capture folder to be.
    style, engine
        See `frametwin.capture.scene.Scene`.
    samples, seed
        Of photos.

    Raises
    ------
    InputError
        If a setting is out of range or camera names are no file names.
    """
    thickness = np.repeat(real.truth.radius[:, None], 2, axis=1)
    pinholes = tuple(camera.without_distortion() for camera in cameras)
    look = PhotoLook(samples=samples, seed=seed)
    scene = Scene(real.truth, real.present, thickness, pinholes, style, engine=engine, look=look)
    plan = replace(real.plan, source="plan")
    return {"scene": to_dict(scene), "plan": frame_json.to_dict(plan), "out": str(Path(out).absolute())}


def show_pictures(collection: bpy.types.Collection, capture: PathLike, *, opacity: float, front: bool) -> int:
    """Show the pictures of a capture behind or before what the rig's cameras of the same names see; how many fit.

    Raises
    ------
    InputError
        If the capture cannot be read, or no camera has the name of a picture.
    """
    pictures = {view.image.path.stem: view.image.path for view in read_capture(capture).views}
    found = 0
    for obj in cameras_in(collection.all_objects):
        names = (obj.name, str(obj.get("frametwin", {}).get("name", "")))
        picture = next((pictures[name] for name in names if name in pictures), None)
        if picture is not None:
            obj[PICTURE] = add_background(obj, picture, opacity=opacity, front=front).image
            found += 1
    if not found:
        remedy = f"import the cameras of {capture}, or name them {', '.join(sorted(pictures)[:3])} ..."
        raise InputError.at(f"collection {collection.name}", "cameras", "none has the name of a picture", remedy)
    return found


def restyle_pictures(collection: bpy.types.Collection, *, opacity: float, front: bool) -> None:
    """Change how the pictures that `show_pictures` has shown are drawn."""
    for obj in cameras_in(collection.all_objects):
        for shown in obj.data.background_images:
            shown.alpha, shown.display_depth = opacity, "FRONT" if front else "BACK"


def hide_pictures(collection: bpy.types.Collection) -> None:
    """Show no pictures in the views of the rig's cameras."""
    for obj in cameras_in(collection.all_objects):
        obj.data.background_images.clear()
        obj.data.show_background_images = False


def next_camera(collection: bpy.types.Collection, step: int, scene: bpy.types.Scene) -> bpy.types.Object:
    """Make the scene's camera the rig's next one (``step`` 1) or the one before it (-1); the first if it was none.

    Raises
    ------
    InputError
        If the collection has no camera.
    """
    cameras = sorted(cameras_in(collection.all_objects), key=lambda obj: obj.name)
    if not cameras:
        remedy = "make a rig, or import cameras"
        raise InputError.at(f"collection {collection.name}", "cameras", "there is none", remedy)
    at = cameras.index(scene.camera) + step if scene.camera in cameras else 0
    camera = cameras[at % len(cameras)]
    activate(camera, scene)
    return camera
