"""What the operators and panels of all steps share."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bpy

from frametwin.blender.background.status import Status
from frametwin.blender.scene import visibility
from frametwin.errors import FrameTwinError

from . import session
from .layouts import CHARACTER, ICON, buttons, room
from .text import wrapped
from .translations import CONTEXT, translated


class Step:
    """An operator that calls functions of ``frametwin.blender``; what a user can cause becomes one report in words."""

    bl_translation_context = CONTEXT

    if TYPE_CHECKING:  # an operator's own, in every class that is registered
        report: Callable[[set[str], str], None]

    def act(self, context: bpy.types.Context) -> str | None:
        """Do it; returns what there is to tell, if there is anything."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            words = self.act(context)
        except FrameTwinError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if words:
            self.report({"INFO"}, words)
        return {"FINISHED"}


class FileStep(Step):
    """A `Step` that asks for a file first, unless it has one."""

    if TYPE_CHECKING:
        filepath: str

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.filepath:
            return self.execute(context)
        # A folder alone: of no path at all, Blender would make the name of the .blend file.
        self.filepath = os.path.join(os.path.dirname(bpy.data.filepath) or os.path.expanduser("~"), "")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SaveStep(FileStep):
    """A `FileStep` that writes; the file browser begins with the name of what is written."""

    def default_name(self, context: bpy.types.Context) -> str:
        """The name of the file, without a suffix."""
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            self.filepath = f"{bpy.path.clean_name(self.default_name(context))}.json"
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        return self.execute(context)


class Panel:
    """A panel of the tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "FrameTwin"
    bl_translation_context = CONTEXT


def settings_of(context: bpy.types.Context) -> bpy.types.PropertyGroup:
    """The add-on's settings of the present scene."""
    return context.scene.frametwin


def plan_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The scene's plan; ``None`` if there is none, or the user deleted it."""
    plan = settings_of(context).plan
    return plan if plan is not None and context.scene.objects.get(plan.name) == plan else None


def print_of(context: bpy.types.Context) -> bpy.types.Object | None:
    """The object that shows the real print; ``None`` where it is the plan."""
    obj = settings_of(context).print_object
    return obj if obj is not None and context.scene.objects.get(obj.name) == obj else None


def rig_of(context: bpy.types.Context) -> bpy.types.Collection | None:
    """The scene's rig; ``None`` if there is none, or the user deleted it or its last camera."""
    rig = settings_of(context).rig
    there = rig is not None and rig in context.scene.collection.children_recursive
    return rig if there and any(obj.type == "CAMERA" for obj in rig.all_objects) else None


def twin_of(context: bpy.types.Context) -> bpy.types.Collection | None:
    """The twin that is looked at; ``None`` if there is none, or the user deleted it."""
    twin = settings_of(context).twin
    return twin if twin is not None and twin in context.scene.collection.children_recursive else None


def needs(cls: type[Any], fine: object, otherwise: str) -> bool:
    """The answer of a ``poll``; the sentence is shown in the tooltip of a button that cannot be pressed."""
    if not fine:
        cls.poll_message_set(otherwise)
    return bool(fine)


def is_free(cls: type[Any]) -> bool:
    """Whether no job is under way, as an answer of a ``poll``."""
    return needs(cls, not session.runner.busy, "Something is under way already: wait for it, or cancel it")


def write_text(
    layout: bpy.types.UILayout, text: str, context: bpy.types.Context, icon: str = "NONE", beside: float = 0.0
) -> None:
    """A text on as many lines as the sidebar needs; ``beside`` is what else stands in the row, in pixels.

    A sentence that the catalogue has is translated before it is cut into lines.
    """
    text = translated(text)
    width = room(context) - (ICON if icon != "NONE" else 0) - beside
    column = layout.column(align=True)
    column.scale_y = 0.75
    for i, line in enumerate(wrapped(text, max(8, int(width / CHARACTER)))):
        column.label(text=line, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


def draw_chosen(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, name: str) -> bpy.types.UILayout:
    """A list to choose from, with a toggle that shows or hides what is chosen; the row, for more."""
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(settings, name, text="")
    chosen = getattr(settings, name)
    if chosen is not None:
        draw_eye(row, chosen)
    return row


def draw_eye(
    layout: bpy.types.UILayout, shown: bpy.types.Object | bpy.types.Collection, name: str | None = None
) -> None:
    """A button that shows or hides an object, or all objects of a collection: an eye, or a name that is pressed."""
    layer = bpy.context.view_layer
    whole = isinstance(shown, bpy.types.Collection)
    seen = visibility.is_any_shown(shown, layer) if whole else visibility.is_shown(shown, layer)
    if name is None:
        button = layout.operator("frametwin.show_hide", text="", icon="HIDE_OFF" if seen else "HIDE_ON")
    else:
        button = layout.operator("frametwin.show_hide", text=name, depress=seen)
    button.name, button.collection = shown.name, whole


def draw_shown(layout: bpy.types.UILayout, *objects: tuple[str, bpy.types.Object | None]) -> None:
    """A button for each object that shows or hides it: one below the other where they would be cut off beside."""
    there = [(name, obj) for name, obj in objects if obj is not None]
    row = buttons(layout, bpy.context, *(name for name, _ in there)) if there else layout
    row.use_property_split = False
    for name, obj in there:
        draw_eye(row, obj, name)


def draw_progress(layout: bpy.types.UILayout, context: bpy.types.Context, title: str) -> bool:
    """How far the job of this title is, with a button to cancel it; or how it ended. Whether it is under way."""
    status = session.runner.status
    if status.title != title:
        return False
    if session.runner.busy:
        draw_bar(layout, status.stage or "starting")
        write_text(layout, status.line, context)
        return True
    if status.message:
        write_text(layout, status.message, context, end_icon(status))
    return False


def draw_bar(layout: bpy.types.UILayout, text: str) -> None:
    """How much of the present job is done, as a bar, and a button that cancels it."""
    row = layout.row(align=True)
    row.progress(factor=session.runner.status.overall, text=text)
    row.operator("frametwin.cancel", text="", icon="X")


def end_icon(status: Status) -> str:
    """The icon of how a job ended: no tick for one that was cancelled."""
    return "ERROR" if status.error else "CANCEL" if status.cancelled else "CHECKMARK"
