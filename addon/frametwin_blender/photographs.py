"""Step 4 with photographs: a rig's pictures and the plan become a capture, and what is seen in them is shown."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.prints import partly_printed
from frametwin.blender.frames.plans import plan_from_object
from frametwin.blender.views.comparisons import MASK
from frametwin.blender.views.rigs import read_calibration, replace_rig
from frametwin.cameras.rig_file import read_rig
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe

from . import masks, session
from .computing import can_compute, worker_job
from .fit_settings import draw_mask
from .folders import fresh_folder, given_folder, work_folder
from .import_rig import place_of_plan
from .layouts import begin, button, field
from .overlay import overlay_shown
from .preferences import draw_python
from .steps import Panel, Step, draw_progress, needs, plan_of, settings_of, write_text

TITLE = "Capture"
STAGES = {"reading pictures": (0.0, 1.0)}


def printed_plan(context: bpy.types.Context) -> Wireframe:
    """The plan with what has been printed of it in the pictures, as the panel says.

    Raises
    ------
    InputError
        If it cannot be read, or nothing of it is printed.
    """
    pictures = settings_of(context).pictures
    plan = plan_from_object(plan_of(context), scene=context.scene)
    if pictures.how == "plan":
        return plan
    return partly_printed(plan, pictures.how, pictures.batch if pictures.how == "batch" else pictures.height)


def capture_job(context: bpy.types.Context) -> Job:
    """Put the rig's pictures together with the plan, as the panel says.

    Raises
    ------
    InputError
        If rig or plan cannot be used, or a folder is not given.
    """
    pictures, scene_now = settings_of(context).pictures, keep(context.scene)
    rig = given_folder(pictures.rig, "Rig")
    read_rig(rig).in_plan()  # told at once rather than by the worker
    frame = printed_plan(context)
    out = fresh_folder(work_folder(context), "capture")
    parameters: dict[str, Any] = {
        "rig": rig,
        "pictures": given_folder(pictures.folder, "Pictures"),
        "frame": frame_json.to_dict(frame),
        "base": place_of_plan(context),
    }
    if pictures.before:
        parameters["background"] = given_folder(pictures.before, "Before")
    if pictures.moment:
        parameters["moment"] = pictures.moment

    def finish(answer: dict[str, Any]) -> Steps:
        scene = scene_now()
        settings = scene.frametwin
        settings.rig = replace_rig(settings.rig, answer["cameras"], scene, frame)
        settings.fit.capture = str(answer["out"])
        return words_of(answer)
        yield

    return worker_job(
        TITLE,
        "capture",
        parameters,
        finish,
        out=out,
        stages=STAGES,
        load=lambda answer: {**answer, "cameras": read_calibration(Path(answer["out"]))},
    )


def words_of(answer: dict[str, Any]) -> str:
    """What became of the pictures, in a line."""
    missing = f"; there is no picture of {', '.join(answer['missing'])}" if answer["missing"] else ""
    return f"{answer['views']} pictures in {answer['out']}{missing}"


class FRAMETWIN_OT_capture_pictures(Step, bpy.types.Operator):
    """Put the pictures of the rig's cameras together with the plan, in a new capture folder; Blender stays free"""

    bl_idname = "frametwin.capture_pictures"
    bl_label = "FrameTwin: Capture from Pictures"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        pictures = settings_of(context).pictures
        return (
            needs(cls, plan_of(context), "Import or add a frame first")
            and needs(cls, pictures.rig, "Import a rig first")
            and needs(cls, pictures.folder, "Choose the folder with the pictures first")
            and can_compute(cls)
        )

    def act(self, context: bpy.types.Context) -> None:
        session.start(capture_job(context))


class FRAMETWIN_PT_photographs(Panel, bpy.types.Panel):
    """Pictures of a real print, by calibrated cameras"""

    bl_label = "Photographs"
    bl_idname = "FRAMETWIN_PT_photographs"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context), self.layout
        pictures = settings.pictures
        begin(layout, context)
        if not pictures.rig:
            write_text(layout, "For pictures of your own: import the rig of calibrated cameras.", context, "INFO")
        column = layout.column(align=True)
        field(column, context, pictures, "rig")
        field(column, context, pictures, "place")
        field(column, context, pictures, "turn")
        imported = button(layout, context, "frametwin.import_rig", "Import Rig", "OUTLINER_OB_CAMERA")
        imported.filepath = pictures.rig
        if pictures.rig:
            self._draw_pictures(layout, context, pictures)
        if not draw_progress(layout, context, TITLE):
            draw_python(layout, context, False)
            button(layout, context, "frametwin.capture_pictures", "Capture from Pictures", "IMAGE_DATA", "Make Capture")
        if settings.fit.capture:
            self._draw_masks(layout, context)

    def _draw_masks(self, layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
        draw_mask(layout, context)
        if draw_progress(layout, context, masks.TITLE):
            return
        shown = overlay_shown(context) == MASK
        layout.operator("frametwin.show_masks", text="Show Masks", icon="MOD_MASK", depress=shown)
        if shown:
            write_text(layout, "Orange: print. Grey: unknown.", context)

    def _draw_pictures(
        self, layout: bpy.types.UILayout, context: bpy.types.Context, pictures: bpy.types.PropertyGroup
    ) -> None:
        column = layout.column(align=True)
        field(column, context, pictures, "folder")
        field(column, context, pictures, "before")
        field(column, context, pictures, "moment")
        column = layout.column(align=True)
        field(column, context, pictures, "how")
        if pictures.how in ("batch", "height"):
            field(column, context, pictures, pictures.how)


CLASSES = (FRAMETWIN_OT_capture_pictures, FRAMETWIN_PT_photographs)
