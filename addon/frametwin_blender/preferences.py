"""Preferences: the Python in which the fitter runs, its set-up and its test."""

# No postponed annotations here: Blender reads them as properties.
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import bpy

from frametwin import __version__
from frametwin.blender.background.runner import Job, Steps
from frametwin.errors import InputError
from frametwin.worker.client import WorkerClient, find_python
from frametwin.worker.installation import Installation, Installer, installed_python
from frametwin.worker.interpreter import VARIABLE

from . import session
from .steps import Step, draw_progress, is_free, needs, write_text

TITLE = "Test"
WHERE = "Preferences > Add-ons > FrameTwin"
REMEDY = f"press Set Up in {WHERE}, or choose another Python there"
LOOK_AGAIN = 3.0  # seconds


class FrameTwinPreferences(bpy.types.AddonPreferences):
    """Of the whole add-on, not of a scene."""

    bl_idname = __package__

    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python",
        subtype="FILE_PATH",
        description="A Python 3.11 to 3.13 with the package frametwin. Empty: the one that Set Up makes, or else that"
        " of the variable FRAMETWIN_PYTHON",
    )
    base: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Base Python",
        subtype="FILE_PATH",
        description="The Python from which Set Up makes the environment. Empty: Blender's own as a mere template, or"
        " one of this computer",
    )
    torch_index: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="PyTorch From",
        default=Installation.__dataclass_fields__["torch_index"].default,
        description="Where Set Up looks for PyTorch besides PyPI; the default has the small build for CPUs",
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        write_text(layout, "The fitter runs in a Python environment of its own, never inside Blender.", context)
        layout.prop(self, "python")
        self._draw_found(layout, context)
        row = layout.row(align=True)
        row.operator("frametwin.set_up", icon="PACKAGE")
        row.operator("frametwin.test_python", icon="CHECKMARK")
        draw_progress(layout, context, TITLE)
        self._draw_set_up(layout, context)

    def _draw_found(self, layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
        if is_being_set_up():
            write_text(layout, "It is being set up, see below; nothing can be computed meanwhile.", context, "INFO")
            return
        try:
            write_text(layout, f"In use: {chosen_python()}", context, "CONSOLE")
        except InputError:
            write_text(layout, "There is none yet: press Set Up, or choose one.", context, "ERROR")

    def _draw_set_up(self, layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
        installer = session.installer
        box = layout.box()
        box.prop(self, "base")
        box.prop(self, "torch_index")
        if not bpy.app.online_access:
            write_text(box, "Set Up needs the network: allow online access under System > Network.", context, "INFO")
        if installer is None:
            return
        if installer.running:
            draw_set_up_progress(box)
        elif installer.done:
            write_text(box, "The environment is ready.", context, "CHECKMARK")
        elif installer.error:
            write_text(box, installer.error, context, "ERROR")
        else:
            write_text(box, "Cancelled; nothing is left of it.", context)
        column = box.column(align=True)
        column.scale_y = 0.75
        for line in [line for line in list(installer.log) if line.strip()][-6:]:
            column.label(text=line[-110:])


def preferences_of() -> FrameTwinPreferences | None:
    """The add-on's preferences; ``None`` while it is registered by hand."""
    addon = bpy.context.preferences.addons.get(__package__)
    return None if addon is None else addon.preferences


def environment_folder() -> Path:
    """Where Set Up makes its environment, by version of FrameTwin."""
    parent = bpy.utils.extension_path_user(__package__, path="", create=True)
    return Path(parent) / f"environment-{__version__}"


def chosen_python() -> str:
    """The Python in which the fitter runs: the chosen one, else the one that was set up, else what is found.

    Raises
    ------
    InputError
        If there is none, or it is being set up; the message says what to do.
    """
    preferences = preferences_of()
    if is_being_set_up():
        raise InputError(f"FrameTwin's Python is being set up: wait until that is done, or cancel it in {WHERE}.")
    if preferences is not None and preferences.python:
        return find_python(bpy.path.abspath(preferences.python), remedy=REMEDY)
    ready = installed_python(environment_folder()) if _has_place() else None
    try:
        return ready or find_python(remedy=REMEDY)
    except InputError as error:
        if os.environ.get(VARIABLE, "").strip():
            raise  # somebody wants that one
        raise InputError(f"FrameTwin has no Python to compute with yet: {REMEDY}.") from error


def is_being_set_up() -> bool:
    """Whether the Python in which the fitter would run is being set up; one that the user has chosen is not."""
    if session.installer is None or not session.installer.running:
        return False
    preferences = preferences_of()
    chosen = "" if preferences is None else preferences.python
    return not chosen or (_has_place() and Path(bpy.path.abspath(chosen)).is_relative_to(environment_folder()))


def _has_place() -> bool:
    """Whether Blender gives this add-on a folder: it does to extensions alone."""
    return bool(__package__.startswith("bl_ext."))


def can_compute(cls: type) -> bool:
    """Whether the worker can begin a job, as an answer of a ``poll``; that there is a Python is seen then."""
    ready = needs(cls, not is_being_set_up(), "The fitter's Python is being set up: wait until that is done")
    return ready and is_free(cls)


def python_worker() -> WorkerClient:
    """A worker in that Python, not started yet."""
    return WorkerClient(chosen_python(), remedy=REMEDY)


def worker_job(
    title: str,
    request: str,
    parameters: dict[str, Any],
    finish: Callable[[Any], Steps],
    *,
    out: Path | None = None,
    **more: Any,
) -> Job:
    """A job of the worker in that Python.

    Parameters
    ----------
    title, request, parameters, finish
        See `frametwin.blender.background.runner.Job`.
    out
        The folder that it makes, of which nothing is left if it is cancelled; one of its parameters.
    more
        Other fields of the job.

    Raises
    ------
    InputError
        If there is no Python.
    """
    python = chosen_python()  # tells workers of different Pythons apart
    given = parameters if out is None else {**parameters, "out": out}
    return Job(
        title=title,
        request=request,
        parameters=given,
        finish=finish,
        worker=python_worker,
        kind=f"python {python}",
        out=out,
        **more,
    )


_seen: dict[str, tuple[float, bool]] = {}


def has_python() -> bool:
    """Whether there is a Python to compute with; looked up at most once in a few seconds, since panels ask often."""
    preferences = preferences_of()
    key = "" if preferences is None else preferences.python
    at, found = _seen.get(key, (-LOOK_AGAIN, False))
    if perf_counter() - at > LOOK_AGAIN:
        try:
            found = bool(chosen_python())
        except InputError:
            found = False
        _seen.clear()
        _seen[key] = (perf_counter(), found)
    return found


def draw_set_up_progress(layout: bpy.types.UILayout) -> None:
    """How far the set-up that is under way is, with a button to cancel it."""
    installer = session.installer
    if installer is None:
        return
    row = layout.row(align=True)
    row.progress(factor=(installer.number + 0.5) / installer.total, text=f"Set Up: {installer.stage}")
    row.operator("frametwin.cancel_set_up", text="", icon="X")


def draw_python(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Where there is no Python yet, say so, and show the way."""
    if is_being_set_up():
        draw_set_up_progress(layout)
    elif not has_python():
        write_text(layout, "The fitter has no Python yet: set it up in the preferences.", context, "ERROR")
        layout.operator("frametwin.open_preferences", icon="PREFERENCES")


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


class FRAMETWIN_OT_open_preferences(bpy.types.Operator):
    """Open this add-on's preferences, where its Python is set up or chosen"""

    bl_idname = "frametwin.open_preferences"
    bl_label = "Open Preferences"
    bl_options: ClassVar = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        bpy.ops.preferences.addon_show(module=__package__)
        return {"FINISHED"}


class FRAMETWIN_OT_set_up(Step, bpy.types.Operator):
    """Make a Python environment in this extension's folder and install FrameTwin and PyTorch into it (about 1 GB)"""

    bl_idname = "frametwin.set_up"
    bl_label = "Set Up"
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
        assert preferences is not None  # the button is in them
        session.runner.close()  # a worker that waits in the environment would be pulled from under its feet
        session.start_installation(
            Installer(
                Installation(
                    environment_folder(),
                    bundled("wheels/frametwin-*.whl"),
                    bundled("constraints.txt"),
                    bpy.path.abspath(preferences.base),
                    preferences.torch_index,
                )
            )
        )


class FRAMETWIN_OT_cancel_set_up(bpy.types.Operator):
    """Stop the set-up and remove what it has made"""

    bl_idname = "frametwin.cancel_set_up"
    bl_label = "Cancel"
    bl_options: ClassVar = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        if session.installer is not None:
            session.installer.cancel()
        return {"FINISHED"}


class FRAMETWIN_OT_test_python(Step, bpy.types.Operator):
    """Start the fitter's Python and show its versions"""

    bl_idname = "frametwin.test_python"
    bl_label = "Test"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_compute(cls)

    def act(self, context: bpy.types.Context) -> None:
        session.start(test_job())


def test_job() -> Job:
    """Start a worker afresh and ask what it is.

    Raises
    ------
    InputError
        If there is no Python.
    """
    client = python_worker()

    def finish(versions: Mapping[str, Any]) -> Steps:
        missing = [name for name in ("torch", "numba", "scipy") if versions.get(name) is None]
        if missing:
            raise InputError.at(client.python, "packages", f"lacks {', '.join(missing)}", REMEDY)
        return (
            f"Works: Python {versions['python']}, PyTorch {versions['torch']}, FrameTwin {versions['frametwin']},"
            f" {versions['cores']} cores"
        )
        yield

    return Job(
        title=TITLE, request="versions", parameters={}, worker=lambda: client, kind=None, finish=finish,
    )  # fmt: skip


CLASSES = (
    FrameTwinPreferences,
    FRAMETWIN_OT_open_preferences,
    FRAMETWIN_OT_set_up,
    FRAMETWIN_OT_cancel_set_up,
    FRAMETWIN_OT_test_python,
)
