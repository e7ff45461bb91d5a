"""What the colours of twins and print jobs mean, drawn into the viewport."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from frametwin.blender.display.colouring import AUTOMATIC_KEY, legend_of
from frametwin.blender.display.colours import Legend
from frametwin.blender.display.histograms import histogram_of
from frametwin.blender.display.legend_entries import DASHED, THIN, Entry, legend_entries
from frametwin.blender.display.print_jobs import jobs_in
from frametwin.blender.display.quantities import quantity_named
from frametwin.blender.views.framing import Room

from .compared import title_of_colours
from .steps import twin_of
from .translations import translated
from .viewport_drawing import TEXT, ViewportDrawing, draw_bar, draw_bars, draw_field, write_words

WIDTH, HEIGHT, MARGIN = 220, 14, 24  # pixels at a resolution scale of 1
BARS = 48
"""Height of the histogram, words included."""

GAP = 2
"""Between it and the bar of colours."""

BACKDROP = (0.0, 0.0, 0.0, 0.35)
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
        name = "" if legend is None else quantity_named(legend.quantity).name
        words = "" if legend is None else title_of_colours(legend.quantity, name, measured)
        counts = None if legend is None or not settings.view.histogram else histogram_of(objects, legend)
        low = _draw_legend(title, legend, words, legend_entries(objects), scale, room, low, counts)


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
        return [translated("Solid shading hides the colours: choose Color > Attribute")]
    if shading.type == "WIREFRAME":
        return [translated("Wireframe shading hides the colours")]
    if shading.type in ("MATERIAL", "RENDERED") and colours.view_transform not in ("Standard", "Raw"):
        words = translated("View transform {} shifts the colours: choose Standard")
        return [words.format(colours.view_transform)]
    return []


def _above_redo_panel(regions: Sequence[bpy.types.Region]) -> float:
    """How high the panel of the last operator reaches, at the lower left of the view."""
    view = next(region for region in regions if region.type == "WINDOW")
    panel = next((region for region in regions if region.type == "HUD" and min(region.width, region.height) > 1), None)
    return 0.0 if panel is None else float(panel.y + panel.height - view.y)


def _draw_legend(
    title: str,
    legend: Legend | None,
    name: str,
    entries: Sequence[Entry],
    scale: float,
    room: Room,
    low: float,
    counts: np.ndarray | None = None,
) -> float:
    """Draw one legend upwards from ``low``; how high it reaches.

    ``name`` is that of what the colours show; with a histogram if there are counts (B,).
    """
    left, line = room.left + MARGIN * scale, 1.6 * TEXT * scale
    width = min(WIDTH * scale, room.right - MARGIN * scale - left)
    for words in notes(bpy.context) if legend is not None else ():
        write_words(words, left, low, scale)
        low += line
    if legend is not None:
        _draw_values(legend, left, low, width, scale)
        low += (TEXT + 5 + HEIGHT) * scale
        if counts is not None and counts.any():
            _draw_histogram(counts, legend, left, low + GAP * scale, width, scale)
            low += (GAP + BARS) * scale
        low += 0.6 * TEXT * scale
        unit = f" ({legend.unit})" if legend.unit else ""
        write_words(name + unit, left, low, scale)
        low += line
    columns = max(1, int((room.right - MARGIN * scale - left) // (COLUMN * scale)))
    low += _draw_entries(entries, left, low, min(columns, 2), scale)
    if title:
        write_words(title, left, low, scale)
        low += line
    return low + 0.5 * line


def _draw_values(legend: Legend, left: float, low: float, width: float, scale: float) -> None:
    bar = low + (TEXT + 5) * scale
    draw_bar(left, bar, width, HEIGHT * scale, legend.colours)
    first, last = legend.ends
    for share in (0.0, 0.5, 1.0):
        value = first + share * (last - first)
        write_words(f"{value:.3g}", left + share * width, low, scale, centred=share)


def _draw_histogram(counts: np.ndarray, legend: Legend, left: float, low: float, width: float, scale: float) -> None:
    """Bars (B,) on the bar of colours, each in the colour of its values, and how many struts the highest stands for."""
    draw_field(left, low, width, BARS * scale, BACKDROP)
    middles = (np.arange(len(counts)) + 0.5) / len(counts)
    first, last = legend.ends
    room = (BARS - TEXT - 4) * scale
    draw_bars(left, low, width, room * counts / counts.max(), legend.colour_of(first + middles * (last - first)))
    at_right = counts[: len(counts) // 2].sum() > counts[len(counts) // 2 :].sum()
    words = translated("{} struts").format(round(float(counts.max())))
    x = left + width - 4 * scale if at_right else left + 4 * scale
    write_words(words, x, low + (BARS - TEXT + 1) * scale, scale, centred=1.0 if at_right else 0.0)


def _draw_entries(entries: Sequence[Entry], left: float, low: float, columns: int, scale: float) -> float:
    """Draw fields with words; the height that they take."""
    side, line = TEXT * scale, 1.6 * TEXT * scale
    across = max([COLUMN * scale, *(_width(entry) * scale for entry in entries)])
    for i, entry in enumerate(entries):
        x, y = left + (i % columns) * across, low + (i // columns) * line
        colour = np.array(entry.colour)[None]
        if entry.manner == DASHED:
            for part in (0.0, 0.4, 0.8):
                draw_bar(x + part * 1.5 * side, y + 0.2 * side, 0.3 * side, 0.6 * side, colour)
        elif entry.manner == THIN:
            draw_bar(x, y + 0.4 * side, 1.5 * side, 0.2 * side, colour)
        else:
            draw_bar(x, y + 0.2 * side, 1.5 * side, 0.6 * side, colour)
        write_words(translated(entry.words), x + 2.0 * side, y + scale, scale)
    return -(-len(entries) // columns) * line


def _width(entry: Entry) -> float:
    """What an entry takes, at a resolution scale of 1; letters beyond Latin are as wide as high."""
    words = translated(entry.words)
    return (sum(1.05 if ord(letter) > 0x2E80 else 0.62 for letter in words) + 2.6) * TEXT


CLASSES = ()


_drawing = ViewportDrawing(_draw)
register, unregister = _drawing.register, _drawing.unregister
