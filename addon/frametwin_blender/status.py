"""What is under way, in Blender's status bar and at the top of the tab: how far it is, Esc, and how it ended."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.status import Status

from . import session
from .layouts import BUTTON
from .next_step import next_step
from .steps import Panel, draw_bar, end_icon, write_text

LONGEST = 120
"""Most characters of how a job ended in the status bar; the panel has all of them."""

BAR = 18
"""Width of the bar in the status bar, in widths of a button."""

_keys: list[tuple[Any, Any]] = []


class FRAMETWIN_OT_cancel_by_key(bpy.types.Operator):
    """Stop what FrameTwin has under way"""

    bl_idname = "frametwin.cancel_by_key"
    bl_label = "FrameTwin: Cancel"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return session.runner.busy

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.screen is not None and context.screen.is_animation_playing:
            return {"PASS_THROUGH"}  # Esc stops what plays first
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.runner.cancel()
        return {"FINISHED"}


class FRAMETWIN_OT_dismiss(bpy.types.Operator):
    """Take this notice away"""

    bl_idname = "frametwin.dismiss"
    bl_label = "FrameTwin: Dismiss Notice"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not session.runner.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.runner.status = Status()
        session.redraw()
        return {"FINISHED"}


def draw_in_status_bar(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """The present job with its bar and what Esc does, or how the last one ended, until that is dismissed."""
    installer, status = session.installer, session.runner.status
    if session.runner.busy:
        row = header.layout.row(align=True)
        row.ui_units_x = BAR
        draw_bar(row, status.overall_line)
        header.layout.label(text="Cancel", icon="EVENT_ESC")
    elif installer is not None and installer.running:
        row = header.layout.row(align=True)
        row.ui_units_x = BAR
        row.progress(factor=(installer.number + 0.5) / installer.total, text=f"Set Up: {installer.stage}")
        row.operator("frametwin.cancel_set_up", text="", icon="X")
    elif status.message:
        row = header.layout.row(align=True)
        row.label(text=notice(status), icon=end_icon(status))
        row.operator("frametwin.dismiss", text="", icon="X", emboss=False)
    else:
        return
    header.layout.separator(factor=2.0)


def notice(status: Status) -> str:
    """How a job ended, in one line that fits."""
    words = f"{status.title}: {status.message}"
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 4].rstrip()} ..."


class FRAMETWIN_PT_status(Panel, bpy.types.Panel):
    """What is under way or how it ended, and what to do next"""

    bl_label = "Status"
    bl_idname = "FRAMETWIN_PT_status"
    bl_options: ClassVar = {"HIDE_HEADER"}
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        status = session.runner.status
        if session.runner.busy:
            draw_bar(self.layout, status.title)
            write_text(self.layout, status.overall_line, context)
            return
        if status.message:
            row = self.layout.row()
            write_text(row, f"{status.title}: {status.message}", context, end_icon(status), BUTTON)
            row.operator("frametwin.dismiss", text="", icon="X", emboss=False)
        row = self.layout.row()
        write_text(row, next_step(context), context, "FORWARD", BUTTON)
        row.operator("frametwin.show_help", text="", icon="HELP", emboss=False)


def register() -> None:
    """Begin to draw into the status bar, and listen to Esc."""
    bpy.types.STATUSBAR_HT_header.prepend(draw_in_status_bar)
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is not None:  # there is none without a window
        keymap = keys.keymaps.new(name="Window", space_type="EMPTY")
        _keys.append((keymap, keymap.keymap_items.new("frametwin.cancel_by_key", "ESC", "PRESS")))


def unregister() -> None:
    """End both."""
    bpy.types.STATUSBAR_HT_header.remove(draw_in_status_bar)
    for keymap, item in _keys:
        keymap.keymap_items.remove(item)
    _keys.clear()


CLASSES = (FRAMETWIN_OT_cancel_by_key, FRAMETWIN_OT_dismiss, FRAMETWIN_PT_status)
