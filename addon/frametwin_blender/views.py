"""What the user's 3D views look at. Without a window there is none, and nothing to do."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np


def views_of(context: bpy.types.Context) -> Iterator[tuple[bpy.types.Area, bpy.types.Region]]:
    """The 3D views of the window with their main regions; the one under the mouse first."""
    if context.window is None:
        return
    areas = [area for area in context.window.screen.areas if area.type == "VIEW_3D"]
    for area in sorted(areas, key=lambda area: area != context.area):
        yield area, next(region for region in area.regions if region.type == "WINDOW")


def frame_selected(context: bpy.types.Context) -> None:
    """Move the first 3D view to what is selected."""
    context.view_layer.update()  # what was made a moment ago has no extent yet
    for area, region in views_of(context):
        with context.temp_override(area=area, region=region):
            if bpy.ops.view3d.view_selected.poll():
                bpy.ops.view3d.view_selected()
        return


def look_at(context: bpy.types.Context, centre: np.ndarray, radius: float) -> None:
    """Move the first 3D view to a ball, in Blender units, and let it see what is much nearer."""
    for area, _ in views_of(context):
        space = area.spaces.active
        space.clip_start = min(space.clip_start, 0.1 * radius)
        view = space.region_3d
        view.view_perspective = "PERSP" if view.view_perspective == "CAMERA" else view.view_perspective
        view.view_location, view.view_distance = centre.tolist(), 6.0 * radius
        return


def look_through_camera(context: bpy.types.Context) -> None:
    """Let the first 3D view look through the scene's camera, all of its picture in sight."""
    for area, region in views_of(context):
        area.spaces.active.region_3d.view_perspective = "CAMERA"
        with context.temp_override(area=area, region=region):
            if bpy.ops.view3d.view_center_camera.poll():
                bpy.ops.view3d.view_center_camera()
        return


def suit_millimetres(context: bpy.types.Context) -> None:
    """Let the 3D views see from a tenth of a millimetre to ten metres."""
    for area, _ in views_of(context):
        space = area.spaces.active
        space.clip_start, space.clip_end = 0.1, 10000.0


def show_picture_beside(context: bpy.types.Context, image: bpy.types.Image) -> bool:
    """Show a picture in an image editor beside the 3D view, which is made if there is none; whether there is a window.

    The 3D view is halved for it.
    """
    if context.window is None:
        return False
    screen = context.window.screen
    editor = next((area for area in screen.areas if area.type == "IMAGE_EDITOR"), None)
    if editor is None:
        area, region = next(views_of(context))
        before = set(screen.areas)
        with context.temp_override(area=area, region=region):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.6)
        editor = next(iter(set(screen.areas) - before))
        editor.type = "IMAGE_EDITOR"
    editor.spaces.active.image = image
    region = next(region for region in editor.regions if region.type == "WINDOW")
    with context.temp_override(area=editor, region=region):
        if bpy.ops.image.view_all.poll():
            bpy.ops.image.view_all(fit_view=True)
    return True
