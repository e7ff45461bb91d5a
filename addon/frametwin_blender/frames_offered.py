"""The project's own frames as lists and menus offer them."""

from __future__ import annotations

from frametwin.geometry.parametric import FRAMES


def title_of(name: str) -> str:
    """A frame's name as it is read: "Half bowl"."""
    return name.replace("_", " ").capitalize()


FRAME_ITEMS = [(name, title_of(name), f"The {name.replace('_', ' ')}") for name in FRAMES]
"""For an enumeration."""
