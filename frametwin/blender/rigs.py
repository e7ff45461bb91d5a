"""Rigs of cameras: camera objects in a collection of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy

from frametwin.blender.cameras import activate, camera_from_blender, camera_to_blender, cameras_in
from frametwin.blender.collections import new_collection
from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.rigs import dome_rig, ring_rig
from frametwin.wireframe import Wireframe

RIGS: dict[str, Callable[..., tuple[Camera, ...]]] = {"ring": ring_rig, "dome": dome_rig}
"""Rigs that can be put around a frame, by name."""


def rig_to_blender(
    cameras: Sequence[Camera],
    scene: bpy.types.Scene | None = None,
    name: str = "Cameras",
    *,
    target: Wireframe | None = None,
) -> bpy.types.Collection:
    """Make camera objects in a collection of their own.

    Parameters
    ----------
    cameras
        The cameras, such as those of `frametwin.rigs` or `read_colmap_text`.
    scene
        Where to; the current one by default.
    name
        Of the collection; Blender numbers it if the name is taken.
    target
        The frame for their clip ranges, see `camera_to_blender`.

    Returns
    -------
    The collection. If the scene had no camera, the first one is activated.

    Raises
    ------
    InputError
        If there is no camera.
    """
    if not cameras:
        raise InputError.at(name, "cameras", "there is none", "give at least one camera")
    scene = bpy.context.scene if scene is None else scene
    collection = new_collection(name, scene)
    objects = [camera_to_blender(camera, scene, collection, target=target) for camera in cameras]
    if scene.camera is None:
        activate(objects[0], scene)
    return collection


def rig_around(
    frame: Wireframe, rig: str = "ring", scene: bpy.types.Scene | None = None, name: str = "Cameras", **settings: object
) -> bpy.types.Collection:
    """Put a rig of cameras around a frame.

    Parameters
    ----------
    frame
        The frame, such as `plan_from_object` of the selected one.
    rig
        One of `RIGS`.
    scene, name
        See `rig_to_blender`.
    settings
        Of `ring_rig` or `dome_rig`: count, size, elevation_deg, fov_deg, margin, start_deg.

    Raises
    ------
    InputError
        For an unknown rig or settings out of range.
    """
    if rig not in RIGS:
        raise InputError.at("rig", "rig", f"{rig!r} is not known", f"give one of {', '.join(RIGS)}")
    return rig_to_blender(RIGS[rig](frame, **settings), scene, name, target=frame)


def cameras_from_collection(
    collection: bpy.types.Collection, scene: bpy.types.Scene | None = None
) -> tuple[Camera, ...]:
    """Read the cameras of a collection and of those inside of it, in their order.

    Raises
    ------
    InputError
        If there is none, or see `camera_from_blender`.
    """
    objects = cameras_in(collection.all_objects)
    if not objects:
        raise InputError.at(
            f"collection {collection.name}", "cameras", "there is none", "put the cameras into it, or make a rig"
        )
    return tuple(camera_from_blender(obj, scene) for obj in objects)
