"""Step 2, the real print: how it sags, how much of it is printed, what is missing."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.prints import copy_to_bend, partly_printed, show_print_steps
from frametwin.blender.frames.described import forget_description
from frametwin.blender.frames.plan_objects import make_active
from frametwin.blender.frames.plans import plan_from_object
from frametwin.blender.scene.placement import label
from frametwin.formats import frame_json

from . import session
from .computing import can_compute, worker_job
from .in_view import hide_for_print
from .layouts import ICON, begin, buttons, field
from .preferences import draw_python
from .setting_presets import FRAMETWIN_PT_deform_presets
from .steps import Panel, Step, draw_progress, draw_shown, needs, plan_of, print_of, settings_of, write_text

TITLE = "Deform"


def sag_job(context: bpy.types.Context) -> Job:
    """What the worker has to do, as the panel says.

    Raises
    ------
    FrameTwinError
        If the plan cannot be read, or nothing of it would be printed.
    """
    settings, scene_now = settings_of(context).deform, keep(context.scene)
    plan_object = plan_of(context)
    frame = plan_from_object(plan_object, scene=context.scene)
    if settings.how != "share":
        frame = partly_printed(frame, settings.how, getattr(settings, settings.how, 1.0))
    wanted = {
        "deformation": settings.kind,
        "seed": settings.seed,
        "missing": settings.missing,
        "missing_share": settings.missing_share,
        **({} if settings.automatic else {"peak": settings.peak}),
        **({"printed": settings.share} if settings.how == "share" else {}),
    }

    def finish(answer: dict[str, Any]) -> Steps:
        scene = scene_now()
        obj = yield from show_print_steps(frame, answer, scene)
        old = scene.frametwin.print_object
        if old is not None and old != scene.frametwin.plan and old.get("frametwin_simulated"):
            forget_description(old)
            bpy.data.objects.remove(old)
        obj["frametwin_simulated"] = True
        scene.frametwin.print_object = obj
        hide_for_print(scene)
        missing = len(answer["missing"])
        return (
            f"{answer['printed']} of {answer['struts']} struts printed"
            f"{f', {missing} not whole' if missing else ''}, moved {answer['largest_displacement']:.3g} mm at most"
        )

    return worker_job(TITLE, "simulate", {"frame": frame_json.to_dict(frame), "settings": wanted}, finish)


class FRAMETWIN_OT_sag(Step, bpy.types.Operator):
    """Compute how the print deviates from the plan, and show it beside the plan"""

    bl_idname = "frametwin.sag"
    bl_label = "FrameTwin: Deform"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context), "Import or add a frame first") and can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        session.start(sag_job(context))


class FRAMETWIN_OT_copy_to_bend(Step, bpy.types.Operator):
    """Make a copy of the plan to bend by hand (Edit Mode) or by modifiers; it becomes the print"""

    bl_idname = "frametwin.copy_to_bend"
    bl_label = "FrameTwin: Bend by Hand"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context), "Import or add a frame first")

    def act(self, context: bpy.types.Context) -> str:
        obj = copy_to_bend(plan_of(context), context.scene)
        make_active(obj)
        settings_of(context).print_object = obj
        hide_for_print(context.scene)
        return f"Bend {label(obj)} in Edit Mode or by modifiers, and render it"


class FRAMETWIN_PT_deform(Panel, bpy.types.Panel):
    """The real print: simulated here, or bent by you"""

    bl_label = "Deform"
    bl_idname = "FRAMETWIN_PT_deform"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        FRAMETWIN_PT_deform_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        if plan_of(context) is None:
            write_text(layout, "Add a plan first. With real pictures, go on to Fit.", context, "INFO")
            return
        settings = settings_of(context).deform
        begin(layout, context)
        column = layout.column(align=True)
        field(column, context, settings, "kind")
        field(column, context, settings, "automatic", "Peak 7 %")
        part = column.column(align=True)
        part.enabled = not settings.automatic
        field(part, context, settings, "peak")
        field(column, context, settings, "seed")
        column = layout.column(align=True)
        field(column, context, settings, "how")
        if settings.how != "all":
            field(column, context, settings, settings.how)
        column = layout.column(align=True)
        field(column, context, settings, "missing")
        if settings.missing:
            field(column, context, settings, "missing_share")
        if not draw_progress(layout, context, TITLE):
            draw_python(layout, context)
            row = buttons(layout, context, "Deform", "By Hand", more=ICON / 2)
            row.operator("frametwin.sag", text="Deform", icon="PHYSICS")
            row.operator("frametwin.copy_to_bend", text="By Hand")
        layout.prop(settings_of(context), "print_object", text="Print")
        if print_of(context) is not None:
            draw_shown(layout, ("Plan", plan_of(context)), ("Print", print_of(context)))


CLASSES = (FRAMETWIN_OT_sag, FRAMETWIN_OT_copy_to_bend, FRAMETWIN_PT_deform)
