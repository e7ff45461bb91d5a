"""Step 7, what is still to be printed: moved to meet the twin."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.adapted import find_adapted, show_adapted_steps
from frametwin.blender.display.display_inputs import GHOST
from frametwin.blender.display.exports import export_struts
from frametwin.blender.display.twins import find_twin
from frametwin.errors import InputError

from . import session
from .computing import can_compute, worker_job
from .display_inputs import draw_input
from .file_formats import FORMATS, UNIT_ITEMS, FrameExport
from .fit import start_run, was_fitted_with_torch
from .preferences import draw_python
from .steps import Panel, Step, draw_progress, draw_shown, needs, twin_of, write_text

TITLE = "Adapt"


def adapt_job(context: bpy.types.Context) -> Job:
    """What the worker has to do.

    Raises
    ------
    FrameTwinError
        If the twin has no run folder, or nothing is left to print.
    """
    collection = twin_of(context)
    collection_now, scene_now = keep(collection), keep(context.scene)
    frame = find_twin(collection).plan()
    if frame.printed.all():
        remedy = "fit a capture in which struts are still to be printed (Deform > Printed)"
        raise InputError(f"All struts of {frame.name} are printed, so nothing is left to adapt: {remedy}.")

    def finish(answer: dict[str, Any]) -> Steps:
        yield from show_adapted_steps(frame, answer, collection_now(), scene_now())
        return (
            f"{answer['moved']} of {len(answer['struts'])} struts to print are moved,"
            f" by {answer['largest_displacement']:.3g} mm at most"
        )

    return worker_job(TITLE, "adapt", {"run": start_run(context)}, finish, torch=was_fitted_with_torch(context))


class FRAMETWIN_OT_adapt(Step, bpy.types.Operator):
    """Move the struts that are still to be printed so that they meet the twin, and show them before and after"""

    bl_idname = "frametwin.adapt"
    bl_label = "FrameTwin: Adapt to the Twin"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, twin_of(context), "Fit a capture or import a run first") and can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        session.start(adapt_job(context))


class FRAMETWIN_OT_export_adapted(FrameExport, bpy.types.Operator):
    """Write the struts that are still to be printed, as they shall be: a frame file (.json) or lines (.obj)"""

    bl_idname = "frametwin.export_adapted"
    bl_label = "FrameTwin: Export Adapted Struts"
    bl_options: ClassVar = {"REGISTER"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.json;*.obj", options={"HIDDEN"})  # type: ignore[valid-type]
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})  # type: ignore[valid-type]
    format: bpy.props.EnumProperty(name="Format", items=FORMATS[:2])  # type: ignore[valid-type]
    unit: bpy.props.EnumProperty(name="Unit", description="Of the lines", items=UNIT_ITEMS)  # type: ignore[valid-type]

    def default_name(self, context: bpy.types.Context) -> str:
        return find_adapted(twin_of(context)).struts.name

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        twin = twin_of(context)
        return needs(cls, twin is not None and find_adapted(twin), "Press Adapt first")

    def act(self, context: bpy.types.Context) -> str:
        path = Path(bpy.path.abspath(self.filepath))
        export_struts(find_adapted(twin_of(context)).struts, path, self.unit)
        return f"Wrote {path}"


class FRAMETWIN_PT_adapt(Panel, bpy.types.Panel):
    """What is still to be printed"""

    bl_label = "Adapt"
    bl_idname = "FRAMETWIN_PT_adapt"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, twin = self.layout, twin_of(context)
        if twin is None:
            write_text(layout, "Fit a partly printed frame first; then its other struts are moved.", context, "INFO")
            return
        if not draw_progress(layout, context, TITLE):
            draw_python(layout, context)
            layout.operator("frametwin.adapt", text="Adapt", icon="MOD_CURVE")
        adapted = find_adapted(twin)
        if adapted is not None:
            draw_shown(layout, ("Adapted", adapted.struts))
            draw_input(layout, adapted.struts, GHOST, "Planned", toggle=True)
            layout.operator("frametwin.export_adapted", text="Export Adapted", icon="EXPORT")


CLASSES = (FRAMETWIN_OT_adapt, FRAMETWIN_OT_export_adapted, FRAMETWIN_PT_adapt)
