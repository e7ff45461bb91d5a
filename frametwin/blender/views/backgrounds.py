"""Pictures behind (or before) what a camera sees in the viewport."""

from __future__ import annotations

from pathlib import Path

import bpy

from frametwin.blender.scene.placement import label, scene_of
from frametwin.blender.views.cameras import picture_size
from frametwin.capture.image_files import image_size
from frametwin.errors import InputError
from frametwin.files import PathLike

ASPECT_TOLERANCE = 1.0  # pixels by which a resized picture may miss the camera's shape


def add_background(
    obj: bpy.types.Object, picture: PathLike, *, opacity: float = 0.5, front: bool = False
) -> bpy.types.CameraBackgroundImage:
    """Show a picture in the view of a camera, exactly in its frame, in the place of others that it shows.

    Parameters
    ----------
    obj
        The camera.
    picture
        A PNG or JPEG file, of the camera's size or a resized one. Of a camera with lens distortion, the picture as
        taken does not quite lie on what Blender draws.
    opacity
        0..1.
    front
        In front of everything rather than behind.

    Raises
    ------
    InputError
        If the object is no camera, or the picture is missing, damaged, or of another shape than the camera's.
    """
    if obj.type != "CAMERA":
        raise InputError.at(label(obj), "type", f"is {obj.type}, not a camera", "select a camera")
    (width, height), _ = picture_size(obj, scene_of(obj))
    check_shape(Path(picture), width, height)
    image = bpy.data.images.load(str(Path(picture).resolve()), check_existing=True)
    return show_image(obj, image, opacity=opacity, front=front)


def show_image(
    obj: bpy.types.Object, image: bpy.types.Image, *, opacity: float = 0.5, front: bool = False
) -> bpy.types.CameraBackgroundImage:
    """Show an image of the camera's shape in its view, in the place of others; see `add_background`."""
    data = obj.data
    data.background_images.clear()
    data.show_background_images = True
    shown = data.background_images.new()
    shown.image = image
    # Stretched over the frame: pixel on pixel also where they are not square. Shift moves frame and picture alike.
    shown.frame_method = "STRETCH"
    shown.offset, shown.scale, shown.rotation = (0.0, 0.0), 1.0, 0.0
    shown.alpha = opacity
    shown.display_depth = "FRONT" if front else "BACK"
    return shown


def check_shape(picture: Path, width: int, height: int) -> None:
    """Refuse a picture whose sides are not those of the camera, or both the same share of them."""
    found = image_size(picture)
    if abs(found[0] * height - found[1] * width) > ASPECT_TOLERANCE * max(width, height):
        raise InputError.at(
            picture,
            "size",
            f"is {found[0]} x {found[1]} pixels, the camera's picture {width} x {height}",
            "give the picture as it was taken, or calibrate again",
        )
