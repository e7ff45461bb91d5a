"""How far the cameras of a rig stand from the frame, changed after the rig was made: each goes along its own view."""

from __future__ import annotations

from dataclasses import replace

import bpy
import mathutils
import numpy as np

from frametwin.blender.scene.units import mm_per_unit
from frametwin.blender.views.cameras import KEY, camera_from_blender, cameras_in
from frametwin.cameras import Camera
from frametwin.geometry.wireframe import Wireframe

DEPTH = "frametwin_depth"
"""Custom property of a camera: its depth before the middle of the frame in mm, at a distance of 1."""

DISTANCE = "frametwin_distance"
"""Custom property of the rig: the distance, as a multiple."""


def remember_distance(
    rig: bpy.types.Collection, cameras: tuple[Camera, ...], target: Wireframe, distance: float
) -> None:
    """Note of a rig that was made about a frame how far it stands from it, so that `set_distance` can change it."""
    points = target.control_points.reshape(-1, 3)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    rig[DISTANCE] = distance
    for obj, camera in zip(cameras_in(rig.all_objects), cameras, strict=True):
        obj[DEPTH] = float((middle - camera.centre) @ camera.forward) / distance


def distance_of(rig: bpy.types.Collection | None) -> float | None:
    """The distance of a rig that was made about a frame; ``None`` of others, such as calibrated ones."""
    distance = None if rig is None else rig.get(DISTANCE)
    return None if distance is None else float(distance)


def set_distance(rig: bpy.types.Collection, distance: float, scene: bpy.types.Scene) -> None:
    """Move the cameras of a rig that was made about a frame, to a multiple of the least distance.

    They end where `frametwin.blender.views.rigs.rig_cameras` would put them, unless the user has moved them: then they
    go as far, from where they are. Of a rig without `DISTANCE` nothing is moved.
    """
    before = distance_of(rig)
    if before is None or distance == before:
        return
    unit = mm_per_unit(scene)
    there = [obj for obj in cameras_in(rig.all_objects) if DEPTH in obj]
    found = [camera_from_blender(obj, scene) for obj in there]
    for obj, camera in zip(there, found, strict=True):
        further = (distance - before) * float(obj[DEPTH])
        pose = camera.camera_to_world.copy()
        pose[:3, 3] -= further * camera.forward
        moved = replace(camera, camera_to_world=pose)
        obj.location += mathutils.Vector(((moved.centre - camera.centre) / unit).tolist())
        obj.data.clip_end += max(further, 0.0) / unit
        obj.data.clip_start = max(obj.data.clip_start + min(further, 0.0) / unit, 1e-4 * obj.data.clip_end)
        if KEY in obj:
            obj[KEY]["camera_to_world"] = pose.ravel()  # in its own digits
    rig[DISTANCE] = distance


def handle_of(obj: bpy.types.Object, scene: bpy.types.Scene) -> tuple[np.ndarray, float] | None:
    """Of a camera with a distance: (4, 4) where that is 0, with the camera's axes, and the Blender units that 1 is."""
    if DEPTH not in obj:
        return None
    reach = float(obj[DEPTH]) / mm_per_unit(scene)
    matrix = np.array(obj.matrix_world.normalized())
    distance = next((distance_of(rig) for rig in obj.users_collection if DISTANCE in rig), None)
    if distance is None:
        return None
    matrix[:3, 3] -= distance * reach * matrix[:3, 2]  # a camera's z points away from what it sees
    return matrix, reach
