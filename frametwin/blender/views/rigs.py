"""Rigs of cameras: camera objects in a collection of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from frametwin.blender.scene.collections import new_collection, remove_collection
from frametwin.blender.views.cameras import activate, camera_from_blender, camera_to_blender, cameras_in
from frametwin.cameras import Camera, read_colmap, read_colmap_binary, read_colmap_text
from frametwin.cameras.colmap_binary import BINARY, TEXT
from frametwin.cameras.rigs import RIGS, stepped_back
from frametwin.capture.transforms import read_cameras
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe


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
        The cameras, such as those of `frametwin.cameras.rigs` or `read_colmap`.
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
    frame: Wireframe,
    rig: str = "ring",
    scene: bpy.types.Scene | None = None,
    name: str = "Cameras",
    distance: float = 1.0,
    **settings: object,
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
    distance
        How far away the cameras stand, as a multiple of the least distance from which they see all of the frame.
    settings
        Of `ring_rig` or `dome_rig`: count, size, elevation_deg, fov_deg, margin, start_deg.

    Raises
    ------
    InputError
        For an unknown rig or settings out of range.
    """
    return rig_to_blender(rig_cameras(frame, rig, distance, **settings), scene, name, target=frame)


def replace_rig(
    old: bpy.types.Collection | None,
    cameras: Sequence[Camera],
    scene: bpy.types.Scene,
    target: Wireframe | None = None,
    name: str = "",
) -> bpy.types.Collection:
    """Put cameras into the scene in the place of an earlier rig, under its name or another; see `rig_to_blender`."""
    if old is not None and old in scene.collection.children_recursive:
        name = name or old.name
        remove_collection(old)
    return rig_to_blender(cameras, scene, name or "Cameras", target=target)


def rig_cameras(frame: Wireframe, rig: str = "ring", distance: float = 1.0, **settings: object) -> tuple[Camera, ...]:
    """The cameras of a rig around a frame, not in any scene yet; see `rig_around`."""
    if rig not in RIGS:
        raise InputError.at("rig", "rig", f"{rig!r} is not known", f"give one of {', '.join(RIGS)}")
    return stepped_back(RIGS[rig](frame, **settings), frame, distance)


def read_calibration(path: PathLike) -> tuple[Camera, ...]:
    """Read calibrated cameras.

    Parameters
    ----------
    path
        A ``transforms.json`` (nerfstudio's, poses in mm), a capture folder that holds one, or a folder with a COLMAP
        model (``cameras`` and ``images``, ``.bin`` or ``.txt``) or one of its files.

    Raises
    ------
    InputError
        If it is none of these, or damaged.
    """
    source = Path(path)
    if source.name in (*BINARY, *TEXT):
        kind = read_colmap_binary if source.name in BINARY else read_colmap_text
        return tuple(kind(source.parent))
    if source.is_dir() and not (source / "transforms.json").is_file():
        return tuple(read_colmap(source))
    return read_cameras(source / "transforms.json" if source.is_dir() else source)


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
