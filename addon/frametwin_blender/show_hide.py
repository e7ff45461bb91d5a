"""The buttons of the panels that show and hide objects and twins, by the eye in the outliner."""

# No postponed annotations here: Blender reads them as properties.
from typing import ClassVar

import bpy

from frametwin.blender.scene import visibility
from frametwin.errors import InputError

from .steps import Step


class FRAMETWIN_OT_show_hide(Step, bpy.types.Operator):
    """Show it, or hide it"""

    bl_idname = "frametwin.show_hide"
    bl_label = "FrameTwin: Show or Hide"
    bl_options: ClassVar = {"INTERNAL", "UNDO"}

    name: bpy.props.StringProperty()  # type: ignore[valid-type]
    collection: bpy.props.BoolProperty()  # type: ignore[valid-type]

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return f"Show or hide {properties.name}, by the eye in the outliner; Alt H shows all that is hidden"

    def act(self, context: bpy.types.Context) -> None:
        layer = context.view_layer
        top = context.scene.collection
        found = (
            next((each for each in top.children_recursive if each.name == self.name), None)
            if self.collection
            else context.scene.objects.get(self.name)
        )
        if found is None:
            raise InputError(f"{self.name} is not in this scene any more: choose another one in the panel.")
        if self.collection:
            _toggle_all(found, layer)
        elif visibility.is_shown(found, layer):
            visibility.hide(found)
        else:
            visibility.show(found)


def _toggle_all(collection: bpy.types.Collection, layer: bpy.types.ViewLayer) -> None:
    if visibility.is_any_shown(collection, layer):
        visibility.hide_all(collection)
    else:
        visibility.show_all(collection, layer)


CLASSES = (FRAMETWIN_OT_show_hide,)
