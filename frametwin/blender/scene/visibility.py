"""What is in view, by the eye in the outliner: as the user hides things, so that Alt+H brings them back."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from frametwin.blender.scene.collections import KEY, open_collections, paths_to


def layers_of(obj: bpy.types.Object) -> Iterator[bpy.types.ViewLayer]:
    """The view layers of all scenes that an object is in; not those from which its collection is excluded."""
    for scene in obj.users_scene:
        for layer in scene.view_layers:
            if layer.objects.get(obj.name) == obj:
                yield layer


def hide(obj: bpy.types.Object) -> None:
    """Close an object's eye, wherever it is in view."""
    for layer in layers_of(obj):
        obj.hide_set(True, view_layer=layer)


def show(obj: bpy.types.Object) -> None:
    """Open an object's eye, wherever it is in a scene, enable it in viewports, and open the collections of ours."""
    if obj.hide_viewport and obj.is_editable:
        obj.hide_viewport = False
    for scene in obj.users_scene:
        for collection in obj.users_collection:
            if KEY in collection:
                open_collections(scene, collection)
    for layer in layers_of(obj):
        obj.hide_set(False, view_layer=layer)


def is_shown(obj: bpy.types.Object, layer: bpy.types.ViewLayer) -> bool:
    """Whether an object is in view in a view layer, itself and the collections that it is in."""
    return layer.objects.get(obj.name) == obj and obj.visible_get(view_layer=layer)


def hide_all(collection: bpy.types.Collection) -> None:
    """Close the eyes of all objects in a collection."""
    for obj in collection.all_objects:
        hide(obj)


def show_all(collection: bpy.types.Collection, layer: bpy.types.ViewLayer) -> None:
    """Open the eyes of all objects in a collection, and of the collection itself where it is closed in a layer.

    Collections of ours that it is inside of are opened too.
    """
    for path in paths_to(layer.layer_collection, collection):
        for found in path:
            if found.collection == collection or KEY in found.collection:
                found.hide_viewport = found.exclude = False
                if found.collection.hide_viewport and found.collection.is_editable:
                    found.collection.hide_viewport = False
    for obj in collection.all_objects:
        show(obj)


def is_any_shown(collection: bpy.types.Collection, layer: bpy.types.ViewLayer) -> bool:
    """Whether at least one object of a collection is in view in a view layer."""
    return any(is_shown(obj, layer) for obj in collection.all_objects)
