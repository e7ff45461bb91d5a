"""A print job on the timeline: of each batch what was planned, what stands, what comes next, what would have missed."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import bpy
import numpy as np

from frametwin.blender.display.colouring import colour_struts
from frametwin.blender.display.colours import Legend, State, colour_map
from frametwin.blender.display.display_group import remove_unused_display
from frametwin.blender.display.job_struts import show_struts_steps
from frametwin.blender.display.stage import AZIMUTH
from frametwin.blender.display.statistics import StrutValues
from frametwin.blender.scene.collections import new_collection, remove_collection
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.history import BatchHistory, PrintHistory, joint_displacement

JOB_KEY = "frametwin_job"
ROLE_KEY = "frametwin_job_role"
WORDS_KEY = "frametwin_job_words"
NOT_RENDERED = ("plan", "next")
"""Roles of what only viewports show."""

FRAMES_A_BATCH = 24
FIRST_FRAME = 1
SPACING = 1.15
"""Distance between two jobs side by side, in widths of the design."""


@dataclass(frozen=True, eq=False)
class JobObjects:
    """A job in the scene: its collection, with one for each batch inside, and what the colours mean."""

    collection: bpy.types.Collection
    batches: tuple[bpy.types.Collection, ...]
    legend: Legend


def show_job_steps(
    history: PrintHistory, scene: bpy.types.Scene, *, folder: str = "", place: int = 0, top: float | None = None
) -> Generator[None, None, JobObjects]:
    """Put a job on the timeline, a second of it (`FRAMES_A_BATCH` frames) for each batch.

    In each batch are shown, and hidden in the others: ``plan`` (the plan that the robot follows, thin),
    ``standing`` (what stands afterwards, coloured by how far its joints are from the design), ``next`` (what is still
    to be printed, as adapted), ``missed`` (struts of the batch that would have been begun beside the material as
    designed) and ``lost`` (struts that fell, where they should have been).

    Parameters
    ----------
    history
        The job.
    scene
        Where to; its timeline is lengthened, and gets a marker for each batch.
    folder
        The job's folder, to be remembered.
    place
        0, 1 ...: jobs side by side are shifted by a width of the design each.
    top
        Upper end of the colours in mm; the job's largest displacement by default.

    Raises
    ------
    InputError
        If the frames do not fit each other.
    """
    suffix = "" if history.adapts else " without adaptation"
    collection = new_collection(f"{history.name} print{suffix}", scene)
    top = max(history.largest_displacement, 1e-6) if top is None else top
    shift = place_shift(history.design, place)
    shown = []
    try:
        for batch in history.batches:
            inner = new_collection(f"batch {batch.batch}{suffix}", scene, collection)
            legend = yield from _show_batch(history.design, batch, inner, scene, shift, top, history.adapts)
            inner[WORDS_KEY] = words_of(batch, history.design)
            _on_timeline(inner, batch.batch, batch.batch == len(history.batches) - 1)
            shown.append(inner)
        collection[JOB_KEY], collection[ROLE_KEY] = folder, "job"
        _mark_timeline(scene, len(shown))
    except BaseException:
        remove_job(collection)
        raise
    return JobObjects(collection, tuple(shown), legend)


def place_shift(design: Wireframe, place: int) -> np.ndarray:
    """(4, 4) in mm: how far a job is moved aside, by its place among others, for who looks from `AZIMUTH`."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    shift = np.eye(4)
    shift[:3, 3] = place * SPACING * float(np.ptp(design.control_points.reshape(-1, 3) @ right)) * right
    return shift


