"""What is taken for print in a capture's pictures, over the views of its cameras, before anything is fitted."""

# No postponed annotations here: Blender reads them as properties.
import shutil
import tempfile
from pathlib import Path
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.keeping import keep
from frametwin.blender.background.runner import Job, Steps
from frametwin.blender.views.captures import next_camera, show_pictures
from frametwin.blender.views.comparisons import MASK, load_comparisons, show_comparisons
from frametwin.blender.views.rigs import read_calibration, replace_rig
from frametwin.capture.capture import read_capture

from . import session
from .computing import can_compute, worker_job
from .fit_settings import mask_parameters
from .folders import given_folder
from .steps import Step, needs, rig_of, settings_of
from .views import look_through_camera

TITLE = "Masks"
STAGES = {"reading images": (0.0, 0.8), "drawing masks": (0.8, 1.0)}


def masks_job(context: bpy.types.Context) -> Job:
    """Look for the print in all pictures of the capture, and show what was found over them.

    Raises
    ------
    InputError
        If there is no capture, or a folder cannot be told.
    """
    parameters = mask_parameters(context)
    capture = given_folder(settings_of(context).fit.capture, "Capture")
    scene_now = keep(context.scene)
    scratch = Path(tempfile.mkdtemp(prefix="frametwin-"))
    out = scratch / "views"

    def finish(answer: dict[str, Any]) -> Steps:
        settings = scene_now().frametwin
        load_comparisons(out, str(capture), "", (MASK,))
        if settings.rig is not None:
            show_comparisons(settings.rig, MASK)
            settings.cameras.overlay = MASK
        return words_of(answer)
        yield

    def clear() -> None:
        shutil.rmtree(scratch, ignore_errors=True)

    parameters["capture"] = capture
    return worker_job(TITLE, "masks", parameters, finish, out=out, clear=clear, stages=STAGES)


def words_of(answer: dict[str, Any]) -> str:
    """Which views can be used, and of each other one why not."""
    views, needed = answer["views"], answer["needed"]
    spoilt = [view for view in views if not view["used"]]
    left = len(views) - len(spoilt)
    if not spoilt:
        return f"All {left} views can be used"
    short = f", and a fit needs {needed}" if left < needed else ""
    named = "; ".join(f"{view['name']} {view['figures']}" for view in spoilt)
    return f"{left} of {len(views)} views can be used{short}; {named}"


def show_photographs(context: bpy.types.Context, capture: Path) -> None:
    """Show the capture's pictures in the views of its cameras, which are made if there is no rig; look through one.

    Raises
    ------
    InputError
        If the capture cannot be read, or no camera of the rig has the name of a picture.
    """
    settings, scene = settings_of(context), context.scene
    if rig_of(context) is None:
        settings.rig = replace_rig(settings.rig, read_calibration(capture), scene, read_capture(capture).frame)
    wanted = settings.cameras
    show_pictures(settings.rig, capture, opacity=wanted.opacity, front=wanted.front)
    wanted.overlay = "picture"
    if scene.camera is None or scene.camera.name not in settings.rig.all_objects:
        next_camera(settings.rig, 1, scene)
    look_through_camera(context)


class FRAMETWIN_OT_show_masks(Step, bpy.types.Operator):
    """Show what is taken for print in the capture's pictures, and name the views that cannot be used"""

    bl_idname = "frametwin.show_masks"
    bl_label = "FrameTwin: Show Masks"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, settings_of(context).fit.capture, "Choose a capture first, or make one") and can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        job = masks_job(context)
        try:
            show_photographs(context, given_folder(settings_of(context).fit.capture, "Capture"))
            session.start(job)
        except BaseException:
            job.clear()
            raise


CLASSES = (FRAMETWIN_OT_show_masks,)
