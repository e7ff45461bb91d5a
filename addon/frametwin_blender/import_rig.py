"""Calibrated cameras of a rig folder, brought into the scene where they stand about the plan."""

# No postponed annotations here: Blender reads them as properties.
from math import degrees
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np

from frametwin.blender.frames.plans import plan_from_object
from frametwin.blender.scene.units import mm_per_unit
from frametwin.blender.views.rigs import replace_rig
from frametwin.cameras.rig_file import FILE_NAME, Rig, read_rig
from frametwin.cameras.standing import standing_at

from .steps import FileStep, plan_of, settings_of
from .views import see


def place_of_plan(context: bpy.types.Context) -> list[float]:
    """Where the plan's origin stands in the robot's base, as the panel says: x, y, z in mm and the turn in degrees."""
    pictures = settings_of(context).pictures
    return [*pictures.place, degrees(pictures.turn)]


def import_rig(context: bpy.types.Context, path: Path) -> str:
    """Put the cameras of a rig into the scene in the place of those before; returns what there is to tell.

    Raises
    ------
    InputError
        If the rig cannot be read, or its world is not the robot's; the scene is left as it was.
    """
    folder = path.parent if path.name == FILE_NAME else path
    rig = read_rig(path)
    settings, plan = settings_of(context), plan_of(context)
    cameras = [camera.straightened().as_camera() for camera in rig.in_plan(standing_at(place_of_plan(context))).cameras]
    frame = None if plan is None else plan_from_object(plan, scene=context.scene)
    settings.rig = replace_rig(settings.rig, cameras, context.scene, frame, name=folder.name)
    settings.pictures.rig = str(folder)
    places = np.array([camera.centre for camera in cameras])
    seen = places if frame is None else np.concatenate([places, frame.vertices])
    see(context, seen / mm_per_unit(context.scene))
    return words_of(rig)


def words_of(rig: Rig) -> str:
    """What there is to say of a rig, in a line."""
    words = [f"{len(rig.cameras)} cameras"]
    words += [f"calibrated {rig.date.partition('T')[0]}"] if rig.date else []
    words += ["with markers on the plate"] if rig.plate is not None else []
    words += [f"{len(rig.notes)} notes in {FILE_NAME}"] if rig.notes else []
    return ", ".join(words)


class FRAMETWIN_OT_import_rig(FileStep, bpy.types.Operator):
    """Read a rig folder or its rig.json, as frametwin calibrate makes it: cameras in the robot's world"""

    bl_idname = "frametwin.import_rig"
    bl_label = "FrameTwin: Import Rig"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="rig.json", options={"HIDDEN"})  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        return import_rig(context, Path(bpy.path.abspath(self.filepath)).absolute())


CLASSES = (FRAMETWIN_OT_import_rig,)
