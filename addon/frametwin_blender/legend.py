"""What the colours of the twin mean, drawn into the viewport."""

from __future__ import annotations

import bpy
import numpy as np

from frametwin.blender.display.colours import MISSING, UNKNOWN, Legend, colour_map
from frametwin.blender.display.print_jobs import jobs_in
from frametwin.blender.display.twin_records import load_legend
from frametwin.blender.views.framing import Room

from .properties import QUANTITIES
from .steps import twin_of

WIDTH, HEIGHT, MARGIN, TEXT = 220, 14, 24, 12  # pixels at a resolution scale of 1
NAMES = {key: name for key, name, _ in QUANTITIES}
"""What the panel calls a quantity."""

_handle: object | None = None


def register() -> None:
    """Begin to draw."""
    global _handle
    if _handle is None:
        _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")


def unregister() -> None:
    """Draw no more."""
    global _handle
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
        _handle = None


def _draw() -> None:
    context = bpy.context
    settings = getattr(context.scene, "frametwin", None)
    if settings is None or not settings.view.legend or not context.space_data.overlay.show_overlays:
        return
    collection = twin_of(context) or next(iter(jobs_in(context.scene)), None)
    legend = None if collection is None else load_legend(collection)
    if legend is not None and any(obj.visible_get(viewport=context.space_data) for obj in collection.all_objects):
        _draw_legend(legend, context.preferences.system.ui_scale, Room.of(context.area.regions))


def _draw_legend(legend: Legend, scale: float, room: Room) -> None:
    left, low = room.left + MARGIN * scale, room.low + (MARGIN + 3 * TEXT) * scale
    width, height = min(WIDTH * scale, room.right - MARGIN * scale - left), HEIGHT * scale
    _draw_bar(left, low, width, height, legend.colours)
    unit = f" ({legend.unit})" if legend.unit else ""
    name = NAMES.get(legend.quantity, legend.quantity.replace("_", " ").capitalize())
    _write(name + unit, left, low + height + 6 * scale, scale)
    for share in (0.0, 0.5, 1.0):
        value = legend.low + share * (legend.high - legend.low)
        _write(f"{value:.3g}", left + share * width, low - (TEXT + 5) * scale, scale, centred=share)
    _draw_others(left, low + height + (TEXT + 14) * scale, scale)


def _draw_others(left: float, low: float, scale: float) -> None:
    """Two fields for what has a colour of its own."""
    side = TEXT * scale
    for i, (name, colour) in enumerate((("missing", colour_map()[MISSING]), ("no value", colour_map()[UNKNOWN]))):
        x = left + i * 90 * scale
        _draw_bar(x, low, side, side, colour[None])
        _write(name, x + 1.5 * side, low + 1 * scale, scale)


def _draw_bar(left: float, low: float, width: float, height: float, colours: np.ndarray) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    edges = left + width * np.linspace(0.0, 1.0, len(colours) + 1)
    corners, shades = [], []
    for i, colour in enumerate(colours.tolist()):
        a, b = edges[i], edges[i + 1]
        corners += [(a, low), (b, low), (b, low + height), (a, low), (b, low + height), (a, low + height)]
        shades += [(*_shown(colour), 1.0)] * 6
    shader = gpu.shader.from_builtin("FLAT_COLOR")
    batch_for_shader(shader, "TRIS", {"pos": corners, "color": shades}).draw(shader)


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
