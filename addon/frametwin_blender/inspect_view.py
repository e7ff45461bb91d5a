"""A workspace to inspect a twin: the twin on the left, the picture on the right, both through one camera."""

# No postponed annotations here: Blender reads them as properties.
from contextlib import suppress
from typing import ClassVar

import bpy

from frametwin.blender.views.captures import PICTURE, next_camera, show_pictures
from frametwin.errors import InputError

from .folders import given_folder
from .inspect_struts import WORKSPACE, FRAMETWIN_PT_inspect, StrutsPanel, fill
from .steps import Step, needs, rig_of, settings_of, twin_of
from .views import show_picture_beside

PATIENCE = 40
"""Looks at a window at most, in which its areas are closed one by one."""

PAUSE, DRAWN = 0.05, 0.5
"""Seconds between two looks, and until the new workspace has been drawn."""


class _Arranging:
    """Leaves one 3D view in a new workspace, divided between twin and picture; Blender has its turn in between."""

    def __init__(self, window: bpy.types.Window, workspace: str) -> None:
        self.window, self.workspace, self.left = window, workspace, PATIENCE
        self.arranged = False

    def __call__(self) -> float | None:
        self.left -= 1
        try:
            if self.window not in list(bpy.context.window_manager.windows):
                return None
        except ReferenceError:  # another file has been opened
            return None
        if self.window.workspace.name != self.workspace:
            return PAUSE if self.left > 0 else None
        if not self.arranged and self.left > 0 and self._close_one():
            return PAUSE
        with bpy.context.temp_override(window=self.window):
            if not self.arranged:
                arrange(bpy.context)
                self.arranged = True
                return DRAWN
            open_tab(bpy.context)
        return None

    def _close_one(self) -> bool:
        """Close an area that is in the way; whether there was one that could be closed."""
        views = [area for area in self.window.screen.areas if area.type == "VIEW_3D"]
        kept = max(views, key=lambda area: area.width * area.height, default=None)
        for area in self.window.screen.areas:
            if kept is None or area == kept:
                continue
            with bpy.context.temp_override(window=self.window, area=area):
                if bpy.ops.screen.area_close.poll() and bpy.ops.screen.area_close() == {"FINISHED"}:
                    return True
        return False


def arrange(context: bpy.types.Context) -> None:
    """Show the twin through the scene's camera and the picture of that camera beside it, with the tab and its list."""
    for area in context.window.screen.areas:
        if area.type == "VIEW_3D":
            area.spaces.active.show_region_ui = True
    shown = picture_of(context.scene.camera)
    if shown is not None:
        show_picture_beside(context, shown)


def open_tab(context: bpy.types.Context) -> None:
    """Turn the sidebar to the tab, which is there once it has been drawn."""
    for area in context.window.screen.areas:
        for region in area.regions if area.type == "VIEW_3D" else ():
            if region.type == "UI":
                with suppress(TypeError, AttributeError):
                    region.active_panel_category = "FrameTwin"


def picture_of(camera: bpy.types.Object | None) -> bpy.types.Image | None:
    """The picture that is shown in the view of a camera."""
    return None if camera is None else camera.get(PICTURE)


class FRAMETWIN_OT_inspect(Step, bpy.types.Operator):
    """Go to the workspace Inspect: the twin on the left, the picture on the right, both through one camera"""

    bl_idname = "frametwin.inspect"
    bl_label = "FrameTwin: Inspect"
    bl_options: ClassVar = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            needs(cls, twin_of(context), "Fit a capture or import a run first")
            and needs(cls, rig_of(context), "Make a rig or import cameras first")
            and needs(cls, settings_of(context).fit.capture, "Choose the capture of the twin first (Fit > Capture)")
        )

    def act(self, context: bpy.types.Context) -> str:
        settings, scene, rig = settings_of(context), context.scene, rig_of(context)
        show_pictures(rig, given_folder(settings.fit.capture, "Capture"), opacity=1.0, front=False)
        if scene.camera is None or scene.camera.name not in rig.all_objects:
            next_camera(rig, 1, scene)
        for obj in rig.all_objects:
            if obj.type == "CAMERA":
                obj.data.show_background_images = False  # the twin alone on the left
        settings.cameras.overlay = "picture"
        count = fill(context).count
        window = context.window
        if window is None:
            raise InputError("There is no window for a workspace: start Blender with its window.")
        if WORKSPACE in bpy.data.workspaces:
            window.workspace = bpy.data.workspaces[WORKSPACE]
            return f"{count} struts"
        before = set(bpy.data.workspaces)
        bpy.ops.workspace.duplicate()
        made = next(iter(set(bpy.data.workspaces) - before))
        made.name = WORKSPACE
        bpy.app.timers.register(_Arranging(window, made.name), first_interval=PAUSE)
        return f"{count} struts"


class FRAMETWIN_PT_struts(StrutsPanel, bpy.types.Panel):
    """Every strut and its values"""

    bl_label = "Struts"
    bl_idname = "FRAMETWIN_PT_struts"
    bl_parent_id = "FRAMETWIN_PT_twin"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return twin_of(context) is not None and not FRAMETWIN_PT_inspect.poll(context)

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator("frametwin.inspect", text="Inspect beside Picture", icon="WORKSPACE")
        super().draw(context)


CLASSES = (FRAMETWIN_OT_inspect, FRAMETWIN_PT_struts)
