"""Scenes and collections that jobs find again."""

from __future__ import annotations

from typing import Any

import bpy
import pytest

from frametwin.blender.background.keeping import keep
from frametwin.errors import InputError


def test_what_was_renamed_is_found_and_what_was_deleted_is_not(scene: Any) -> None:
    collection = bpy.data.collections.new("rig")
    find_scene, find_collection = keep(scene), keep(collection)
    scene.name = collection.name = "renamed"
    other = bpy.data.collections.new("rig")
    assert find_scene() == scene and find_collection() == collection
    bpy.data.collections.remove(collection)
    with pytest.raises(InputError, match="The collection 'rig' is gone"):
        find_collection()
    assert other.name == "rig"
