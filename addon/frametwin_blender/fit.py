"""Step 5, the fit: from a capture to the twin, in the worker."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import ClassVar

import bpy
import numpy as np

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.preview import remove_preview, show_preview
from frametwin.blender.display.twins import RUN_KEY, TwinContent, TwinObjects, show_twin_steps
from frametwin.blender.frames.plan_objects import PlanSummary, add_plan, make_active, points_of, user_is_editing
from frametwin.blender.views.rigs import read_calibration, replace_rig
from frametwin.capture.capture import read_capture
from frametwin.errors import InputError
from frametwin.twin.runs import load_run

from . import session
from .computing import can_compute, worker_job
from .fit_settings import camera_changes, draw_mask, mask_parameters
from .folders import fresh_folder, given_folder, work_folder
from .in_view import hide, twin_shows
from .layouts import ICON, begin, buttons, field
from .plan import take_plan
from .preferences import draw_python
from .recolour import show_colours, wanted_colours
from .setting_presets import FRAMETWIN_PT_fit_presets
from .steps import Panel, Step, draw_progress, needs, settings_of, twin_of, write_text
from .views import see

TITLE = "Fit"
FITTING = ("smooth motion", "smooth motion and cameras", "joints and struts", "fitting")
"""Stages that count their steps together."""

STAGES = {"reading images": (0.0, 0.2), **dict.fromkeys(FITTING, (0.2, 1.0))}


def fit_job(context: bpy.types.Context) -> Job:
    """What the worker has to do, as the panel says.

    Raises
    ------
    FrameTwinError
        If the capture cannot be read, or has not what the panel asks for.
    """
    settings, scene_now = settings_of(context), keep(context.scene)
    capture = given_folder(settings.fit.capture, "Capture")
    content = read_capture(capture)
    out = fresh_folder(work_folder(context), "run")
    parameters = {"capture": capture, "preset": settings.fit.preset, "seed": settings.fit.seed, "hand_over": True}
    parameters |= {**mask_parameters(context), "changes": camera_changes(context, content)}
    if settings.fit.warm:
        parameters["warm_start"] = start_run(context)

    def finish(content: TwinContent) -> Steps:
        scene = scene_now()
        colours = wanted_colours(scene.frametwin.view, content.values)
        shown = yield from show_twin_steps(content, scene=scene, colours=colours)
        take_twin(scene.frametwin, shown)
        if not user_is_editing():
            make_active(shown.twin, select=False)
        return words_of(content)

    return worker_job(
        TITLE,
        "fit",
        parameters,
        finish,
        out=out,
        torch=needs_torch(context),
        stages=STAGES,
        on_curves=lambda curves: show_preview(curves, scene_now()),
        clear=remove_preview,
        load=TwinContent.handed_over,
    )


def needs_torch(context: bpy.types.Context) -> bool:
    """Whether the fit that is set computes with PyTorch."""
    fit = settings_of(context).fit
    return fit.preset != "fast" or (fit.warm and was_fitted_with_torch(context))


def was_fitted_with_torch(context: bpy.types.Context) -> bool:
    """Whether the field in the run folder of the twin that is shown is one of PyTorch."""
    try:
        twin, _ = load_run(Path(start_run(context)))
    except InputError:
        return False  # the fit says what is wrong with it
    return twin.provenance.get("preset", "fast") != "fast"


def start_run(context: bpy.types.Context) -> str:
    """The run folder of the twin that is shown.

    Raises
    ------
    InputError
        If none is shown, or it was not read from a folder.
    """
    twin = twin_of(context)
    folder = "" if twin is None else twin.get(RUN_KEY, "")
    if not folder:
        raise InputError("There is no twin with a run folder to start at: switch Start at This Twin off.")
    return folder


def take_twin(settings: bpy.types.PropertyGroup, shown: TwinObjects) -> None:
    """Make a twin the one that is looked at, in the place of plan and print, by what was looked at before if it can."""
    if settings.view.quantity not in shown.values:
        settings.twin, settings.view.quantity = None, "displacement"
    settings.twin = shown.collection
    show_colours(settings.id_data)
    hide(settings.plan)
    hide(settings.print_object)


def words_of(content: TwinContent) -> str:
    """What a fit found, in a line."""
    moved = content.values["displacement"].values[content.frame.printed]
    faults = [
        f"{len(found)} {name}" for name, found in (("missing", content.missing), ("uncertain", content.uncertain))
    ]
    whole = len(moved) - len(content.missing)
    distance = f"{np.mean(moved):.3g} mm from the plan on average"
    return f"{whole} of {len(moved)} struts found whole, {distance}; {', '.join(faults)}"


def open_capture(context: bpy.types.Context, folder: Path) -> str:
    """Bring the plan and the cameras of a capture into the scene; returns what there is to tell.

    Raises
    ------
    InputError
        If the capture cannot be read; the scene is left as it was.
    """
    settings = settings_of(context)
    capture, cameras = read_capture(folder), read_calibration(folder)
    same = twin_shows(context, capture.frame)
    words = take_plan(context, add_plan(capture.frame, context.scene), PlanSummary.of(capture.frame), keep_twin=same)
    settings.rig = replace_rig(settings.rig, cameras, context.scene, capture.frame)
    see(context, points_of(settings.plan))
    if same:
        hide(settings.plan)  # as where the twin comes out of a fit
    return f"{words}; {len(cameras)} cameras"


def import_run(context: bpy.types.Context, folder: Path) -> str:
    """Show the twin of a run folder; returns what there is to tell.

    Raises
    ------
    InputError
        If the run cannot be read; the scene is left as it was.
    """
    content = TwinContent.read(folder)
    colours = wanted_colours(settings_of(context).view, content.values)
    shown = run_steps(show_twin_steps(content, scene=context.scene, colours=colours))
    take_twin(settings_of(context), shown)
    if not user_is_editing():
        make_active(shown.twin, select=False)
    return words_of(content)


class FRAMETWIN_OT_open_capture(Step, bpy.types.Operator):
    """Bring the plan and the cameras of the capture folder into the scene"""

    bl_idname = "frametwin.open_capture"
    bl_label = "FrameTwin: Open Capture"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, settings_of(context).fit.capture, "Choose a capture folder first")

    def act(self, context: bpy.types.Context) -> str:
        return open_capture(context, given_folder(settings_of(context).fit.capture, "Capture"))


class FRAMETWIN_OT_fit(Step, bpy.types.Operator):
    """Find where every strut of the capture really is; Blender stays free meanwhile"""

    bl_idname = "frametwin.fit"
    bl_label = "FrameTwin: Fit Capture"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, settings_of(context).fit.capture, "Choose or render a capture first") and can_compute(
            cls, settings_of(context).fit.preset != "fast"
        )

    def act(self, context: bpy.types.Context) -> None:
        session.start(fit_job(context))


class FRAMETWIN_OT_import_run(Step, bpy.types.Operator):
    """Show the twin of a run folder, as written by a fit or by the command frametwin fit"""

    bl_idname = "frametwin.import_run"
    bl_label = "FrameTwin: Import Run"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    directory: bpy.props.StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> str:
        return import_run(context, given_folder(self.directory, "Run"))


class FRAMETWIN_PT_fit(Panel, bpy.types.Panel):
    """From pictures to the twin"""

    bl_label = "Fit"
    bl_idname = "FRAMETWIN_PT_fit"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        FRAMETWIN_PT_fit_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context).fit, self.layout
        begin(layout, context)
        if not settings.capture:
            write_text(layout, "Render a capture, or choose a folder with your own pictures.", context, "INFO")
        column = layout.column(align=True)
        field(column, context, settings, "capture")
        field(column, context, settings, "preset")
        if settings.preset != "fast":
            field(column, context, settings, "seed")
        elif twin_of(context) is not None:
            field(column, context, settings, "warm")
        if not draw_progress(layout, context, TITLE):
            draw_python(layout, context, settings.preset != "fast")
            layout.operator("frametwin.fit", text="Fit", icon="MOD_FLUIDSIM")
        row = buttons(layout, context, "Open Capture", "Import Run", more=ICON)
        row.operator("frametwin.open_capture", text="Open Capture", icon="SCENE_DATA")
        row.operator("frametwin.import_run", text="Import Run", icon="IMPORT")


class FRAMETWIN_PT_fit_views(Panel, bpy.types.Panel):
    """How photographs and their cameras are taken"""

    bl_label = "Masks and Cameras"
    bl_idname = "FRAMETWIN_PT_fit_views"
    bl_parent_id = "FRAMETWIN_PT_fit"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context).fit, self.layout
        begin(layout, context)
        draw_mask(layout, context)
        if settings.preset == "fast":
            column = layout.column(align=True)
            field(column, context, settings, "cameras")
            part = column.column(align=True)
            part.enabled = settings.cameras != "exact"
            field(part, context, settings, "anchor")


CLASSES = (
    FRAMETWIN_OT_open_capture,
    FRAMETWIN_OT_fit,
    FRAMETWIN_OT_import_run,
    FRAMETWIN_PT_fit,
    FRAMETWIN_PT_fit_views,
)
