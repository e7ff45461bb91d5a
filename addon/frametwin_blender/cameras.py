"""Step 3, the cameras: a rig around the frame, or the calibrated ones of a capture."""

# No postponed annotations here: Blender reads them as properties.
from math import degrees
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np

from frametwin.blender.display.prints import read_print
from frametwin.blender.scene.units import mm_per_unit
from frametwin.blender.views.captures import PICTURE, next_camera, show_pictures
from frametwin.blender.views.rig_distance import remember_distance
from frametwin.blender.views.rigs import cameras_from_collection, read_calibration, replace_rig, rig_cameras
from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe

from .folders import given_folder
from .layouts import ICON, begin, buttons, field
from .overlay import draw_overlay
from .setting_presets import FRAMETWIN_PT_rig_presets
from .steps import FileStep, Panel, Step, needs, plan_of, print_of, rig_of, settings_of, write_text
from .views import (
    change_picture,
    close_picture,
    look_through_camera,
    picture_editor,
    see,
    show_picture_beside,
)


def wanted_cameras(context: bpy.types.Context) -> tuple[tuple[Camera, ...], Wireframe]:
    """Cameras as the panel says, and the frame that they look at: the plan and the print together.

    Raises
    ------
    FrameTwinError
        If plan or print cannot be read, or a setting is out of range.
    """
    settings = settings_of(context).cameras
    real = read_print(plan_of(context), print_of(context), context.scene)
    both = Wireframe.create(
        [*real.plan.vertices, *real.truth.vertices],
        [*real.plan.edges, *(real.truth.edges + real.plan.vertex_count)],
        control_points=[*real.plan.control_points, *real.truth.control_points],
        radius=float(real.plan.radius.max()),
    )
    low, high = sorted((settings.low, settings.high))
    cameras = rig_cameras(
        both,
        settings.kind,
        settings.distance,
        count=settings.count,
        size=(settings.height, settings.width),
        elevation_deg=(degrees(low), degrees(high)),
        fov_deg=degrees(settings.lens),
    )
    return cameras, both


class FRAMETWIN_OT_make_rig(Step, bpy.types.Operator):
    """Put cameras around the frame, in the place of the rig that is there"""

    bl_idname = "frametwin.make_rig"
    bl_label = "FrameTwin: Make Rig"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context), "Import or add a frame first")

    def act(self, context: bpy.types.Context) -> str:
        cameras, target = wanted_cameras(context)
        settings = settings_of(context)
        settings.rig = replace_rig(settings.rig, cameras, context.scene, target)
        remember_distance(settings.rig, cameras, target, settings.cameras.distance)
        places = np.array([camera.centre for camera in cameras])
        see(context, np.concatenate([places, target.vertices]) / mm_per_unit(context.scene))
        return f"{len(cameras)} cameras"


def import_cameras(context: bpy.types.Context, path: Path) -> str:
    """Put calibrated cameras into the scene in the place of the rig; returns what there is to tell.

    Raises
    ------
    InputError
        If the file cannot be read; the scene is left as it was.
    """
    cameras = read_calibration(path)
    settings = settings_of(context)
    settings.rig = replace_rig(settings.rig, cameras, context.scene)
    return f"{len(cameras)} cameras"


class FRAMETWIN_OT_import_cameras(FileStep, bpy.types.Operator):
    """Read calibrated cameras: transforms.json (nerfstudio, in mm), or cameras and images (COLMAP, .txt or .bin)"""

    bl_idname = "frametwin.import_cameras"
    bl_label = "FrameTwin: Import Cameras"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.json;*.txt;*.bin", options={"HIDDEN"})  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        return import_cameras(context, Path(bpy.path.abspath(self.filepath)))


class _RigStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, rig_of(context), "Make a rig or import cameras first")


class FRAMETWIN_OT_step_camera(_RigStep, bpy.types.Operator):
    """Look through the next camera of the rig, or the one before"""

    bl_idname = "frametwin.step_camera"
    bl_label = "FrameTwin: Next Camera"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    step: bpy.props.IntProperty(default=1)  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        rig = rig_of(context)
        editor = picture_editor(context, pictures_of(rig))
        camera = next_camera(rig, self.step, context.scene)
        look_through_camera(context)
        if editor is not None:
            change_picture(context, editor, next(iter(pictures_of(rig, camera)), None))
        return camera.name


