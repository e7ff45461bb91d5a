"""Blender's own menus: where its users look for commands, and where F3 finds them."""

# No postponed annotations here: Blender reads them as properties.
from typing import Any

import bpy

from frametwin.geometry.parametric import FRAMES

from .computing import HAS_SET_UP
from .frames_offered import title_of
from .properties import OVERLAYS
from .twin import KINDS

STEPS: tuple[tuple[str, ...], ...] = (
    ("import_frame", "use_selected", "use_millimetres", "check_plan"),
    ("sag", "copy_to_bend"),
    ("make_rig", "import_cameras", "import_rig", "step_camera", "show_pictures", "hide_pictures", "picture_beside"),
    ("render", "capture_pictures", "show_masks"),
    ("open_capture", "fit", "import_run"),
    ("inspect", "step_strut", "leave_struts", "list_struts", "pick_strut", "export_twin", "remove_twin"),
    ("adapt", "export_adapted"),
    ("simulate_print", "plan_print", "answer_print", "show_job", "step_batch", "remove_jobs"),
    ("compare_twins", "compare_batches", "leave_batches"),
    ("cancel", "open_preferences", "test_python", *(("set_up", "show_set_up_log") if HAS_SET_UP else ())),
    ("show_help", "report_bug"),
)
"""Operators in the order of the panels, a line between two groups."""


class FRAMETWIN_MT_add(bpy.types.Menu):
    """The project's own frames"""

    bl_label = "FrameTwin"
    bl_idname = "FRAMETWIN_MT_add"

    def draw(self, context: bpy.types.Context) -> None:
        for name in FRAMES:
            self.layout.operator("frametwin.add_frame", text=title_of(name)).frame = name


class FRAMETWIN_MT_select(bpy.types.Menu):
    """Struts of the twin"""

    bl_label = "Select Struts"
    bl_idname = "FRAMETWIN_MT_select"

    def draw(self, context: bpy.types.Context) -> None:
        for kind, name, _ in KINDS:
            self.layout.operator("frametwin.select_struts", text=f"{name} Struts").kind = kind


class FRAMETWIN_MT_main(bpy.types.Menu):
    """All commands of FrameTwin"""

    bl_label = "FrameTwin"
    bl_idname = "FRAMETWIN_MT_main"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.menu("FRAMETWIN_MT_add", text="Add Frame")
        for number, group in enumerate(STEPS):
            if number:
                layout.separator()
            for name in group:
                layout.operator(f"frametwin.{name}")
                if name == "show_pictures":
                    for mode, title, _ in OVERLAYS[1:]:
                        layout.operator("frametwin.show_pictures", text=f"FrameTwin: Overlay {title}").mode = mode
            if "step_strut" in group:
                layout.menu("FRAMETWIN_MT_select")


def draw_main(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The menu of all commands, in the header of the 3D view."""
    menu.layout.menu("FRAMETWIN_MT_main")


def draw_add(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Add > Curve > FrameTwin."""
    menu.layout.separator()
    menu.layout.menu("FRAMETWIN_MT_add", icon="OUTLINER_OB_CURVE")


def draw_import(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """File > Import."""
    menu.layout.operator("frametwin.import_frame", text="FrameTwin Frame (.json/.obj/.txt/.dxf/.3dm)")
    menu.layout.operator("frametwin.import_cameras", text="FrameTwin Cameras (transforms.json, COLMAP)")
    menu.layout.operator("frametwin.import_rig", text="FrameTwin Rig (rig.json)")
    menu.layout.operator("frametwin.import_run", text="FrameTwin Run (folder)")
    menu.layout.operator("frametwin.open_file", text="FrameTwin Capture, Run or Print Job (.json)")


def draw_export(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """File > Export."""
    menu.layout.operator("frametwin.export_twin", text="FrameTwin Twin (.json/.obj/.csv)")
    menu.layout.operator("frametwin.export_adapted", text="FrameTwin Adapted Struts (.json/.obj)")


PLACES: tuple[tuple[str, Any], ...] = (
    ("VIEW3D_MT_editor_menus", draw_main),
    ("VIEW3D_MT_curve_add", draw_add),
    ("TOPBAR_MT_file_import", draw_import),
    ("TOPBAR_MT_file_export", draw_export),
)


def register() -> None:
    """Put the entries into Blender's menus."""
    for name, draw in PLACES:
        getattr(bpy.types, name).append(draw)


def unregister() -> None:
    """Take them out again."""
    for name, draw in PLACES:
        getattr(bpy.types, name).remove(draw)


CLASSES = (FRAMETWIN_MT_add, FRAMETWIN_MT_select, FRAMETWIN_MT_main)
