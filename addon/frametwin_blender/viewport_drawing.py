"""What is drawn over the 3D view, from when the add-on is there until it goes."""

from __future__ import annotations

from collections.abc import Callable

import bpy


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
