"""A capture folder: the plan, the calibrated views of the print, and the truth where it is known.

The files are ``frame.json``, ``transforms.json`` (nerfstudio's, poses in mm), ``images/``, and optionally
``background/`` (the same views before printing, under the same names), ``rig.json`` (how well the cameras are known)
and ``truth.json``.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from frametwin.cameras import Camera, to_nerfstudio
from frametwin.cameras.rig_file import FILE_NAME as RIG_FILE
from frametwin.cameras.rig_file import Rig, parse_rig
from frametwin.capture.capture_checks import check_pictures, check_truth, check_views
from frametwin.capture.image_files import write_png
from frametwin.capture.paths import path_inside
from frametwin.capture.picture import Picture
from frametwin.capture.transforms import FORMAT, VERSION, entries_of, read_camera
from frametwin.errors import InputError
from frametwin.files import PathLike, decode_text, parse_json, read_bytes, staged_directory, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe

SUFFIXES = (".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
"""Of pictures whose names leave them out."""

_OWN_FILES = ("frame.json", "transforms.json", "truth.json", "images", "background")
_SAFE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


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


@dataclass(frozen=True)
class Capture:
    """A capture, read and checked, its pictures not decoded yet.

    Attributes
    ----------
    root
        The folder.
    frame
        The plan, with what has been printed.
    views
        At least two views, in the order of ``transforms.json``.
    truth
        The real geometry, with the struts of the plan, where it is known.
    documents
        What ``transforms.json`` held, and ``frame.json`` where the plan comes from it, by name.
    """

    root: Path
    frame: Wireframe
    views: tuple[View, ...]
    truth: Wireframe | None
    documents: Mapping[str, bytes] = field(default_factory=dict, repr=False)

    @property
    def pictures(self) -> Iterator[Picture]:
        """Those of all views, each view's background after its picture."""
        return (picture for view in self.views for picture in view.pictures)

    def name_of(self, picture: Picture) -> str:
        """The name of a picture in the capture, with forward slashes."""
        return picture.path.relative_to(self.root).as_posix()

    @cached_property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of plan, cameras and pictures as they were read, by name in the capture."""
        texts = {name: hashlib.sha256(data).hexdigest() for name, data in self.documents.items()}
        return {**texts, **{self.name_of(picture): picture.sha256 for picture in self.pictures}}


def read_capture(folder: PathLike, frame: Wireframe | None = None) -> Capture:
    """Read a capture folder, every file once, and check everything that needs no pixels.

    What is made of the capture later is made of what was read here, whatever becomes of the files meanwhile.

    Parameters
    ----------
    folder
        The capture.
    frame
        Takes the place of the folder's own ``frame.json``, which then need not be there, for whoever knows better what
        is printed: a print job.

    Raises
    ------
    InputError
        If a file is missing, damaged, cut short or outside of the folder, a picture's size disagrees with
        ``transforms.json``, a camera stands in the frame or does not see it, there are fewer than two views,
        nothing is printed, or the truth has other struts than the plan.
    """
    root = Path(folder)
    if not root.is_dir():
        raise InputError.at(root, "folder", "there is no such folder", "give the folder of a capture")
    documents: dict[str, bytes] = {}
    frame_file = path_inside(root, "frame.json", root / "frame.json", "file")
    if frame is None:
        documents["frame.json"] = read_bytes(frame_file)
        frame = frame_json.parse(_parsed(documents["frame.json"], frame_file), frame_file)
    if not frame.printed.any():
        raise InputError.at(frame_file, "printed", "no strut is printed", "mark the struts that have been printed")
    transforms = path_inside(root, "transforms.json", root / "transforms.json", "file")
    documents["transforms.json"] = read_bytes(transforms)
    views = _read_views(root, _parsed(documents["transforms.json"], transforms), transforms)
    rig = path_inside(root, RIG_FILE, root / RIG_FILE, "file")
    if rig.exists():
        documents[RIG_FILE] = read_bytes(rig)
        views = _as_well_known(views, parse_rig(_parsed(documents[RIG_FILE], rig), rig))
    check_views(frame, [view.camera for view in views], transforms)
    truth = None
    truth_file = path_inside(root, "truth.json", root / "truth.json", "file")
    if truth_file.exists():
        truth = frame_json.read(truth_file)
        check_truth(truth, frame, truth_file)
    return Capture(root=root, frame=frame, views=tuple(views), truth=truth, documents=documents)


def _parsed(data: bytes, path: Path) -> dict[str, Any]:
    return parse_json(decode_text(data, path), path)


def _read_views(root: Path, data: dict[str, Any], path: Path) -> list[View]:
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
        views.append(View(camera=camera, image=image, background=_background(root, file, camera, path, i)))
    return views


def _as_well_known(views: Sequence[View], rig: Rig) -> list[View]:
    """The views with how well the rig knows their cameras, by name."""
    known = {camera.name: camera.deviations for camera in rig.cameras}
    return [
        replace(view, camera=replace(view.camera, deviations=known.get(view.camera.name, view.camera.deviations)))
        for view in views
    ]


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


def _background(root: Path, image: Path, camera: Camera, path: Path, i: int) -> Picture | None:
    """Read the view before printing: the same name below ``background/`` as below ``images/``."""
    folder = path_inside(root, "background", root / "background", "folder")
    if not folder.exists():
        return None
    relative = image.relative_to(root)
    name = PurePosixPath("background", *(relative.parts[1:] or relative.parts))
    background = path_inside(root, str(name), path, f"frames[{i}].file_path")
    if not background.is_file():
        raise InputError.at(
            background,
            "background",
            "the view before printing is missing",
            "put it there, or remove the folder",
        )
    return _picture(background, camera, path, f"frames[{i}]")


def write_capture(
    folder: PathLike,
    frame: Wireframe,
    cameras: Sequence[Camera],
    images: Sequence[np.ndarray],
    truth: Wireframe | None = None,
    backgrounds: Sequence[np.ndarray] | None = None,
    extra: dict[str, dict[str, Any]] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a capture folder, whole or not at all.

    Parameters
    ----------
    folder
        The folder to be; it must not exist, or be empty, unless ``overwrite`` is true.
    frame
        The plan, with what has been printed.
    cameras, images
        The views: (H, W) or (H, W, 3) uint8 (red, green, blue) for each camera, of the camera's size.
    truth
        The real geometry, with the struts of the plan.
    backgrounds
        The same views before printing.
    extra
        Further JSON files by name, such as how the capture was made.

    Raises
    ------
    InputError
        If anything would be refused by `read_capture`, or the folder cannot be written. Nothing is left
        behind then.
    """
    pictures = {"images": images} if backgrounds is None else {"images": images, "background": backgrounds}
    check_pictures(folder, cameras, pictures)
    with staged_directory(folder, overwrite) as staged:
        cameras = write_description(staged, frame, cameras, truth, extra, name=folder)
        for kind, kind_pictures in pictures.items():
            (staged / kind).mkdir()
            for camera, picture in zip(cameras, kind_pictures, strict=True):
                write_png(staged / kind / f"{camera.name}.png", picture)


