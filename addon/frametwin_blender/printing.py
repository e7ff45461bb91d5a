"""Below step 7: a whole print, batch by batch on the timeline, simulated or with a robot."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.display.print_jobs import WORDS_KEY, batch_shown, jobs_in, remove_job, show_job_steps
from frametwin.blender.frames.plans import plan_from_object
from frametwin.errors import InputError
from frametwin.formats import frame_json
from frametwin.printing.records.history import PrintHistory, read_history

from . import session
from .computing import can_compute, worker_job
from .fit import FITTING
from .folders import fresh_folder, given_folder, work_folder
from .jobs_in_view import come_back, hide_for_jobs, name_of, remember, show_whole
from .layouts import begin, buttons, field
from .preferences import draw_python
from .steps import Panel, Step, draw_progress, is_free, needs, plan_of, settings_of, write_text

TITLE = "Print"
PLANNING = {
    "looking for collisions": (0.0, 0.6),
    "ordering the struts": (0.6, 0.7),
    "comparing orders": (0.7, 1.0),
}
PRINTING = {
    "looking for collisions": (0.0, 0.03),
    "ordering the struts": (0.03, 0.04),
    "comparing orders": (0.04, 0.06),
    "printing": (0.06, 1.0),
}
ANSWERING = {"reading images": (0.0, 0.3), **dict.fromkeys(FITTING, (0.3, 1.0))}
MODES = {"both": ("adapt", "blind"), "adapt": ("adapt",), "blind": ("blind",), "compensate": ("compensate",)}


def simulation_jobs(context: bpy.types.Context) -> Job:
    """Print the plan without a robot in the ways that the panel says, one after the other, and show them side by side.

    Raises
    ------
    FrameTwinError
        If the plan cannot be read.
    """
    settings, scene_now = settings_of(context).print, keep(context.scene)
    frame = frame_json.to_dict(plan_from_object(plan_of(context), scene=context.scene))
    modes, parent = MODES[settings.mode], work_folder(context)
    top: list[float] = []
    told: list[str] = []
    plan = _plan_of(settings)

    def job(place: int) -> Job:
        mode = modes[place]
        out = fresh_folder(parent, "print")
        adapt = mode != "blind"
        steered = {"adapt": adapt, "reprint": adapt, "compensate": mode == "compensate"}
        wanted = {"plan": {**plan, **steered}, "print": {"draw": as_typed(settings.pull)}, "seed": settings.seed}

        def finish(found: tuple[dict[str, Any], PrintHistory]) -> Steps:
            scene, (answer, history) = scene_now(), found
            remember(scene)
            if place == 0:
                for old in jobs_in(scene):
                    remove_job(old)
                top.append(history.largest_displacement)
            shown = yield from show_job_steps(history, scene, folder=str(out), place=place, top=top[0])
            shown.collection.name = name_of(history, out, mode)
            scene.frametwin.print.job = str(out)
            hide_for_jobs(scene)
            show_whole(scene)
            told.append(f"{dict(adapt='Adapted', blind='As designed').get(mode, 'Compensated')}: {words_of(answer)}")
            return ". ".join(told)

        return worker_job(
            TITLE,
            "print-simulate",
            {"frame": frame, "settings": wanted, "whole": True},
            finish,
            out=out,
            load=lambda answer: (answer, read_history(answer["out"])),
            stages=PRINTING,
            part=(place, len(modes)),
            then=(lambda: job(place + 1)) if place + 1 < len(modes) else None,
        )

    return job(0)


def _plan_of(settings: bpy.types.PropertyGroup) -> dict[str, Any]:
    """What the panel says of the order and the speed, as options of a plan; a count of 0 leaves an option as it is."""
    counts = ("batch_size", "coupon", "supports")
    order = {name: value for name in counts if (value := int(getattr(settings, name)))}
    return {**order, "waypoints": {"speed": as_typed(settings.speed)}}


def as_typed(value: float) -> float:
    """A number of the panel, which Blender keeps in single precision, as it was typed."""
    return float(f"{value:.6g}")


def words_of(answer: dict) -> str:
    """How a simulated print ended, in a line."""
    if answer["completed"]:
        return f"finished, all {answer['struts']} struts stand, {answer['mean_deviation']:.2f} mm from the design"
    if answer["collapsed_at_batch"] is not None:
        return f"collapsed in batch {answer['collapsed_at_batch']}"
    return answer["held"] or f"{answer['lost'][-1]} struts were lost"


def show_job(context: bpy.types.Context) -> Job:
    """Put a job folder on the timeline.

    Raises
    ------
    InputError
        If no folder is given.
    """
    scene_now = keep(context.scene)
    folder = given_folder(settings_of(context).print.job, "Job")

    def finish(history: PrintHistory) -> Steps:
        scene = scene_now()
        remember(scene)
        place = len(jobs_in(scene))
        shown = yield from show_job_steps(history, scene, folder=str(folder), place=place)
        shown.collection.name = name_of(history, folder)
        hide_for_jobs(scene)
        show_whole(scene)
        return f"{len(history.batches)} batches on the timeline"

    return Job(title=TITLE, load=lambda _: read_history(folder), finish=finish)


def plan_print_job(context: bpy.types.Context) -> Job:
    """Order the plan's struts and write a job for the robot.

    Raises
    ------
    FrameTwinError
        If the plan cannot be read.
    """
    settings, scene_now = settings_of(context).print, keep(context.scene)
    out = fresh_folder(work_folder(context), "print")
    wanted = _plan_of(settings)
    frame = frame_json.to_dict(plan_from_object(plan_of(context), scene=context.scene))

    def finish(answer: dict[str, Any]) -> Steps:
        scene_now().frametwin.print.job = str(answer["out"])
        return f"Job {answer['out']}: print its first batch, take the pictures, then Fit and Adapt"
        yield

    return worker_job(TITLE, "print-plan", {"frame": frame, "settings": wanted}, finish, out=out, stages=PLANNING)


def answer_job(context: bpy.types.Context) -> Job:
    """Answer the batch that was printed last, from the pictures in the capture folder.

    Raises
    ------
    InputError
        If a folder is not given.
    """
    settings, scene_now = settings_of(context), keep(context.scene)
    folder = given_folder(settings.print.job, "Job")
    capture = given_folder(settings.fit.capture, "Capture")

    def finish(found: tuple[dict[str, Any], PrintHistory]) -> Steps:
        scene, (answer, history) = scene_now(), found
        remember(scene)
        for old in jobs_in(scene):
            remove_job(old)
        shown = yield from show_job_steps(history, scene, folder=str(folder))
        shown.collection.name = name_of(history, folder)
        hide_for_jobs(scene)
        show_whole(scene)
        return f"Batch {answer['batch']} answered; the next waypoints are in {folder}"

    return worker_job(
        TITLE,
        "print-next",
        {"job": folder, "capture": capture},
        finish,
        load=lambda answer: (answer, read_history(folder)),
        stages=ANSWERING,
    )


class _PlanStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, plan_of(context), "Import or add a frame first") and can_compute(cls)


class FRAMETWIN_OT_simulate_print(_PlanStep, bpy.types.Operator):
    """Print the plan without a robot, sagging as it grows, and put every batch on the timeline"""

    bl_idname = "frametwin.simulate_print"
    bl_label = "FrameTwin: Simulate Print"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> None:
        session.start(simulation_jobs(context))


class FRAMETWIN_OT_plan_print(_PlanStep, bpy.types.Operator):
    """Find an order for the plan's struts and write a job with the first batch's waypoints for the robot"""

    bl_idname = "frametwin.plan_print"
    bl_label = "FrameTwin: New Print Job"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> None:
        session.start(plan_print_job(context))


class _JobStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, settings_of(context).print.job, "Choose the folder of a job first") and is_free(cls)


class FRAMETWIN_OT_answer_print(_JobStep, bpy.types.Operator):
    """Find the twin of the batch that was printed last, move what follows, and write the next waypoints"""

    bl_idname = "frametwin.answer_print"
    bl_label = "FrameTwin: Fit and Adapt Batch"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        capture = settings_of(context).fit.capture
        chosen = needs(cls, capture, "Choose the batch's pictures first (Fit > Capture)")
        return chosen and super().poll(context) and can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        session.start(answer_job(context))


class FRAMETWIN_OT_show_job(_JobStep, bpy.types.Operator):
    """Put the batches of a job on the timeline, beside jobs that are shown already"""

    bl_idname = "frametwin.show_job"
    bl_label = "FrameTwin: Show Print Job"
    bl_options: ClassVar = {"REGISTER"}

    def act(self, context: bpy.types.Context) -> None:
        session.start(show_job(context))


class _ShownStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, jobs_in(context.scene), "Show or simulate a job first")


class FRAMETWIN_OT_step_batch(_ShownStep, bpy.types.Operator):
    """Go to the next batch on the timeline, or the one before"""

    bl_idname = "frametwin.step_batch"
    bl_label = "FrameTwin: Next Batch"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    step: bpy.props.IntProperty(default=1)  # type: ignore[valid-type]

    def act(self, context: bpy.types.Context) -> str:
        scene = context.scene
        frames = sorted(marker.frame for marker in scene.timeline_markers if marker.name.startswith("batch "))
        past = [frame for frame in frames if frame <= scene.frame_current]
        at = max(0, min(len(frames) - 1, len(past) - 1 + self.step))
        if not frames:
            raise InputError("The timeline has no batches any more: show the job again.")
        scene.frame_set(frames[at])
        return f"Batch {at}"


class FRAMETWIN_OT_remove_jobs(_ShownStep, bpy.types.Operator):
    """Take all jobs out of the scene and show what was there before them; their folders stay on disk"""

    bl_idname = "frametwin.remove_jobs"
    bl_label = "FrameTwin: Remove Print Jobs"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        for collection in jobs_in(context.scene):
            remove_job(collection)
        come_back(context)


class FRAMETWIN_PT_print(Panel, bpy.types.Panel):
    """A whole print, batch by batch"""

    bl_label = "Print"
    bl_idname = "FRAMETWIN_PT_print"
    bl_parent_id = "FRAMETWIN_PT_adapt"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = settings_of(context).print, self.layout
        begin(layout, context)
        if plan_of(context) is None:
            write_text(layout, "Add a plan to print it here, or show the folder of a job.", context, "INFO")
        column = layout.column(align=True)
        field(column, context, settings, "mode")
        field(column, context, settings, "seed")
        field(column, context, settings, "batch_size")
        field(column, context, settings, "coupon")
        field(column, context, settings, "supports")
        field(column, context, settings, "speed")
        field(column, context, settings, "pull")
        if not draw_progress(layout, context, TITLE):
            draw_python(layout, context)
            layout.operator("frametwin.simulate_print", text="Simulate Print", icon="PLAY")
        column = layout.column(align=True)
        field(column, context, settings, "job")
        row = buttons(column, context, "New Job", "Fit and Adapt", "Show Job")
        row.operator("frametwin.plan_print", text="New Job")
        row.operator("frametwin.answer_print", text="Fit and Adapt")
        row.operator("frametwin.show_job", text="Show Job")
        self._draw_jobs(layout, context)

    def _draw_jobs(self, layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
        jobs = jobs_in(context.scene)
        if not jobs:
            return
        row = layout.row(align=True)
        row.operator("frametwin.step_batch", text="", icon="TRIA_LEFT").step = -1
        batch = batch_shown(jobs[0], context.scene.frame_current)
        row.label(text=batch.name if batch is not None else "Batch")
        row.operator("frametwin.step_batch", text="", icon="TRIA_RIGHT").step = 1
        row.operator("frametwin.remove_jobs", text="", icon="X")
        for job in jobs:
            batch = batch_shown(job, context.scene.frame_current)
            if batch is not None:
                write_text(layout, f"{job.name}: {batch.get(WORDS_KEY, '')}", context)


CLASSES = (
    FRAMETWIN_OT_simulate_print,
    FRAMETWIN_OT_plan_print,
    FRAMETWIN_OT_answer_print,
    FRAMETWIN_OT_show_job,
    FRAMETWIN_OT_step_batch,
    FRAMETWIN_OT_remove_jobs,
    FRAMETWIN_PT_print,
)
