"""A capture folder: the plan, the calibrated views of the print, and the truth where it is known.

The files are ``frame.json``, ``transforms.json`` (nerfstudio's, poses in mm), ``images/``, and optionally
``background/`` (the same views before printing, under the same names) and ``truth.json``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np

from frametwin.arrays import checked_array, is_plain_text
from frametwin.cameras import Camera, from_nerfstudio, to_nerfstudio
from frametwin.capture.capture_checks import check_truth, check_views
from frametwin.capture.image_files import image_size, write_png
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, staged_directory, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe

FORMAT = "frametwin-capture"
VERSION = 1

_OWN_FILES = ("frame.json", "transforms.json", "truth.json", "images", "background")
_SAFE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class View:
    """One picture of the print: its camera, its file, and the same view before printing if there is one."""

    camera: Camera
    image: Path
    background: Path | None


@dataclass(frozen=True)
class Capture:
    """A capture, checked but with its pictures unread.

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
    """

    root: Path
    frame: Wireframe
    views: tuple[View, ...]
    truth: Wireframe | None


def read_capture(folder: PathLike, frame: Wireframe | None = None) -> Capture:
    """Read a capture folder and check everything that needs no pixels.

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
    frame_file = _inside(root, "frame.json", root / "frame.json", "file")
    frame = frame_json.read(frame_file) if frame is None else frame
    if not frame.printed.any():
        raise InputError.at(frame_file, "printed", "no strut is printed", "mark the struts that have been printed")
    transforms = _inside(root, "transforms.json", root / "transforms.json", "file")
    views = _read_views(root, read_json(transforms), transforms)
    check_views(frame, [view.camera for view in views], transforms)
    truth = None
    truth_file = _inside(root, "truth.json", root / "truth.json", "file")
    if truth_file.exists():
        truth = frame_json.read(truth_file)
        check_truth(truth, frame, truth_file)
    return Capture(root=root, frame=frame, views=tuple(views), truth=truth)


def _inside(root: Path, name: str, file: Path, field: str) -> Path:
    """Return ``root / name`` unless it leads out of the folder; the name stands in ``field`` of ``file``."""
    remedy = "put the file into the capture and write its path relative to the folder, with forward slashes"
    if not is_plain_text(name):
        raise InputError.at(file, field, f"{name!r} is not a file name", remedy)
    if "\\" in name:
        raise InputError.at(file, field, f"{name!r} is not written with forward slashes", remedy)
    windows = PureWindowsPath(name)
    if PurePosixPath(name).is_absolute() or windows.drive or windows.root:
        raise InputError.at(file, field, f"{name!r} is an absolute path", remedy)
    if ".." in PurePosixPath(name).parts:
        raise InputError.at(file, field, f"{name!r} leaves the folder of the capture", remedy)
    path = root / name
    try:
        leads_out = not path.resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError) as error:  # a link to itself
        raise InputError.at(file, field, f"{name!r} is a link that leads nowhere", remedy) from error
    if leads_out:
        raise InputError.at(file, field, f"{name!r} is a link that leaves the folder of the capture", remedy)
    return path


def read_cameras(path: PathLike) -> tuple[Camera, ...]:
    """Read the cameras of a ``transforms.json`` without its pictures, which need not exist.

    Returns
    -------
    At least two cameras, each under the name of its picture without folder and suffix.

    Raises
    ------
    InputError
        If the file is missing or damaged, or holds fewer than two views.
    """
    file = Path(path)
    entries, shared = _entries(read_json(file), file)
    stems = [PurePosixPath(str(entry.get("file_path", f"view_{i:02d}"))).stem for i, entry in enumerate(entries)]
    return tuple(_read_camera(entry, shared, stems[i], file, i) for i, entry in enumerate(entries))


def _read_views(root: Path, data: dict[str, Any], path: Path) -> list[View]:
    """Read the views of ``transforms.json`` with their pictures."""
    entries, shared = _entries(data, path)
    stems = [PurePosixPath(str(entry.get("file_path"))).stem for entry in entries]
    views: list[View] = []
    taken: dict[Path, int] = {}
    for i, entry in enumerate(entries):
        image = _image_file(root, entry.get("file_path"), path, f"frames[{i}].file_path")
        key = image.resolve()
        if key in taken:
            raise InputError.at(
                path,
                f"frames[{i}].file_path",
                f"is the picture of frames[{taken[key]}] again",
                "give every view its own picture",
            )
        taken[key] = i
        name = stems[i] if stems.count(stems[i]) == 1 else str(entry["file_path"])
        camera = _read_camera(entry, shared, name, path, i)
        _check_size(image, camera, path, f"frames[{i}]")
        views.append(View(camera=camera, image=image, background=_background(root, image, camera, path, i)))
    return views


