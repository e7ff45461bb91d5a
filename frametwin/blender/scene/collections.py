"""Collections of our own: cameras of a rig, curves of a run."""

from __future__ import annotations

import bpy


def new_collection(
    name: str, scene: bpy.types.Scene | None = None, parent: bpy.types.Collection | None = None
) -> bpy.types.Collection:
    """Make an empty collection in ``parent``, or in the scene (the current one by default).

    Blender numbers it if the name is taken.
    """
    collection = bpy.data.collections.new(name)
    if parent is None:
        parent = (bpy.context.scene if scene is None else scene).collection
    parent.children.link(collection)
    return collection


def remove_collection(collection: bpy.types.Collection) -> None:
    """Remove a collection and those inside of it, with the objects that are in no other and data nobody else uses."""
    for child in list(collection.children):
        remove_collection(child)
    for obj in list(collection.objects):
        if len(obj.users_collection) == 1:
            remove_object(obj)
    bpy.data.collections.remove(collection)


def remove_object(obj: bpy.types.Object) -> None:
    """Remove an object, and its data if nobody else uses them."""
    data = obj.data
    bpy.data.objects.remove(obj)
    if data is not None and data.users == 0:
        bpy.data.batch_remove([data])
