"""Scenes and collections that are found again after an undo, when what Python held of them is good for nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import bpy

from frametwin.errors import InputError

Kept = TypeVar("Kept", bpy.types.Scene, bpy.types.Collection)


def keep(item: Kept) -> Callable[[], Kept]:
    """How to find a scene or a collection later on, whatever the user undoes, redoes and renames meanwhile.

    Returns
    -------
    A function that gives it, and raises `InputError` if it is gone.
    """
    uid, name = item.session_uid, item.name
    kind, held = ("scene", "scenes") if isinstance(item, bpy.types.Scene) else ("collection", "collections")

    def find() -> Kept:
        for found in getattr(bpy.data, held):
            if found.session_uid == uid:
                result: Kept = found
                return result
        raise InputError(f"The {kind} {name!r} is gone, deleted or undone, so nothing was put into it; start again.")

    return find