def pictures_of(rig: bpy.types.Collection, camera: bpy.types.Object | None = None) -> list[bpy.types.Image]:
    """The pictures that the rig's cameras have, or one of them."""
    cameras = [obj for obj in rig.all_objects if obj.type == "CAMERA"] if camera is None else [camera]
    return [obj[PICTURE] for obj in cameras if isinstance(obj.get(PICTURE), bpy.types.Image)]


class FRAMETWIN_OT_picture_beside(_RigStep, bpy.types.Operator):
    """Show the picture of the present camera in an image editor beside the 3D view; once more closes it"""

    bl_idname = "frametwin.picture_beside"
    bl_label = "FrameTwin: Picture Side by Side"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> str:
        settings, scene = settings_of(context), context.scene
        capture = given_folder(settings.fit.capture, "Capture")
        rig = rig_of(context)
        editor = picture_editor(context, pictures_of(rig))
        if editor is not None:
            close_picture(context, editor)
            return "The picture is closed"
        if scene.camera is None or scene.camera.name not in rig.all_objects:
            next_camera(rig, 1, scene)
        show_pictures(rig, capture, opacity=settings.cameras.opacity, front=settings.cameras.front)
        settings.cameras.overlay = "picture"
        shown = scene.camera.data.background_images
        if not len(shown):
            raise InputError(f"The capture has no picture of {scene.camera.name}: step to another camera.")
        scene.camera.data.show_background_images = False
        if not show_picture_beside(context, shown[0].image):
            raise InputError("There is no 3D view to divide: open one, or use Overlay.")
        return shown[0].image.name


class FRAMETWIN_PT_cameras(Panel, bpy.types.Panel):
    """Where the pictures are taken from"""

    bl_label = "Cameras"
    bl_idname = "FRAMETWIN_PT_cameras"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        FRAMETWIN_PT_rig_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context), self.layout
        wanted, rig = settings.cameras, rig_of(context)
        begin(layout, context)
        if plan_of(context) is None:
            write_text(layout, "Add a plan to put a rig around it, or import calibrated cameras.", context, "INFO")
        else:
            column = layout.column(align=True)
            field(column, context, wanted, "kind")
            field(column, context, wanted, "count")
            field(column, context, wanted, "distance")
            column = layout.column(align=True)
            field(column, context, wanted, "low")
            field(column, context, wanted, "high")
            field(column, context, wanted, "lens")
            column = layout.column(align=True)
            field(column, context, wanted, "width")
            field(column, context, wanted, "height")
        made = "Replace Rig" if rig else "Make Rig"
        row = buttons(layout, context, made, "Import", more=ICON)
        row.operator("frametwin.make_rig", text=made, icon="OUTLINER_OB_CAMERA")
        row.operator("frametwin.import_cameras", text="Import", icon="IMPORT")
        if rig is not None:
            self._draw_rig(layout, context, rig)

    def _draw_rig(self, layout: bpy.types.UILayout, context: bpy.types.Context, rig: bpy.types.Collection) -> None:
        camera = context.scene.camera
        row = layout.row(align=True)
        row.operator("frametwin.step_camera", text="", icon="TRIA_LEFT").step = -1
        inside = camera is not None and camera.name in rig.all_objects
        row.operator("frametwin.step_camera", text=camera.name if inside else "Look Through").step = 1
        row.operator("frametwin.step_camera", text="", icon="TRIA_RIGHT").step = 1
        if settings_of(context).fit.capture:
            beside = picture_editor(context, pictures_of(rig)) is not None
            layout.operator("frametwin.picture_beside", text="Side by Side", depress=beside)
            draw_overlay(layout.column(align=True), context, rig)


def cameras_of(context: bpy.types.Context) -> tuple[Camera, ...]:
    """The cameras of the scene's rig.

    Raises
    ------
    FrameTwinError
        If one of them cannot be read.
    """
    return cameras_from_collection(rig_of(context), context.scene)


CLASSES = (
    FRAMETWIN_OT_make_rig,
    FRAMETWIN_OT_import_cameras,
    FRAMETWIN_OT_step_camera,
    FRAMETWIN_OT_picture_beside,
    FRAMETWIN_PT_cameras,
)
