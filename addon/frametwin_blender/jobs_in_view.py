"""Print jobs in view: what gives way to them and comes back after them, and their names beneath them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.display.print_jobs import jobs_in
from frametwin.blender.scene import visibility
from frametwin.printing.records.history import PrintHistory

from .in_view import hide, hide_twin, show_twin
from .recolour import show_colours
from .viewport_drawing import ViewportDrawing
from .views import corners_of, see, write_label

TIMELINE = ("frame_current", "frame_start", "frame_end")
BELOW = 30
"""Pixels from the lowest point of a job in view to its name, at a resolution scale of 1."""


def name_of(history: PrintHistory, folder: Path, mode: str = "") -> str:
    """What to call a job in the scene: what was printed, how, and where its folder has it."""
    how = {"adapt": "adapted", "blind": "as designed", "compensate": "compensated"}
    return f"{history.name}, {how.get(mode, how['adapt'] if history.adapts else how['blind'])}, {folder.name}"


def remember(scene: bpy.types.Scene) -> None:
    """Remember what the first job of a scene changes: the timeline, and what is in view."""
    before = scene.frametwin.print.before
    if before.known:
        return
    before.known = True
    for name in TIMELINE:
        setattr(before, name, getattr(scene, name))
    before.plan = before.print_object = before.twin = False


def hide_for_jobs(scene: bpy.types.Scene) -> None:
    """Hide plan, print and twin, which stand where print jobs are shown; what was in view comes back after them."""
    settings, layer = scene.frametwin, scene.view_layers[0]
    before = settings.print.before
    for name in ("plan", "print_object"):
        obj = getattr(settings, name)
        setattr(before, name, getattr(before, name) or (obj is not None and visibility.is_shown(obj, layer)))
        hide(obj)
    twin = settings.twin
    before.twin = before.twin or (twin is not None and visibility.is_any_shown(twin, layer))
    hide_twin(twin)


def show_whole(scene: bpy.types.Scene) -> None:
    """Go to the end of the timeline, where all has been printed, with all jobs whole in view, in their colours."""
    show_colours(scene)
    scene.frame_set(scene.frame_end)
    with window_of(scene):
        see(bpy.context, corners_of(_visible(jobs_in(scene), bpy.context.view_layer)))


def come_back(context: bpy.types.Context) -> None:
    """Show again what the jobs have hidden, on the timeline as it was before them."""
    scene, settings = context.scene, context.scene.frametwin
    before = settings.print.before
    if not before.known:
        return
    scene.frame_start, scene.frame_end = before.frame_start, before.frame_end
    scene.frame_set(before.frame_current)
    seen: list[bpy.types.Object] = []
    for name in ("plan", "print_object"):
        obj = getattr(settings, name)
        if getattr(before, name) and obj is not None:
            visibility.show(obj)
            seen.append(obj)
    if before.twin and settings.twin is not None:
        show_twin(settings.twin, context.view_layer)
        seen += settings.twin.all_objects
    before.known = False
    see(context, corners_of(seen))


@contextmanager
def window_of(scene: bpy.types.Scene) -> Iterator[None]:
    """Work in a window that shows the scene, if there is one, as where no user has pressed a button: in timers."""
    windows = [window for window in bpy.context.window_manager.windows if window.scene == scene]
    if not windows:
        yield
        return
    with bpy.context.temp_override(window=windows[0]):
        yield


def _visible(jobs: list[bpy.types.Collection], layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    return [obj for job in jobs for obj in job.all_objects if visibility.is_shown(obj, layer)]


def _draw() -> None:
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    context = bpy.context
    if not context.space_data.overlay.show_overlays:
        return
    for job in jobs_in(context.scene):
        corners = corners_of(_visible([job], context.view_layer), update=False)
        places = [location_3d_to_region_2d(context.region, context.region_data, corner) for corner in corners.tolist()]
        seen = np.array([place for place in places if place is not None]).reshape(-1, 2)
        if len(seen):
            x, y = seen[:, 0].mean(), seen[:, 1].min()
            write_label(job.name, float(x), float(y) - BELOW * context.preferences.system.ui_scale)


CLASSES = ()


_drawing = ViewportDrawing(_draw)
register, unregister = _drawing.register, _drawing.unregister
