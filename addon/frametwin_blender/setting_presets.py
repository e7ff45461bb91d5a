"""Presets of the rig, the print's deformation and the fit, by Blender's own preset system.

Those that the user adds are kept in Blender's folder of user presets, below ``frametwin``; some come with the
extension, in the folder ``presets`` beside this file.
"""

# No postponed annotations here: Blender reads them as properties.
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

SHIPPED = Path(__file__).parent
"""The folder that holds ``presets``."""


class _Presets(PresetPanel):
    """The list of presets in the header of a panel, with a field to add one and a button to remove each."""

    bl_label = "Presets"
    preset_operator = "script.execute_preset"


class _AddPreset(AddPresetBase):
    """Keeps the settings of a panel as a preset, or removes one."""

    bl_options: ClassVar = {"REGISTER", "INTERNAL"}

    if TYPE_CHECKING:
        name: str
        preset_subdir: str

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.remove_name or self.remove_active:
            found = bpy.utils.preset_find(self.name, self.preset_subdir, display_name=True)
            if found and Path(found).is_relative_to(SHIPPED):
                self.report({"WARNING"}, "Unable to remove default presets")
                return {"CANCELLED"}
        done: set[str] = super().execute(context)
        return done


class FRAMETWIN_PT_rig_presets(_Presets, bpy.types.Panel):
    """Presets of how cameras stand around a frame"""

    bl_idname = "FRAMETWIN_PT_rig_presets"
    preset_subdir = "frametwin/rig"
    preset_add_operator = "frametwin.add_rig_preset"


class FRAMETWIN_PT_deform_presets(_Presets, bpy.types.Panel):
    """Presets of how a print deviates from its plan"""

    bl_idname = "FRAMETWIN_PT_deform_presets"
    preset_subdir = "frametwin/deform"
    preset_add_operator = "frametwin.add_deform_preset"


class FRAMETWIN_PT_fit_presets(_Presets, bpy.types.Panel):
    """Presets of how a capture is fitted"""

    bl_idname = "FRAMETWIN_PT_fit_presets"
    preset_subdir = "frametwin/fit"
    preset_add_operator = "frametwin.add_fit_preset"


class FRAMETWIN_OT_add_rig_preset(_AddPreset, bpy.types.Operator):
    """Add or remove a preset of the rig"""

    bl_idname = "frametwin.add_rig_preset"
    bl_label = "FrameTwin: Add Rig Preset"
    preset_menu = "FRAMETWIN_PT_rig_presets"
    preset_subdir = "frametwin/rig"
    preset_defines: ClassVar = ["rig = bpy.context.scene.frametwin.cameras"]
    preset_values: ClassVar = [
        f"rig.{name}" for name in ("kind", "count", "distance", "low", "high", "lens", "width", "height")
    ]


class FRAMETWIN_OT_add_deform_preset(_AddPreset, bpy.types.Operator):
    """Add or remove a preset of the deformation"""

    bl_idname = "frametwin.add_deform_preset"
    bl_label = "FrameTwin: Add Deform Preset"
    preset_menu = "FRAMETWIN_PT_deform_presets"
    preset_subdir = "frametwin/deform"
    preset_defines: ClassVar = ["deform = bpy.context.scene.frametwin.deform"]
    preset_values: ClassVar = [  # the seed is of one print, not of a kind of print
        f"deform.{name}"
        for name in ("kind", "automatic", "peak", "how", "share", "batch", "height", "missing", "missing_share")
    ]


class FRAMETWIN_OT_add_fit_preset(_AddPreset, bpy.types.Operator):
    """Add or remove a preset of the fit"""

    bl_idname = "frametwin.add_fit_preset"
    bl_label = "FrameTwin: Add Fit Preset"
    preset_menu = "FRAMETWIN_PT_fit_presets"
    preset_subdir = "frametwin/fit"
    preset_defines: ClassVar = ["fit = bpy.context.scene.frametwin.fit"]
    preset_values: ClassVar = [  # what is of one capture is not of a kind of capture
        f"fit.{name}" for name in ("preset", "mask", "cameras", "anchor")
    ]


def register() -> None:
    """Let Blender find the presets that come along."""
    bpy.utils.register_preset_path(str(SHIPPED))


def unregister() -> None:
    """Let it forget them again."""
    bpy.utils.unregister_preset_path(str(SHIPPED))


CLASSES = (
    FRAMETWIN_PT_rig_presets,
    FRAMETWIN_PT_deform_presets,
    FRAMETWIN_PT_fit_presets,
    FRAMETWIN_OT_add_rig_preset,
    FRAMETWIN_OT_add_deform_preset,
    FRAMETWIN_OT_add_fit_preset,
)
