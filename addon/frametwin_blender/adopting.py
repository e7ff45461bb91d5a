"""Files that were made without the add-on, by scripts: what is in them is what the panels then work on."""

from __future__ import annotations

import bpy

from frametwin.blender.display.prints import is_made_print
from frametwin.blender.display.twins import is_twin
from frametwin.blender.frames.plan_objects import is_added_plan
from frametwin.blender.scene import visibility
from frametwin.blender.scene.collections import HOME, KEY


def adopt(scene: bpy.types.Scene) -> bool:
    """Choose plan, print, rig and twin of a scene in which nobody has chosen any yet; whether there was a twin.

    Only where there is one twin, in the collection of all of ours, and what is hidden stays so.
    """
    settings = scene.frametwin
    touched = (settings.plan, settings.plan_before, settings.print_object, settings.rig, settings.twin)
    if any(touched) or settings.twin_before is not None or scene.library is not None:
        return False
    ours = [child for home in scene.collection.children if home.get(KEY) == HOME for child in home.children]
    twins = [collection for collection in ours if is_twin(collection)]
    if len(twins) != 1:
        return False
    objects = [obj for collection in ours for obj in collection.objects]
    layer = scene.view_layers[0]
    plan = next((obj for obj in objects if is_added_plan(obj)), None)
    hidden = plan is not None and not visibility.is_shown(plan, layer)
    settings.plan = plan
    if hidden:
        visibility.hide(plan)
    settings.print_object = next((obj for obj in objects if is_made_print(obj)), None)
    settings.rig = next((each for each in ours if any(obj.type == "CAMERA" for obj in each.objects)), None)
    settings.twin = twins[0]
    return True


@bpy.app.handlers.persistent
def _after_load(*_: object) -> None:
    for scene in bpy.data.scenes:
        adopt(scene)


def register() -> None:
    bpy.app.handlers.load_post.append(_after_load)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_after_load)


CLASSES = ()
