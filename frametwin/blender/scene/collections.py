"""Collections of our own: one for all of them in each scene, and inside of it plans, prints, rigs, twins and jobs."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

KEY = "frametwin_home"
"""Custom property of the collections that hold what the add-on makes: which of them it is."""

NAME = "FrameTwin"
HOME, PLANS, PRINTS = "home", "plans", "prints"
_NAMES = {HOME: NAME, PLANS: "Plans", PRINTS: "Prints"}


def home_collection(scene: bpy.types.Scene, role: str = HOME) -> bpy.types.Collection:
    """The collection of a scene in which all others of ours are, or one inside of it for `PLANS` or `PRINTS`.

    It is made when there is none, and opened where the user has closed it: what is put there is to be seen. Whatever
    an older version has left at the root of the scene stays there.
    """
    parent = scene.collection if role == HOME else home_collection(scene)
    there = parent.children_recursive if role == HOME else parent.children
    found = next((each for each in there if each.get(KEY) == role and each.is_editable), None)
    if found is None:
        found = bpy.data.collections.new(_NAMES[role])
        found[KEY] = role
        parent.children.link(found)
    else:
        open_collections(scene, found)
    return found


def open_collections(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Show a collection in all view layers of a scene, and those that it is inside of."""
    for layer in scene.view_layers:
        if layer.layer_collection is None:  # one that no window has shown yet: nothing is closed in it
            continue
        for path in paths_to(layer.layer_collection, collection):
            for each in path:
                if each.exclude:
                    each.exclude = False
                if each.hide_viewport:
                    each.hide_viewport = False
                if each.collection.hide_viewport and each.collection.is_editable:
                    each.collection.hide_viewport = False


def paths_to(
    top: bpy.types.LayerCollection, collection: bpy.types.Collection
) -> Iterator[tuple[bpy.types.LayerCollection, ...]]:
    """Each way in a view layer from below ``top`` down to a collection, from above."""
    for child in top.children:
        if child.collection == collection:
            yield (child,)
        for rest in paths_to(child, collection):
            yield (child, *rest)


def new_collection(
    name: str, scene: bpy.types.Scene | None = None, parent: bpy.types.Collection | None = None
) -> bpy.types.Collection:
    """Make an empty collection in ``parent``, by default in that of all our collections in the scene (the current one).

    Blender numbers it if the name is taken.
    """
    if parent is None:
        parent = home_collection(bpy.context.scene if scene is None else scene)
    collection = bpy.data.collections.new(name)
    parent.children.link(collection)
    return collection


def remove_collection(collection: bpy.types.Collection) -> None:
    """Remove a collection and those inside of it, with the objects that are in no other and data nobody else uses."""
    _remove(collection)
    remove_empty_homes()


def remove_empty_homes() -> None:
    """Remove those of `home_collection` that hold nothing."""
    for role in (PLANS, PRINTS, HOME):
        for home in [each for each in bpy.data.collections if each.get(KEY) == role and each.is_editable]:
            if not home.children and not home.objects:
                bpy.data.collections.remove(home)


def _remove(collection: bpy.types.Collection) -> None:
    for child in list(collection.children):
        _remove(child)
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
