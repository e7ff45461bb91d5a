"""Step 4, the pictures: all cameras of the rig, into a capture folder, by a second Blender."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.child import blender_worker
from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.prints import read_print
from frametwin.blender.views.captures import capture_parameters

from . import session
from .cameras import cameras_of
from .folders import fresh_folder, work_folder
from .layouts import begin, field
from .steps import Panel, Step, draw_progress, is_free, needs, plan_of, print_of, rig_of, settings_of, write_text

TITLE = "Render"


def render_job(context: bpy.types.Context) -> Job:
    """What the second Blender has to do, as the panel says.

    Raises
    ------
    FrameTwinError
        If plan, print or cameras cannot be read.
    """
    settings, scene = settings_of(context), keep(context.scene)
    out = fresh_folder(work_folder(context), "capture")
    real = read_print(plan_of(context), print_of(context), context.scene)
    parameters = capture_parameters(
        real,
        cameras_of(context),
        out,
        style=settings.render.style,
        samples=settings.render.samples,
        seed=settings.deform.seed,
    )

    def finish(answer: dict[str, Any]) -> Steps:
        scene().frametwin.fit.capture = answer["out"]
        return f"{answer['views']} pictures in {answer['out']}"
        yield

    return Job(
        title=TITLE,
        request="render-capture",
        parameters=parameters,
        worker=blender_worker,
        kind=None,
        finish=finish,
        out=out,
    )


class FRAMETWIN_OT_render(Step, bpy.types.Operator):
    """Render all cameras of the rig into a new capture folder, with plan, cameras and truth; Blender stays free"""

    bl_idname = "frametwin.render"
    bl_label = "FrameTwin: Render Capture"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            needs(cls, plan_of(context), "Import or add a frame first")
            and needs(cls, rig_of(context), "Make a rig or import cameras first")
            and is_free(cls)
        )

    def act(self, context: bpy.types.Context) -> None:
        session.start(render_job(context))


class FRAMETWIN_PT_render(Panel, bpy.types.Panel):
    """Pictures of the print, from all cameras"""

    bl_label = "Render"
    bl_idname = "FRAMETWIN_PT_render"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context).render, self.layout
        if plan_of(context) is None or rig_of(context) is None:
            write_text(layout, "Needs a plan and cameras. With real pictures, go on to Photographs.", context, "INFO")
            return
        begin(layout, context)
        column = layout.column(align=True)
        field(column, context, settings, "style")
        if settings.style == "photo":
            field(column, context, settings, "samples")
        field(column, context, settings, "folder")
        if not settings.folder:
            write_text(layout, f"Into {work_folder(context)}", context)
        if not draw_progress(layout, context, TITLE):
            layout.operator("frametwin.render", text="Render Capture", icon="RENDER_STILL")


CLASSES = (FRAMETWIN_OT_render, FRAMETWIN_PT_render)
