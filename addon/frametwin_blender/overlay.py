"""The capture's pictures over the views of its cameras: as they are, their outline, or where the twin differs."""

# No postponed annotations here: Blender reads them as properties.
import shutil
from pathlib import Path
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.twins import RUN_KEY
from frametwin.blender.views.captures import hide_pictures, show_pictures
from frametwin.blender.views.comparisons import has_comparisons, load_comparisons, show_comparisons
from frametwin.errors import InputError

from . import session
from .computing import can_compute, worker_job
from .fit_settings import mask_parameters
from .folders import fresh_folder, given_folder
from .layouts import BUTTON, field, fit
from .properties import OVERLAYS
from .steps import Step, draw_progress, needs, rig_of, settings_of, twin_of, write_text
from .views import look_through_camera

TITLE = "Compare"
STAGES = {"reading images": (0.0, 0.7), "silhouettes": (0.7, 1.0)}


def run_of(context: bpy.types.Context) -> str:
    """The run folder of the twin that is looked at; empty if there is none."""
    twin = twin_of(context)
    return "" if twin is None else str(twin.get(RUN_KEY, ""))


def seen_as(context: bpy.types.Context) -> str:
    """Of what comparisons with the capture are: of the run, by the masks that the panel asks for."""
    masks = mask_parameters(context)
    return " ".join([run_of(context), *(str(value) for value in masks.values() if value != "auto")])


def compare_job(context: bpy.types.Context, mode: str) -> Job:
    """Draw outlines and differences of all views, and show those of one mode.

    Raises
    ------
    InputError
        If there is no capture, or a folder cannot be told.
    """
    capture, run, seen = given_folder(settings_of(context).fit.capture, "Capture"), run_of(context), seen_as(context)
    parameters = {"capture": capture, "run": run, **mask_parameters(context)}
    scene_now = keep(context.scene)
    out = fresh_folder(Path(bpy.app.tempdir), "frametwin-views")

    def finish(answer: dict[str, Any]) -> Steps:
        scene = scene_now()
        load_comparisons(out, str(capture), seen)
        settings = scene.frametwin
        settings.cameras.overlay = mode
        if settings.rig is not None:
            show_comparisons(settings.rig, mode)
        return words_of(answer["views"])
        yield

    def clear() -> None:
        shutil.rmtree(out, ignore_errors=True)

    return worker_job(TITLE, "compare", parameters, finish, out=out, clear=clear, stages=STAGES)


def words_of(views: list[dict[str, Any]]) -> str:
    """How much print and twin differ, in a line."""
    worst = max(views, key=lambda view: view["left_out"] + view["beyond"])
    left_out, beyond = (sum(view[name] for view in views) / len(views) for name in ("left_out", "beyond"))
    return (
        f"{100.0 * left_out:.1f} % of the print is not in the twin,"
        f" {100.0 * beyond:.1f} % of the twin is not in the pictures;"
        f" most in {worst['name']} ({100.0 * worst['left_out']:.1f} % and {100.0 * worst['beyond']:.1f} %)"
    )


class FRAMETWIN_OT_show_pictures(Step, bpy.types.Operator):
    """Show the capture's pictures in the views of its cameras"""

    bl_idname = "frametwin.show_pictures"
    bl_label = "FrameTwin: Overlay Pictures"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    mode: bpy.props.EnumProperty(name="Overlay", items=OVERLAYS)  # type: ignore[valid-type]

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return next(words for key, _, words in OVERLAYS if key == properties.mode)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, rig_of(context), "Make a rig or import cameras first")

    def act(self, context: bpy.types.Context) -> str | None:
        settings, rig = settings_of(context), rig_of(context)
        capture, run = given_folder(settings.fit.capture, "Capture"), run_of(context)
        wanted = settings.cameras
        if self.mode == "picture":
            count = show_pictures(rig, capture, opacity=wanted.opacity, front=wanted.front)
        elif not run:
            raise InputError("There is no twin with a run folder to compare the pictures with: fit the capture first.")
        elif not has_comparisons(str(capture), seen_as(context)):
            if not can_compute(type(self)):
                raise InputError("Something is under way already: wait for it, or cancel it.")
            session.start(compare_job(context, self.mode))
            look_through_camera(context)
            return None
        else:
            count = show_comparisons(rig, self.mode)
        wanted.overlay = self.mode
        look_through_camera(context)
        return f"{count} pictures"


class FRAMETWIN_OT_hide_pictures(Step, bpy.types.Operator):
    """Show no pictures in the views of the cameras"""

    bl_idname = "frametwin.hide_pictures"
    bl_label = "FrameTwin: Hide Pictures"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, rig_of(context), "Make a rig or import cameras first")

    def act(self, context: bpy.types.Context) -> None:
        hide_pictures(rig_of(context))


def overlay_shown(context: bpy.types.Context) -> str:
    """What lies over the views of the rig's cameras: ``picture``, ``outline``, ``difference``, ``mask`` or nothing."""
    rig = rig_of(context)
    cameras = [] if rig is None else [obj.data for obj in rig.all_objects if obj.type == "CAMERA"]
    there = any(len(camera.background_images) and camera.show_background_images for camera in cameras)
    return str(settings_of(context).cameras.overlay) if there else ""


def draw_overlay(layout: bpy.types.UILayout, context: bpy.types.Context, rig: bpy.types.Collection) -> None:
    """A button for each way to lay pictures over the cameras' views, and how they are drawn."""
    wanted, shown = settings_of(context).cameras, overlay_shown(context)
    beside = fit(context, *(name for _, name, _ in OVERLAYS), more=BUTTON / len(OVERLAYS))
    row = layout.row(align=True) if beside else layout.column(align=True)
    for key, name, _ in OVERLAYS:
        row.operator("frametwin.show_pictures", text=name, depress=shown == key).mode = key
    row.operator("frametwin.hide_pictures", text="" if beside else "Hide Pictures", icon="X")
    draw_progress(layout, context, TITLE)
    if shown == "difference":
        write_text(layout, "Orange: print without twin. Blue: twin without print.", context)
    if wanted.overlay == "picture":
        field(layout, context, wanted, "opacity")
        field(layout, context, wanted, "front")


CLASSES = (FRAMETWIN_OT_show_pictures, FRAMETWIN_OT_hide_pictures)
