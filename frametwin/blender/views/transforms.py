"""Rigs of cameras from and to nerfstudio's ``transforms.json``, poses in mm."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import bpy
import idprop

from frametwin.blender.scene.placement import label
from frametwin.blender.views.backgrounds import add_background, check_shape
from frametwin.blender.views.cameras import KEY, cameras_in
from frametwin.blender.views.rigs import cameras_from_collection, rig_to_blender
from frametwin.cameras import Camera, transforms_of
from frametwin.capture.transforms import FORMAT, VERSION, read_cameras
from frametwin.errors import InputError
from frametwin.files import PathLike, read_json, write_json
from frametwin.geometry.wireframe import Wireframe

FILE_PATH = "file_path"  # of a camera that came out of such a file, in the group `KEY` of the object


def read_transforms(
    path: PathLike,
    scene: bpy.types.Scene | None = None,
    name: str | None = None,
    *,
    target: Wireframe | None = None,
    backgrounds: bool = True,
) -> bpy.types.Collection:
    """Make camera objects of a ``transforms.json``, with its pictures behind them.

    Parameters
    ----------
    path
        The file; the pictures need not be there.
    scene, name, target
        See `rig_to_blender`; the name is that of the folder by default.
    backgrounds
        Whether pictures that are there become the cameras' backgrounds, see `add_background`.

    Raises
    ------
    InputError
        If the file is missing or damaged, or a picture has another shape than its camera; nothing is made then.
    """
    file = Path(path)
    cameras = read_cameras(file)
    places = [str(entry.get("file_path", "")) for entry in read_json(file)["frames"]]
    pictures = [file.parent / place if backgrounds and _is_picture(file.parent, place) else None for place in places]
    for camera, picture in zip(cameras, pictures, strict=True):
        if picture is not None:
            check_shape(picture, camera.width, camera.height)
    collection = rig_to_blender(cameras, scene, name or file.resolve().parent.name or "Cameras", target=target)
    for obj, place, picture in zip(cameras_in(collection.objects), places, pictures, strict=True):
        if place:
            obj[KEY][FILE_PATH] = place
        if picture is not None:
            add_background(obj, picture)
    return collection


def _is_picture(folder: Path, place: str) -> bool:
    """Whether a picture is there, in the folder: what a file names elsewhere is not opened."""
    inside = bool(place) and not PurePosixPath(place).is_absolute() and "\\" not in place
    if not inside or not (folder / place).is_file():
        return False
    return (folder / place).resolve().is_relative_to(folder.resolve())


def write_transforms(
    path: PathLike, collection: bpy.types.Collection, scene: bpy.types.Scene | None = None
) -> tuple[Camera, ...]:
    """Write the cameras of a collection as a ``transforms.json``.

    Each names the picture it was read with, else ``images/<its name>.png``.

    Returns
    -------
    The cameras, in the order of the file.

    Raises
    ------
    InputError
        If a camera cannot be read, a name is no file name, two name the same picture, or the file cannot be written.
    """
    cameras = cameras_from_collection(collection, scene)
    places = [_file_path(obj, camera) for obj, camera in zip(cameras_in(collection.all_objects), cameras, strict=True)]
    for place in places:
        if places.count(place) > 1:
            raise InputError.at(
                f"collection {collection.name}",
                "cameras",
                f"two are of the picture {place}",
                "give every camera a name of its own",
            )
    write_json(Path(path), {"format": FORMAT, "version": VERSION, **transforms_of(cameras, places)})
    return cameras


def _file_path(obj: bpy.types.Object, camera: Camera) -> str:
    kept = obj.get(KEY)
    if isinstance(kept, idprop.types.IDPropertyGroup) and kept.get("object") == obj.name and FILE_PATH in kept:
        return str(kept[FILE_PATH])
    name = camera.name.removesuffix(".png")
    if not name.strip(". ") or any(char in '<>:"/\\|?*' or ord(char) < 32 for char in name):
        raise InputError.at(label(obj), "name", f"{name!r} is no file name", "name cameras like camera_00")
    return f"images/{name}.png"
