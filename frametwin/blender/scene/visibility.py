"""What is in view, by the eye in the outliner: as the user hides things, so that Alt+H brings them back."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


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
    """Open an object's eye, wherever it is in a scene, and enable it in viewports."""
    if obj.hide_viewport and obj.is_editable:
        obj.hide_viewport = False
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
    """Open the eyes of all objects in a collection, and of the collection itself where it is closed in a layer."""
    if collection.hide_viewport and collection.is_editable:
        collection.hide_viewport = False
    for found in _find(layer.layer_collection, collection):
        found.hide_viewport = found.exclude = False
    for obj in collection.all_objects:
        show(obj)


def is_any_shown(collection: bpy.types.Collection, layer: bpy.types.ViewLayer) -> bool:
    """Whether at least one object of a collection is in view in a view layer."""
    return any(is_shown(obj, layer) for obj in collection.all_objects)


def _find(top: bpy.types.LayerCollection, collection: bpy.types.Collection) -> Iterator[bpy.types.LayerCollection]:
    for child in top.children:
        if child.collection == collection:
            yield child
        yield from _find(child, collection)
