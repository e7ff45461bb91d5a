"""Two twins, or two batches of a print job, compared: the second is coloured by its distance from the first."""

# No postponed annotations here: Blender reads them as properties.
from typing import ClassVar

import bpy

from frametwin.blender.display.comparing import (
    DIFFERENCE,
    KEY,
    compare_batches,
    compare_twins,
    leave_batches,
)
from frametwin.blender.display.print_jobs import FIRST_FRAME, FRAMES_A_BATCH, batch_shown, jobs_in
from frametwin.blender.display.twins import find_twin, is_twin, recolour_twin, twin_object
from frametwin.errors import InputError

from .compared import draw_comparison
from .in_view import show_twin
from .inspect_struts import fill, table_of
from .recolour import show_colours, wanted_ends, wanted_map
from .steps import Panel, Step, needs, settings_of, twin_of


def other_of(context: bpy.types.Context) -> bpy.types.Collection | None:
    """The twin that the one that is looked at is compared with; ``None`` if there is none, or the user deleted it."""
    other = settings_of(context).view.other
    there = is_twin(other) and other in context.scene.collection.children_recursive
    return other if there and other != twin_of(context) else None


class FRAMETWIN_OT_compare_twins(Step, bpy.types.Operator):
    """Colour the twin by how far each point of its struts is from the same strut of the other twin"""

    bl_idname = "frametwin.compare_twins"
    bl_label = "FrameTwin: Compare Twins"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, twin_of(context), "Fit a capture or import a run first") and needs(
            cls, other_of(context), "Choose another twin to compare with: fit or import a second run"
        )

    def act(self, context: bpy.types.Context) -> str:
        collection, view = twin_of(context), settings_of(context).view
        found = compare_twins(find_twin(other_of(context)), find_twin(collection))
        if table_of(context) is not None:
            fill(context)
        if view.quantity != DIFFERENCE:
            view.quantity = DIFFERENCE
        recolour_twin(collection, DIFFERENCE, *wanted_ends(view), wanted_map(view))
        show_twin(collection, context.view_layer)
        return found.words


class _BatchesStep(Step):
    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        some = any(len(job.children) > 1 for job in jobs_in(context.scene))
        return needs(cls, some, "Show or simulate a job of at least two batches first")


class FRAMETWIN_OT_compare_batches(_BatchesStep, bpy.types.Operator):
    """Colour what stands after the second batch by how far it is from where it stood after the first"""

    bl_idname = "frametwin.compare_batches"
    bl_label = "FrameTwin: Compare Batches"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> str:
        wanted, scene = settings_of(context).print, context.scene
        jobs = [job for job in jobs_in(scene) if len(job.children) > max(wanted.first_batch, wanted.second_batch)]
        if not jobs:
            raise InputError("No job that is shown has so many batches: choose lower numbers.")
        for job in jobs:
            leave_batches(job)
        found = [f"{job.name}: {compare_batches(job, wanted.first_batch, wanted.second_batch).words}" for job in jobs]
        show_colours(scene)
        scene.frame_set(FIRST_FRAME + wanted.second_batch * FRAMES_A_BATCH)
        return ". ".join(found)


class FRAMETWIN_OT_leave_batches(_BatchesStep, bpy.types.Operator):
    """Colour all batches by their displacement from the design again"""

    bl_idname = "frametwin.leave_batches"
    bl_label = "FrameTwin: End Comparison of Batches"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def act(self, context: bpy.types.Context) -> None:
        for job in jobs_in(context.scene):
            leave_batches(job)


class FRAMETWIN_PT_compare(Panel, bpy.types.Panel):
    """How far the twin is from another one"""

    bl_label = "Compare"
    bl_idname = "FRAMETWIN_PT_compare"
    bl_parent_id = "FRAMETWIN_PT_twin"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return twin_of(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.prop(settings_of(context).view, "other")
        layout.operator("frametwin.compare_twins", text="Compare", icon="ARROW_LEFTRIGHT")
        draw_comparison(layout, context, twin_object(twin_of(context)))


class FRAMETWIN_PT_compare_batches(Panel, bpy.types.Panel):
    """How far what stands is from where it stood before"""

    bl_label = "Compare Batches"
    bl_idname = "FRAMETWIN_PT_compare_batches"
    bl_parent_id = "FRAMETWIN_PT_print"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return any(len(job.children) > 1 for job in jobs_in(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, settings_of(context).print
        row = layout.row(align=True)
        row.prop(settings, "first_batch", text="From")
        row.prop(settings, "second_batch", text="To")
        row = layout.row(align=True)
        row.operator("frametwin.compare_batches", text="Compare", icon="ARROW_LEFTRIGHT")
        row.operator("frametwin.leave_batches", text="", icon="X")
        for job in jobs_in(context.scene):
            batch = batch_shown(job, context.scene.frame_current)
            for obj in () if batch is None else batch.objects:
                if KEY in obj:
                    layout.label(text=job.name, translate=False)
                    draw_comparison(layout, context, obj)


CLASSES = (
    FRAMETWIN_OT_compare_twins,
    FRAMETWIN_OT_compare_batches,
    FRAMETWIN_OT_leave_batches,
    FRAMETWIN_PT_compare,
    FRAMETWIN_PT_compare_batches,
)
