"""The views of a capture: the camera of each, its picture, and the same view before printing.

The cameras are those of ``transforms.json``, or, where there is none, of a COLMAP model in ``sparse/0``, in ``sparse``
or in the folder itself, whose pictures are in ``images/`` under the names that the model has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from frametwin.cameras import Camera
from frametwin.cameras.colmap_binary import model_files, parse_colmap
from frametwin.capture.paths import path_inside
from frametwin.capture.picture import Picture
from frametwin.capture.transforms import entries_of, read_camera
from frametwin.errors import InputError
from frametwin.files import decode_text, parse_json, read_bytes

SUFFIXES = (".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
"""Of pictures whose names leave them out."""

TRANSFORMS = "transforms.json"
MODEL_PLACES = ("sparse/0", "sparse", ".")
"""Where a COLMAP model may be in a capture."""


@dataclass(frozen=True)
class View:
    """One picture of the print: its camera, the picture, and the same view before printing if there is one."""

    camera: Camera
    image: Picture
    background: Picture | None

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Both, or the one there is."""
        return (self.image,) if self.background is None else (self.image, self.background)


def read_views(root: Path) -> tuple[list[View], Path, dict[str, bytes]]:
    """Read the views of a capture with their pictures, not decoded.

    Returns
    -------
    The views, the file that has their cameras, and what the files of the cameras held, by name in the capture.

    Raises
    ------
    InputError
        If a file is missing, damaged or outside of the folder, or a picture has not the size of its camera.
    """
    transforms = path_inside(root, TRANSFORMS, root / TRANSFORMS, "file")
    model = () if transforms.exists() else _model_of(root)
    if model:
        return _model_views(root, model)
    documents = {TRANSFORMS: read_bytes(transforms)}
    data = parse_json(decode_text(documents[TRANSFORMS], transforms), transforms)
    return _views(root, data, transforms), transforms, documents


def has_cameras(root: Path) -> bool:
    """Whether a folder has the cameras of a capture."""
    return (root / TRANSFORMS).exists() or bool(_model_of(root))


def model_pictures(root: Path) -> list[Path]:
    """The pictures that the COLMAP model of a capture names, whether they are there yet or not.

    Raises
    ------
    InputError
        If the model is damaged, or not whole yet.
    """
    cameras = parse_colmap({file: read_bytes(file) for file in _model_of(root)})
    places = [(root / "images" / camera.name, root / camera.name) for camera in cameras if "\0" not in camera.name]
    return [other if other.is_file() and not below.is_file() else below for below, other in places]


def _model_of(root: Path) -> tuple[Path, ...]:
    """The files of the COLMAP model in a capture; empty if there is none."""
    return next((found for place in MODEL_PLACES if (found := model_files(root / place))), ())


def _model_views(root: Path, model: tuple[Path, ...]) -> tuple[list[View], Path, dict[str, bytes]]:
    """The views of a COLMAP model, see `read_views`."""
    documents = {}
    for file in model:
        name = file.relative_to(root).as_posix()
        documents[name] = read_bytes(path_inside(root, name, file, "file"))
    path = model[-1]
    cameras = parse_colmap(dict(zip(model, documents.values(), strict=True)))
    if len(cameras) < 2:
        raise InputError.at(path, "images", f"holds {len(cameras)} of them", "give at least two views")
    stems = [PurePosixPath(camera.name).stem for camera in cameras]
    views: list[View] = []
    taken: set[Path] = set()
    for stem, camera in zip(stems, cameras, strict=True):
        field = f"image {camera.name[:60]}"
        below = f"images/{camera.name}"
        is_below = path_inside(root, below, path, field).is_file()
        file = _image_file(root, below if is_below else camera.name, path, field)
        if file.resolve() in taken:
            raise InputError.at(path, field, "is the picture of another view too", "give every view its own picture")
        taken.add(file.resolve())
        image = _picture(file, camera, path, field)
        named = replace(camera, name=stem if stems.count(stem) == 1 else camera.name)
        views.append(View(camera=named, image=image, background=_background(root, file, camera, path, field)))
    return views, path, documents


def _views(root: Path, data: dict[str, Any], path: Path) -> list[View]:
    """Read the views of ``transforms.json`` with their pictures."""
    entries, shared = entries_of(data, path)
    stems = [PurePosixPath(str(entry.get("file_path"))).stem for entry in entries]
    views: list[View] = []
    taken: dict[Path, int] = {}
    for i, entry in enumerate(entries):
        file = _image_file(root, entry.get("file_path"), path, f"frames[{i}].file_path")
        key = file.resolve()
        if key in taken:
            raise InputError.at(
                path,
                f"frames[{i}].file_path",
                f"is the picture of frames[{taken[key]}] again",
                "give every view its own picture",
            )
        taken[key] = i
        name = stems[i] if stems.count(stems[i]) == 1 else str(entry["file_path"])
        image = Picture.read(file)
        camera = read_camera(entry, shared, name, path, i, image.size)
        _check_size(image, camera, path, f"frames[{i}]")
        views.append(View(camera=camera, image=image, background=_background(root, file, camera, path, f"frames[{i}]")))
    return views


def _image_file(root: Path, name: Any, path: Path, field: str) -> Path:
    if name is None:
        raise InputError.at(path, field, "is missing", "name the picture of the view")
    if not isinstance(name, str):
        raise InputError.at(path, field, f"{name!r} is not a text", "name the picture of the view")
    image = path_inside(root, name, path, field)
    if image.is_file():
        return image
    # NeRF-synthetic and several exporters leave the suffix out.
    found = [other for other in (image.with_name(image.name + suffix) for suffix in SUFFIXES) if other.is_file()]
    if len(found) > 1:
        names = " and ".join(other.name for other in found)
        raise InputError.at(path, field, f"{name!r} may be {names}", "write the picture's name with its suffix")
    if not found:
        raise InputError.at(path, field, f"the picture {name!r} is missing", "put it there, or correct the name")
    return path_inside(root, found[0].relative_to(root).as_posix(), path, field)


def _picture(file: Path, camera: Camera, path: Path, field: str) -> Picture:
    """Read the picture of a camera, which stands in ``field`` of the file ``path``."""
    picture = Picture.read(file)
    _check_size(picture, camera, path, field)
    return picture


def _check_size(picture: Picture, camera: Camera, path: Path, field: str) -> None:
    width, height = picture.size
    if (width, height) != (camera.width, camera.height):
        raise InputError.at(
            picture.path,
            "size",
            f"is {width} x {height} pixels, {field} of {path.name} says {camera.width} x {camera.height}",
            "give the picture as it was taken, or calibrate again",
        )


def _background(root: Path, image: Path, camera: Camera, path: Path, field: str) -> Picture | None:
    """Read the view before printing: the same name below ``background/`` as below ``images/``."""
    folder = path_inside(root, "background", root / "background", "folder")
    if not folder.exists():
        return None
    relative = image.relative_to(root)
    name = PurePosixPath("background", *(relative.parts[1:] or relative.parts))
    background = path_inside(root, str(name), path, f"{field}.file_path")
    if not background.is_file():
        raise InputError.at(
            background,
            "background",
            "the view before printing is missing",
            "put it there, or remove the folder",
        )
    return _picture(background, camera, path, field)