def write_description(
    folder: Path,
    frame: Wireframe,
    cameras: Sequence[Camera],
    truth: Wireframe | None = None,
    extra: dict[str, dict[str, Any]] | None = None,
    name: PathLike | None = None,
) -> tuple[Camera, ...]:
    """Write all of a capture but its pictures, into a folder that exists and is not the capture's own place yet.

    Parameters
    ----------
    folder
        Where to write; for a capture that shall be whole or not at all, a folder that is renamed in the end.
    frame, cameras, truth, extra
        See `write_capture`.
    name
        What to call the folder in messages.

    Returns
    -------
    The cameras, each under the name of its picture: the picture of ``cameras[i]`` belongs into
    ``images/<cameras[i].name>.png``.

    Raises
    ------
    InputError
        As `write_capture`.
    """
    name = folder if name is None else name
    if not frame.printed.any():
        raise InputError.at(frame.name, "printed", "no strut is printed", "mark the struts that have been printed")
    check_views(frame, cameras, Path(name) / "transforms.json")
    frames = {"frame.json": frame}
    if truth is not None:
        check_truth(truth, frame, Path(name) / "truth.json")
        frames["truth.json"] = truth
    _check_extra(name, extra or {})
    files = _image_names(cameras)
    views = [to_nerfstudio(camera, f"images/{file}") for camera, file in zip(cameras, files, strict=True)]
    transforms = {"format": FORMAT, "version": VERSION, "camera_model": "OPENCV", "frames": views}
    for file, content in frames.items():
        frame_json.write(folder / file, content)
    for file, notes in {"transforms.json": transforms, **(extra or {})}.items():
        write_json(folder / file, notes)
    return tuple(replace(camera, name=Path(file).stem) for camera, file in zip(cameras, files, strict=True))


def _check_extra(folder: PathLike, names: Iterable[str]) -> None:
    for name in names:
        if name in _OWN_FILES or not name.endswith(".json") or not _SAFE_NAME.fullmatch(name):
            raise InputError.at(folder, "extra", f"{name!r} is not a free file name", "name it like notes.json")


def _image_names(cameras: Sequence[Camera]) -> list[str]:
    """Name the pictures after their cameras, or by number if those names make no distinct file names."""
    names = [camera.name.removesuffix(".png") for camera in cameras]
    distinct = len({name.lower() for name in names}) == len(names)
    if not distinct or not all(_SAFE_NAME.fullmatch(name) and "." not in name for name in names):
        names = [f"view_{i:02d}" for i in range(len(cameras))]
    return [f"{name}.png" for name in names]
