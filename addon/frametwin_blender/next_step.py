"""What to do next, as far as the scene shows what has been done."""

from __future__ import annotations

import bpy

from frametwin.blender.display.adapted import find_adapted
from frametwin.blender.display.print_jobs import jobs_in
from frametwin.blender.display.twin_records import load_values

from .steps import plan_of, print_of, rig_of, settings_of, twin_of


def next_step(context: bpy.types.Context) -> str:
    """The next step of the tab, in a sentence."""
    settings, plan, twin = settings_of(context), plan_of(context), twin_of(context)
    if jobs_in(context.scene):
        return "Play the timeline, or step through the batches under Print."
    if twin is not None:
        return _after_fit(twin)
    if settings.fit.capture:
        return "Fit: press Fit to find where every strut is."
    if plan is None:
        return "Plan: add a frame to try things out, or import your own."
    if settings.pictures.rig:
        chosen = "" if settings.pictures.folder else "choose the folder of pictures, then "
        return f"Photographs: {chosen}press Capture from Pictures."
    if rig_of(context) is None:
        bent = print_of(context) is not None
        return "Cameras: press Make Rig." if bent else "Deform: press Deform for a print that sags, then Cameras."
    return "Render: press Render Capture to take the pictures."


def _after_fit(twin: bpy.types.Collection) -> str:
    printed = load_values(twin)[0].get("printed")
    if printed is None or printed.values.all():
        return "Twin: step through the worst struts, then export."
    if find_adapted(twin) is None:
        return "Adapt: press Adapt to move what is still to be printed."
    return "Adapt: export what is still to be printed."
