"""What the colours of twins and print jobs mean, drawn into the viewport."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from frametwin.blender.display.colouring import AUTOMATIC_KEY, legend_of
from frametwin.blender.display.colours import Legend
from frametwin.blender.display.legend_entries import DASHED, THIN, Entry, legend_entries
from frametwin.blender.display.print_jobs import jobs_in
from frametwin.blender.display.quantities import quantity_named
from frametwin.blender.views.framing import Room

from .steps import twin_of
from .viewport_drawing import ViewportDrawing

WIDTH, HEIGHT, MARGIN, TEXT = 220, 14, 24, 12  # pixels at a resolution scale of 1
COLUMN = 110
"""Least width of an entry."""


def _draw() -> None:
    context = bpy.context
    settings = getattr(context.scene, "frametwin", None)
    if settings is None or not settings.view.legend or not context.space_data.overlay.show_overlays:
        return
    regions = context.area.regions
    room, scale = Room.of(regions), context.preferences.system.ui_scale
    low = max(room.low + MARGIN * scale, _above_redo_panel(regions) + 0.5 * MARGIN * scale)
    for title, objects in shown_groups(context):
        measured = next((obj for obj in objects if AUTOMATIC_KEY in obj), None)
        legend = None if measured is None else legend_of(measured)
        low = _draw_legend(title, legend, legend_entries(objects), scale, room, low)


def shown_groups(context: bpy.types.Context) -> Iterator[tuple[str, list[bpy.types.Object]]]:
    """What a legend is drawn for: the twin with what is adapted to it, and each print job, as far as they are seen."""
    twin, jobs = twin_of(context), jobs_in(context.scene)
    for collection in ([] if twin is None else [twin]) + jobs:
        seen = [
            obj
            for obj in collection.all_objects
            if obj.type == "CURVES" and obj.visible_get(viewport=context.space_data)
        ]
        if seen:
            yield collection.name if len(jobs) + (twin is not None) > 1 else "", seen


def notes(context: bpy.types.Context) -> list[str]:
    """Why the colours in a 3D view are not those of the legend, if they are not."""
    shading, colours = context.space_data.shading, context.scene.view_settings
    if shading.type == "SOLID" and shading.color_type != "VERTEX":
        return ["Solid shading hides the colours: choose Color > Attribute"]
    if shading.type == "WIREFRAME":
        return ["Wireframe shading hides the colours"]
    if shading.type in ("MATERIAL", "RENDERED") and colours.view_transform not in ("Standard", "Raw"):
        return [f"View transform {colours.view_transform} shifts the colours: choose Standard"]
    return []


def _above_redo_panel(regions: Sequence[bpy.types.Region]) -> float:
    """How high the panel of the last operator reaches, at the lower left of the view."""
    view = next(region for region in regions if region.type == "WINDOW")
    panel = next((region for region in regions if region.type == "HUD" and min(region.width, region.height) > 1), None)
    return 0.0 if panel is None else float(panel.y + panel.height - view.y)


def _draw_legend(
    title: str, legend: Legend | None, entries: Sequence[Entry], scale: float, room: Room, low: float
) -> float:
    """Draw one legend upwards from ``low``; how high it reaches."""
    left, line = room.left + MARGIN * scale, 1.6 * TEXT * scale
    width = min(WIDTH * scale, room.right - MARGIN * scale - left)
    for words in notes(bpy.context) if legend is not None else ():
        _write(words, left, low, scale)
        low += line
    if legend is not None:
        _draw_values(legend, left, low, width, scale)
        low += (TEXT + HEIGHT + 0.9 * TEXT) * scale + 0.6 * line
        unit = f" ({legend.unit})" if legend.unit else ""
        _write(quantity_named(legend.quantity).name + unit, left, low, scale)
        low += line
    columns = max(1, int((room.right - MARGIN * scale - left) // (COLUMN * scale)))
    low += _draw_entries(entries, left, low, min(columns, 2), scale)
    if title:
        _write(title, left, low, scale)
        low += line
    return low + 0.5 * line


def _draw_values(legend: Legend, left: float, low: float, width: float, scale: float) -> None:
    bar = low + (TEXT + 5) * scale
    _draw_bar(left, bar, width, HEIGHT * scale, legend.colours)
    first, last = legend.ends
    for share in (0.0, 0.5, 1.0):
        value = first + share * (last - first)
        _write(f"{value:.3g}", left + share * width, low, scale, centred=share)


def _draw_entries(entries: Sequence[Entry], left: float, low: float, columns: int, scale: float) -> float:
    """Draw fields with words; the height that they take."""
    side, line = TEXT * scale, 1.6 * TEXT * scale
    across = max([COLUMN * scale, *((len(entry.words) * 0.62 * TEXT + 2.6 * TEXT) * scale for entry in entries)])
    for i, entry in enumerate(entries):
        x, y = left + (i % columns) * across, low + (i // columns) * line
        colour = np.array(entry.colour)[None]
        if entry.manner == DASHED:
            for part in (0.0, 0.4, 0.8):
                _draw_bar(x + part * 1.5 * side, y + 0.2 * side, 0.3 * side, 0.6 * side, colour)
        elif entry.manner == THIN:
            _draw_bar(x, y + 0.4 * side, 1.5 * side, 0.2 * side, colour)
        else:
            _draw_bar(x, y + 0.2 * side, 1.5 * side, 0.6 * side, colour)
        _write(entry.words, x + 2.0 * side, y + scale, scale)
    return -(-len(entries) // columns) * line


def _draw_bar(left: float, low: float, width: float, height: float, colours: np.ndarray) -> None:
    """A bar with colours from left to right, each running over into the next."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    shades = [(*_shown(colour), 1.0) for colour in colours.tolist()] * (2 if len(colours) == 1 else 1)
    edges = (left + width * np.linspace(0.0, 1.0, len(shades))).tolist()
    corners, painted = [], []
    for a, b, first, last in zip(edges[:-1], edges[1:], shades[:-1], shades[1:], strict=True):
        corners += [(a, low), (b, low), (b, low + height), (a, low), (b, low + height), (a, low + height)]
        painted += [first, last, last, first, last, first]
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, "TRIS", {"pos": corners, "color": painted}).draw(shader)


def _shown(colour: list[float]) -> list[float]:
    """A scene-linear colour as the screen wants it."""
    return [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1.0 / 2.4) - 0.055 for c in colour]


def _write(text: str, x: float, y: float, scale: float, centred: float = 0.0) -> None:
    import blf

    blf.size(0, TEXT * scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 1.0)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x - centred * blf.dimensions(0, text)[0], y, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


CLASSES = ()


_drawing = ViewportDrawing(_draw)
register, unregister = _drawing.register, _drawing.unregister
