"""Set Up: an environment with PyTorch, for the presets that need it. An edition without the network lacks this file."""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import ClassVar

import bpy

from frametwin.errors import InputError
from frametwin.worker.installation import Installation, Installer

from . import session
from .computing import environment_folder, forget, preferences_of, set_up_python
from .steps import Step, needs, write_text

COST = "about 400 MB to load, 1.6 GB on the disk, three minutes"
LOG = "FrameTwin Set Up"
INDEX = Installation.__dataclass_fields__["torch_index"].default


def draw_set_up(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What Set Up is for and what it costs, its button, how far it is, and how it ended."""
    preferences, installer = preferences_of(), session.installer
    layout.label(text="PyTorch", icon="PACKAGE")
    write_text(layout, f"Only the presets other than Fast need it: {COST}.", context)
    layout.prop(preferences, "base")
    layout.prop(preferences, "torch_index")
    row = layout.row(align=True)
    row.operator("frametwin.set_up", icon="IMPORT", text="Repair" if set_up_python() else "Set Up")
    if not bpy.app.online_access:
        row.operator("extensions.userpref_allow_online", text="Allow Online Access", icon="INTERNET")
    if installer is None:
        return
    if installer.running:
        draw_set_up_progress(layout)
    elif installer.done:
        write_text(layout, "The environment is ready.", context, "CHECKMARK")
    elif installer.error:
        write_text(layout, installer.error, context, "ERROR")
    else:
        write_text(layout, "Cancelled; nothing is left of it.", context)
    column = layout.column(align=True)
    column.scale_y = 0.75
    for line in [line for line in list(installer.log) if line.strip()][-6:]:
        column.label(text=line[-110:])
    layout.operator("frametwin.show_set_up_log", text="Whole Log as Text", icon="TEXT")


def draw_set_up_progress(layout: bpy.types.UILayout) -> None:
    """How far the set-up that is under way is, with a button to cancel it."""
    installer = session.installer
    if installer is None:
        return
    row = layout.row(align=True)
    row.progress(factor=(installer.number + 0.5) / installer.total, text=f"Set Up: {installer.stage}")
    row.operator("frametwin.cancel_set_up", text="", icon="X")


def bundled(pattern: str) -> Path:
    """A file that came with the extension.

    Raises
    ------
    InputError
        If it is not there.
    """
    folder = Path(__file__).resolve().parent
    found = sorted(folder.glob(pattern))
    if not found:
        remedy = "install the extension from its zip"
        raise InputError.at(folder / pattern, "file", "is missing, since this is no built extension", remedy)
    return found[-1]


def use_environment() -> None:
    """Let the environment that was just made be the one in use; called once when Set Up has ended well."""
    preferences_of().python = ""
    forget()


class FRAMETWIN_OT_set_up(Step, bpy.types.Operator):
    """Make a Python environment with PyTorch in this extension's folder, anew if there is one: about 1.6 GB"""

    bl_idname = "frametwin.set_up"
    bl_label = "FrameTwin: Set Up PyTorch"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        online = needs(cls, bpy.app.online_access, "Allow online access in Preferences > System > Network first")
        running = session.installer is not None and session.installer.running
        under_way = f"{session.runner.status.title} is under way: wait for it, or cancel it, before you set up"
        return (
            online
            and needs(cls, not running, "The set-up is under way")
            and needs(cls, not session.runner.busy, under_way)
        )

    def act(self, context: bpy.types.Context) -> None:
        preferences = preferences_of()
        session.runner.close()  # a worker that waits in the environment would be pulled from under its feet
        forget()
        session.start_installation(
            Installer(
                Installation(
                    environment_folder(),
                    bundled("wheels/frametwin-*.whl"),
                    bundled("constraints.txt"),
                    bpy.path.abspath(preferences.base),
                    preferences.torch_index,
                )
            ),
            use_environment,
        )


class FRAMETWIN_OT_cancel_set_up(bpy.types.Operator):
    """Stop the set-up and remove what it has made"""

    bl_idname = "frametwin.cancel_set_up"
    bl_label = "FrameTwin: Cancel Set Up"
    bl_options: ClassVar = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if session.installer is not None:
            session.installer.cancel()
        return {"FINISHED"}


class FRAMETWIN_OT_show_set_up_log(Step, bpy.types.Operator):
    """Put all that Set Up wrote into a text, which the Text Editor shows"""

    bl_idname = "frametwin.show_set_up_log"
    bl_label = "FrameTwin: Set Up Log as Text"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return needs(cls, session.installer, "Nothing has been set up since Blender was started")

    def act(self, context: bpy.types.Context) -> str:
        assert session.installer is not None
        text = bpy.data.texts.get(LOG) or bpy.data.texts.new(LOG)
        text.from_string("\n".join([*session.installer.log, session.installer.error]).strip() + "\n")
        return f'The log is the text "{text.name}" of the Text Editor'


CLASSES = (FRAMETWIN_OT_set_up, FRAMETWIN_OT_cancel_set_up, FRAMETWIN_OT_show_set_up_log)
