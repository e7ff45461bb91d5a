"""What the user's 3D views look at. Without a window there is none, and nothing to do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
import numpy as np

from frametwin.blender.views.framing import MARGIN, Room, camera_view, free_view

CENTIMETRE = 0.01
"""In metres, whatever a unit of the scene is: with the usual metre, lines would lie beyond what is seen of a frame."""

LABEL = 14
"""Height of words in a 3D view in pixels, at a resolution scale of 1."""

_made: set[int] = set()
"""Addresses of the editors that were made here."""


def views_of(context: bpy.types.Context) -> Iterator[tuple[bpy.types.Area, bpy.types.Region]]:
    """The 3D views of the window with their main regions; the one under the mouse first, those of no size not."""
    if context.window is None:
        return
    areas = [area for area in context.window.screen.areas if area.type == "VIEW_3D"]
    for area in sorted(areas, key=lambda area: area != context.area):
        region = next(region for region in area.regions if region.type == "WINDOW")
        if min(region.width, region.height) > 1:
            yield area, region


def corners_of(objects: Iterable[bpy.types.Object], update: bool = True) -> np.ndarray:
    """Corners of the boxes around objects that are in view: (8 N, 3), in Blender units.

    What was made a moment ago has no place yet but by an ``update``, for which there is no time while a view is drawn.
    """
    if update:
        bpy.context.view_layer.update()
    boxes = [
        np.array(obj.bound_box) @ np.array(obj.matrix_world)[:3, :3].T + np.array(obj.matrix_world)[:3, 3]
        for obj in objects
    ]
    return np.concatenate([np.zeros((0, 3)), *boxes])


def write_label(text: str, x: float, y: float) -> None:
    """Write a text into the 3D view that is being drawn, its middle at a pixel."""
    import blf

    blf.size(0, LABEL * bpy.context.preferences.system.ui_scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 1.0)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x - 0.5 * blf.dimensions(0, text)[0], y, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def see(context: bpy.types.Context, points: np.ndarray, margin: float = MARGIN) -> None:
    """Move the first 3D view to points (N, 3), in Blender units, all of them beside the sidebar and not under it.

    It also sees what is ``margin`` times as far from their middle, and what is much nearer or further away.
    """
    for area, _ in views_of(context) if len(points) else ():
        space = area.spaces.active
        view = space.region_3d
        view.view_perspective = "PERSP" if view.view_perspective == "CAMERA" else view.view_perspective
        axes = np.array(view.view_rotation.to_matrix())
        perspective = view.view_perspective == "PERSP"
        place, distance = free_view(Room.of(area.regions), points, axes, space.lens, perspective, margin)
        view.view_location, view.view_distance = place.tolist(), distance
        space.clip_start, space.clip_end = min(space.clip_start, 0.01 * distance), max(space.clip_end, 10.0 * distance)
        return


def is_through_camera(context: bpy.types.Context) -> bool:
    """Whether the first 3D view looks through a camera."""
    return any(area.spaces.active.region_3d.view_perspective == "CAMERA" for area, _ in [*views_of(context)][:1])


def look_through_camera(context: bpy.types.Context, width: float | None = None) -> None:
    """Let the first 3D view look through the scene's camera, all of its picture beside the sidebar.

    ``width`` is that of the view where it has been divided a moment ago.
    """
    for area, _ in views_of(context):
        view, camera, render = area.spaces.active.region_3d, context.scene.camera, context.scene.render
        view.view_perspective = "CAMERA"
        size = (render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y)
        zoom, offset = camera_view(Room.of(area.regions, width), size, camera.data.sensor_fit)
        view.view_camera_zoom, view.view_camera_offset = zoom, offset
        return


def suit_millimetres(context: bpy.types.Context) -> None:
    """Let the 3D views see from a tenth of a millimetre to ten metres, above a grid of centimetres."""
    for area, _ in views_of(context):
        space = area.spaces.active
        space.clip_start, space.clip_end = 0.1, 10000.0
        space.overlay.grid_scale = CENTIMETRE


def show_picture_beside(context: bpy.types.Context, image: bpy.types.Image) -> bool:
    """Show a picture in an image editor beside the 3D view, which is made if there is none; whether there is a window.

    The 3D view is divided for it, so that both show the same in the same size; it looks through the scene's camera.
    """
    if context.window is None:
        return False
    screen = context.window.screen
    editor, width = next((area for area in screen.areas if area.type == "IMAGE_EDITOR"), None), None
    if editor is None:
        found = next(views_of(context), None)
        if found is None:
            return False
        area, region = found
        room, before = Room.of(area.regions), set(screen.areas)
        covered = room.width - (room.right - room.left)
        share = min(0.75, 0.5 * (1.0 + covered / max(room.width, 1.0)))
        with context.temp_override(area=area, region=region):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=share)
        editor = next(iter(set(screen.areas) - before))
        editor.type = "IMAGE_EDITOR"
        _made.add(editor.as_pointer())
        width = abs(editor.x - area.x)
    look_through_camera(context, width)
    _show_in(context, editor, image)
    return True


def picture_editor(context: bpy.types.Context, pictures: Iterable[bpy.types.Image]) -> bpy.types.Area | None:
    """The image editor that shows one of some pictures; ``None`` if there is none."""
    names = {image.name for image in pictures if image is not None}
    for area in context.window.screen.areas if context.window is not None else ():
        if area.type == "IMAGE_EDITOR":
            image = area.spaces.active.image
            if image is not None and image.name in names:
                return area
    return None


def close_picture(context: bpy.types.Context, editor: bpy.types.Area) -> None:
    """Close an image editor that `show_picture_beside` has made; one that was there before is only emptied."""
    key = editor.as_pointer()
    if key in _made and not bpy.app.background:  # where areas that are not laid out are joined without end
        _made.discard(key)
        with context.temp_override(area=editor):
            if bpy.ops.screen.area_close.poll() and bpy.ops.screen.area_close() == {"FINISHED"}:
                return
    editor.spaces.active.image = None


def change_picture(context: bpy.types.Context, editor: bpy.types.Area, image: bpy.types.Image | None) -> None:
    """Let an image editor show another picture."""
    if image is None:
        editor.spaces.active.image = None
    else:
        _show_in(context, editor, image)


def _show_in(context: bpy.types.Context, editor: bpy.types.Area, image: bpy.types.Image) -> None:
    editor.spaces.active.image = image
    region = next(region for region in editor.regions if region.type == "WINDOW")
    with context.temp_override(area=editor, region=region):
        if bpy.ops.image.view_all.poll():
            bpy.ops.image.view_all(fit_view=True)