def _entries(data: dict[str, Any], path: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The views of ``transforms.json`` and what they share; files of nerfstudio carry neither format nor version."""
    if "format" in data or "version" in data:
        check_format({"format": FORMAT, **data}, path, FORMAT, VERSION)
    entries = data.get("frames")
    if entries is None:
        raise InputError.at(path, "frames", "is missing", "list the views under 'frames'")
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError.at(path, "frames", "is not a list of objects", "write one {...} for each view")
    if len(entries) < 2:
        raise InputError.at(
            path, "frames", f"holds {len(entries)} view{'s' * (len(entries) != 1)}", "give at least two views"
        )
    shared = {key: value for key, value in data.items() if key not in ("frames", "file_path", "transform_matrix")}
    return entries, shared


def _image_file(root: Path, name: Any, path: Path, field: str) -> Path:
    if name is None:
        raise InputError.at(path, field, "is missing", "name the picture of the view")
    if not isinstance(name, str):
        raise InputError.at(path, field, f"{name!r} is not a text", "name the picture of the view")
    image = _inside(root, name, path, field)
    if not image.is_file():
        raise InputError.at(path, field, f"the picture {name!r} is missing", "put it there, or correct the name")
    return image


def _read_camera(entry: dict[str, Any], shared: dict[str, Any], name: str, path: Path, i: int) -> Camera:
    field = f"frames[{i}].transform_matrix"
    matrix = checked_array(entry.get("transform_matrix"), "f", (4, 4), str(path), field)
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise InputError.at(path, field, "its last row is not 0 0 0 1", "give the camera's pose in the world")
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    if abs(float(np.linalg.det(matrix[:3, :3]))) < 1e-9 * max(1.0, float(sizes.max())) ** 3:
        raise InputError.at(path, field, "is singular", "give a rotation and a position in mm")
    if np.abs(sizes - 1.0).max() > 1e-3:
        raise InputError.at(
            path,
            field,
            "holds a scale",
            "divide the three axes by their lengths, and give the position in mm",
        )
    if np.abs(matrix[:3, :3].T @ matrix[:3, :3] - np.eye(3)).max() > 1e-3 or np.linalg.det(matrix[:3, :3]) < 0.0:
        raise InputError.at(path, field, "is not a rigid pose", "remove shear and mirroring from its rotation")
    return from_nerfstudio(entry, shared=shared, name=name, source=f"{path}: frames[{i}]")


def _check_size(image: Path, camera: Camera, path: Path, field: str) -> None:
    width, height = image_size(image)
    if (width, height) != (camera.width, camera.height):
        raise InputError.at(
            image,
            "size",
            f"is {width} x {height} pixels, {field} of {path.name} says {camera.width} x {camera.height}",
            "give the picture as it was taken, or calibrate again",
        )


def _background(root: Path, image: Path, camera: Camera, path: Path, i: int) -> Path | None:
    """Find the view before printing: the same name below ``background/`` as below ``images/``."""
    folder = _inside(root, "background", root / "background", "folder")
    if not folder.exists():
        return None
    relative = image.relative_to(root)
    name = PurePosixPath("background", *(relative.parts[1:] or relative.parts))
    background = _inside(root, str(name), path, f"frames[{i}].file_path")
    if not background.is_file():
        raise InputError.at(
            background,
            "background",
            "the view before printing is missing",
            "put it there, or remove the folder",
        )
    _check_size(background, camera, path, f"frames[{i}]")
    return background


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
    _check_pictures(folder, cameras, pictures)
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


def _check_pictures(folder: PathLike, cameras: Sequence[Camera], pictures: dict[str, Sequence[np.ndarray]]) -> None:
    if len(cameras) < 2:
        raise InputError.at(folder, "cameras", f"there are {len(cameras)}", "give at least two views")
    for kind, images in pictures.items():
        if len(images) != len(cameras):
            raise InputError.at(
                folder,
                kind,
                f"there are {len(images)} pictures and {len(cameras)} cameras",
                "give one picture for each camera",
            )
        for camera, image in zip(cameras, images, strict=True):
            if image.shape[:2] != (camera.height, camera.width):
                raise InputError.at(
                    folder,
                    f"{kind} of {camera.name}",
                    f"the picture is {image.shape[1]} x {image.shape[0]} pixels,"
                    f" its camera {camera.width} x {camera.height}",
                    "give the two the same size",
                )


def _image_names(cameras: Sequence[Camera]) -> list[str]:
    """Name the pictures after their cameras, or by number if those names make no distinct file names."""
    names = [camera.name.removesuffix(".png") for camera in cameras]
    distinct = len({name.lower() for name in names}) == len(names)
    if not distinct or not all(_SAFE_NAME.fullmatch(name) and "." not in name for name in names):
        names = [f"view_{i:02d}" for i in range(len(cameras))]
    return [f"{name}.png" for name in names]
