"""Preferences: the Python in which the fitter runs, what it lacks, and its test."""

# No postponed annotations here: Blender reads them as properties.
from collections.abc import Mapping
from typing import Any, ClassVar

import bpy

from frametwin.blender.background.runner import Job, Steps
from frametwin.errors import InputError
from frametwin.worker.interpreter import WITHOUT_TORCH

from . import session
from .computing import (
    HAS_SET_UP,
    REMEDY,
    can_compute,
    chosen_python,
    given_problem,
    has_python,
    is_being_set_up,
    python_worker,
)
from .steps import Step, draw_progress, write_text

if HAS_SET_UP:
    from .set_up import INDEX, draw_set_up, draw_set_up_progress

TITLE = "Test"


class FrameTwinPreferences(bpy.types.AddonPreferences):
    """Of the whole add-on, not of a scene."""

    bl_idname = __package__

    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python",
        subtype="FILE_PATH",
        description="A Python 3.11 to 3.13 with the package frametwin, in place of Blender's own with the packages that"
        " this extension carries",
    )
    if HAS_SET_UP:
        base: bpy.props.StringProperty(  # type: ignore[valid-type]
            name="Base Python",
            subtype="FILE_PATH",
            description="The Python from which Set Up makes the environment. Empty: Blender's own as a mere template,"
            " or one of this computer",
        )
        torch_index: bpy.props.StringProperty(  # type: ignore[valid-type]
            name="PyTorch From",
            default=INDEX,
            description="Where Set Up looks for PyTorch besides PyPI; the default has the small build for CPUs",
        )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        write_text(layout, "The fitter runs as a process of its own, beside Blender.", context)
        layout.prop(self, "python")
        draw_found(layout, context)
        layout.operator("frametwin.test_python", text="Test", icon="CHECKMARK")
        draw_progress(layout, context, TITLE)
        row = layout.row()
        row.operator("frametwin.show_help", text="Documentation", icon="HELP")
        row.operator("frametwin.report_bug", text="Report a Bug", icon="URL")
        if HAS_SET_UP:
            draw_set_up(layout.box(), context)


def draw_found(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Which Python is in use, without and with PyTorch."""
    problem = given_problem()
    if problem:
        write_text(layout, problem, context, "ERROR")
    for torch, what in ((False, "Fast and all else"), (True, "Presets with PyTorch")):
        if is_being_set_up(torch):
            write_text(layout, f"{what}: being set up, see below.", context, "INFO")
            continue
        try:
            write_text(layout, f"{what}: {chosen_python(torch).python}", context, "CHECKMARK")
        except InputError:
            missing = "not there yet, see below." if HAS_SET_UP else "choose a Python that has it."
            write_text(layout, f"{what}: {missing}", context, "INFO" if torch else "ERROR")


def draw_python(layout: bpy.types.UILayout, context: bpy.types.Context, torch: bool = False) -> None:
    """Where there is no Python that can do it, or the wrong one is typed, say so and show the way."""
    if is_being_set_up(torch):
        draw_set_up_progress(layout)
        return
    words = given_problem()
    if not has_python(torch):
        words = f"The fitter has no Python yet: {REMEDY}."
        if torch and has_python():
            words = f"This preset needs PyTorch, Fast does not: {REMEDY}."
    if words:
        write_text(layout, words, context, "ERROR")
        layout.operator("frametwin.open_preferences", text="Open Preferences", icon="PREFERENCES")


class FRAMETWIN_OT_open_preferences(bpy.types.Operator):
    """Open this add-on's preferences, where its Python is set up or chosen"""

    bl_idname = "frametwin.open_preferences"
    bl_label = "FrameTwin: Open Preferences"
    bl_options: ClassVar = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        bpy.ops.preferences.addon_show(module=__package__)
        return {"FINISHED"}


class FRAMETWIN_OT_test_python(Step, bpy.types.Operator):
    """Start the fitter's Python and show its versions"""

    bl_idname = "frametwin.test_python"
    bl_label = "FrameTwin: Test Python"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        session.start(test_job())


def test_job() -> Job:
    """Start a worker afresh and ask what it is: the one with PyTorch, if there is one.

    Raises
    ------
    InputError
        If there is no Python.
    """
    client = python_worker(has_python(torch=True) and not is_being_set_up(torch=True))

    def finish(versions: Mapping[str, Any]) -> Steps:
        missing = [name for name in WITHOUT_TORCH if name in versions and versions[name] is None]
        if missing:
            raise InputError.at(client.python, "packages", f"lacks {', '.join(missing)}", REMEDY)
        torch = f"PyTorch {versions['torch']}" if versions["torch"] else "no PyTorch, which Fast does not need"
        return (
            f"Works: Python {versions['python']}, numpy {versions['numpy']}, {torch},"
            f" FrameTwin {versions['frametwin']}, {versions['cores']} cores"
        )
        yield

    return Job(
        title=TITLE, request="versions", parameters={}, worker=lambda: client, kind=None, finish=finish,
    )  # fmt: skip


CLASSES = (FrameTwinPreferences, FRAMETWIN_OT_open_preferences, FRAMETWIN_OT_test_python)