def _show_batch(
    design: Wireframe,
    batch: BatchHistory,
    collection: bpy.types.Collection,
    scene: bpy.types.Scene,
    shift: np.ndarray,
    top: float,
    adapts: bool,
) -> Generator[None, None, Legend]:
    stands = batch.standing.printed
    lost, missed = (np.isin(np.arange(design.strut_count), struts) for struts in (batch.lost, batch.missed))
    everywhere = np.ones(design.strut_count, dtype=bool)
    moved = joint_displacement(design, batch.standing)[design.edges].mean(axis=1)
    values = StrutValues("displacement", "mm", moved[stands])
    legend = Legend("displacement", "mm", 0.0, top, colour_map())
    for frame, mask, role, state in (
        (batch.planned, everywhere, "plan", State.PLAN),
        (batch.standing, stands, "standing", State.PRINTED),
        (batch.adapted, ~batch.adapted.printed & ~lost, "next", State.NEXT if adapts else State.UNPRINTED),
        (design, missed, "missed", State.MISSED),
        (batch.planned, lost, "lost", State.LOST),
    ):
        if not mask.any():
            continue
        part, plan = (each.subset(mask)[0].transformed(shift) for each in (frame, design))
        measured = {values.quantity: values} if state == State.PRINTED else {}
        obj = yield from show_struts_steps(
            part, plan, state, f"{role} {batch.batch}", collection, scene, strut=np.flatnonzero(mask), values=measured
        )
        obj[ROLE_KEY] = role
        if state == State.PRINTED:
            legend = colour_struts(obj, values, 0.0, top)
    return legend


def words_of(batch: BatchHistory, design: Wireframe) -> str:
    """What there is to say of a batch, in a line."""
    moved = joint_displacement(design, batch.standing)
    words = [
        f"{len(batch.laid)} laid",
        f"{int(batch.standing.printed.sum())} stand",
        f"{moved.max():.2f} mm off at most",
    ]
    if len(batch.missed):
        words.append(f"{len(batch.missed)} would have missed")
    if len(batch.lost):
        words.append(f"{len(batch.lost)} lost")
    return ", ".join(words) + (": collapsed" if batch.collapsed else "")


def batch_shown(collection: bpy.types.Collection, frame: int) -> bpy.types.Collection | None:
    """The collection of the batch of a job that is shown at a frame of the timeline, the last one from then on."""
    children = list(collection.children)
    return children[min(batch_at(frame), len(children) - 1)] if children else None


def _on_timeline(collection: bpy.types.Collection, batch: int, last: bool) -> None:
    """Show a batch's objects at its own time alone; the last one from then on."""
    for obj in collection.objects:
        show_at(obj, batch, last, rendered=obj[ROLE_KEY] not in NOT_RENDERED)


def show_at(obj: bpy.types.Object, batch: int, last: bool, rendered: bool = True) -> None:
    """Show an object only while a batch is on the timeline, or from then on if it is the last one."""
    begin = FIRST_FRAME + batch * FRAMES_A_BATCH
    for frame, hidden in ((FIRST_FRAME - 1, True), (begin, False), (begin + FRAMES_A_BATCH, True)):
        if last and frame > begin:
            continue
        obj.hide_viewport, obj.hide_render = hidden, hidden or not rendered
        for field in ("hide_viewport", "hide_render"):
            obj.keyframe_insert(field, frame=frame)


def _mark_timeline(scene: bpy.types.Scene, batches: int) -> None:
    end = FIRST_FRAME + batches * FRAMES_A_BATCH - 1
    scene.frame_start, scene.frame_end = FIRST_FRAME, max(end, scene.frame_end if _marked(scene) else end)
    there = set(_marked(scene))
    for batch in range(batches):
        name = f"batch {batch}"
        if name not in there:
            scene.timeline_markers.new(name, frame=FIRST_FRAME + batch * FRAMES_A_BATCH)
    scene.frame_set(scene.frame_current)


def _marked(scene: bpy.types.Scene) -> list[str]:
    return [marker.name for marker in scene.timeline_markers if marker.name.startswith("batch ")]


def jobs_in(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    """The collections of jobs in a scene, in their order."""
    return [found for found in scene.collection.children_recursive if found.get(ROLE_KEY) == "job"]


def batch_at(frame: int) -> int:
    """The batch that is shown at a frame of the timeline."""
    return max(0, (frame - FIRST_FRAME) // FRAMES_A_BATCH)


def remove_job(collection: bpy.types.Collection) -> None:
    """Remove a job's collection with all in it, and the markers of the timeline when it was the last one."""
    scenes = [scene for scene in bpy.data.scenes if collection in scene.collection.children_recursive]
    remove_collection(collection)
    remove_unused_display()
    for scene in scenes:
        if not jobs_in(scene):
            for marker in [marker for marker in scene.timeline_markers if marker.name.startswith("batch ")]:
                scene.timeline_markers.remove(marker)
