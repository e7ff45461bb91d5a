"""What is drawn over the 3D view, from when the add-on is there until it goes, and fields, bars and words in it."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

TEXT = 12
"""Size of words, in pixels at a resolution scale of 1."""


class ViewportDrawing:
    """A function that Blender calls whenever it has drawn a 3D view.

    Parameters
    ----------
    draw
        Draws in pixels of the region.
    """

    def __init__(self, draw: Callable[[], None]) -> None:
        self._draw = draw
        self._handle: object | None = None

    def register(self) -> None:
        """Begin to draw."""
        if self._handle is None:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")

    def unregister(self) -> None:
        """Draw no more."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None


def draw_bar(left: float, low: float, width: float, height: float, colours: np.ndarray) -> None:
    """A bar with scene-linear colours (B, 3) from left to right, each running over into the next."""
    shades = [(*_shown(colour), 1.0) for colour in colours.tolist()] * (2 if len(colours) == 1 else 1)
    edges = (left + width * np.linspace(0.0, 1.0, len(shades))).tolist()
    corners, painted = [], []
    for a, b, first, last in zip(edges[:-1], edges[1:], shades[:-1], shades[1:], strict=True):
        corners += _two_triangles(a, b, low, low + height)
        painted += [first, last, last, first, last, first]
    _draw_triangles(corners, painted)


def draw_bars(left: float, low: float, width: float, heights: np.ndarray, colours: np.ndarray) -> None:
    """Bars of heights (B,) side by side in scene-linear colours (B, 3)."""
    edges = (left + width * np.linspace(0.0, 1.0, len(heights) + 1)).tolist()
    corners, painted = [], []
    for i, height in enumerate(heights.tolist()):
        corners += _two_triangles(edges[i], edges[i + 1], low, low + height)
        painted += [(*_shown(colours[i].tolist()), 1.0)] * 6
    _draw_triangles(corners, painted)


def draw_field(left: float, low: float, width: float, height: float, colour: tuple[float, float, float, float]) -> None:
    """A field in a colour of the screen, through which the view shows where its alpha is below 1."""
    import gpu

    gpu.state.blend_set("ALPHA")
    _draw_triangles(_two_triangles(left, left + width, low, low + height), [colour] * 6)
    gpu.state.blend_set("NONE")


def write_words(text: str, x: float, y: float, scale: float, centred: float = 0.0) -> None:
    """Words in white with a shadow; of their width the share ``centred`` is left of ``x``."""
    import blf

    blf.size(0, TEXT * scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 1.0)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x - centred * blf.dimensions(0, text)[0], y, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def _two_triangles(left: float, right: float, low: float, high: float) -> list[tuple[float, float]]:
    return [(left, low), (right, low), (right, high), (left, low), (right, high), (left, high)]


def _draw_triangles(corners: list[tuple[float, float]], colours: list[tuple[float, ...]]) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, "TRIS", {"pos": corners, "color": colours}).draw(shader)


def _shown(colour: list[float]) -> list[float]:
    """A scene-linear colour as the screen wants it."""
    return [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1.0 / 2.4) - 0.055 for c in colour]
