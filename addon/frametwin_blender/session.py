"""What runs beside Blender for this add-on: the runner, the timer that pumps it, and the end of both."""

from __future__ import annotations

import atexit
from collections.abc import Callable
from typing import ClassVar

import bpy

from frametwin.blender.background.runner import Job, Runner, Status
from frametwin.blender.display.preview import remove_preview
from frametwin.worker.installation import Installer

from .text import wrapped

INTERVAL = 0.05
"""Seconds between two looks at what a worker says."""

SHORT = 0.005
"""The same while a result is put into the scene, of which each look does a little: in between Blender has its turn."""

runner = Runner()
installer: Installer | None = None
_when_installed: Callable[[], None] | None = None
_told = ""
"""What the status bar shows."""

last_words = ""
"""What was told last, for tests and for Blender without a window."""


def start(job: Job) -> None:
    """Begin a job and follow it; see `Runner.start`."""
    runner.start(job)
    _follow()


def start_installation(new: Installer, then: Callable[[], None]) -> None:
    """Begin to set up the environment and follow it; ``then`` is called, in the main thread, if that ends well."""
    global installer, _when_installed
    installer, _when_installed = new, then
    new.start()
    _follow()


def tell(words: str, error: bool = False) -> None:
    """Tell the user something that no operator is there to report any more."""
    global last_words
    last_words = words
    if error and not bpy.app.background and bpy.context.window_manager.windows:

        def draw(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
            for line in wrapped(words, 80):
                menu.layout.label(text=line)

        bpy.context.window_manager.popup_menu(draw, title="FrameTwin", icon="ERROR")


def pump() -> bool:
    """One look; whether there is more to follow. The timer calls it, and tests, in which timers never fire."""
    was = runner.busy
    going = runner.pump()
    if was and not going:
        tell(runner.status.message, runner.status.error)
        _remember_for_undo(runner.status.title)
    return going or _installing()


def _installing() -> bool:
    """Whether the environment is being set up; what is to follow that is done once it has ended."""
    global _when_installed
    if installer is None or installer.running:
        return installer is not None
    then, _when_installed = _when_installed, None
    if then is not None and installer.done:
        then()
    return False


def _tick() -> float | None:
    going = pump()
    redraw(all_of_it=not going)
    return (SHORT if runner.finishing else INTERVAL) if going else None


def redraw(all_of_it: bool = True) -> None:
    """Draw what tells of jobs anew, and the 3D views if all of it is asked for."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PREFERENCES"}:
                _redraw(area, all_of_it)
    global _told
    words = runner.status.overall_line if runner.busy else runner.status.message
    if installer is not None and installer.running:
        words = installer.stage
    if all_of_it or words != _told:
        _told = words
        # The status bar is no area of the screen; it listens to what view layers are called.
        bpy.msgbus.publish_rna(key=(bpy.types.ViewLayer, "name"))


def _redraw(area: bpy.types.Area, all_of_it: bool) -> None:
    """Draw panels anew; a 3D view, which may take a second, is drawn by Blender itself where something has changed."""
    for region in area.regions:
        if all_of_it or region.type == "UI" or area.type == "PREFERENCES":
            region.tag_redraw()


def _follow() -> None:
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=INTERVAL)


def _remember_for_undo(title: str) -> None:
    """A step of undo for what a job has put into the scene."""
    windows = bpy.context.window_manager.windows
    if bpy.app.background or not windows or runner.status.error:
        return
    with bpy.context.temp_override(window=windows[0]):
        bpy.ops.ed.undo_push(message=f"FrameTwin: {title}")


class FRAMETWIN_OT_cancel(bpy.types.Operator):
    """Stop what is under way; nothing half-done is left"""

    bl_idname = "frametwin.cancel"
    bl_label = "FrameTwin: Cancel"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return runner.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        runner.cancel()
        return {"FINISHED"}


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    """The scene that a job would go into is about to be gone, and the next one has nothing to do with it."""
    runner.close()
    runner.status = Status()


@bpy.app.handlers.persistent
def _after_load(*_: object) -> None:
    """A file that was saved while a fit ran has its curves in it; and timers have ended with the file before."""
    remove_preview()
    if installer is not None and installer.running:
        _follow()


@bpy.app.handlers.persistent
def _before_undo(*_: object) -> None:
    runner.hold()


@bpy.app.handlers.persistent
def _after_undo(*_: object) -> None:
    if not runner.busy:
        remove_preview()  # a step that was taken while a fit ran brings its curves back
    runner.resume()


def end() -> None:
    """End all processes."""
    runner.close()
    if installer is not None:
        installer.cancel(wait=1.0)


HANDLERS = (
    ("load_pre", _before_load),
    ("load_post", _after_load),
    ("undo_pre", _before_undo),
    ("redo_pre", _before_undo),
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
)


def register() -> None:
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)
    atexit.register(end)


def unregister() -> None:
    atexit.unregister(end)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    end()


CLASSES = (FRAMETWIN_OT_cancel,)
