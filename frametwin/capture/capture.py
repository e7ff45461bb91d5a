"""A capture folder: the plan, the calibrated views of the print, and the truth where it is known.

The files are ``frame.json``, ``transforms.json`` (nerfstudio's, poses in mm) or a COLMAP model, ``images/``, and
optionally ``background/`` (the same views before printing, under the same names), ``rig.json`` (how well the cameras
are known) and ``truth.json``.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.cameras import Camera, transforms_of
from frametwin.cameras.plate import FILE_NAME as PLATE_FILE
from frametwin.cameras.plate import Plate, parse_plate_file
from frametwin.cameras.rig_file import FILE_NAME as RIG_FILE
from frametwin.cameras.rig_file import Rig, parse_rig
from frametwin.capture.capture_checks import check_pictures, check_truth, check_views
from frametwin.capture.image_files import write_png
from frametwin.capture.paths import path_inside
from frametwin.capture.picture import Picture
from frametwin.capture.transforms import FORMAT, VERSION
from frametwin.capture.views import View, read_views
from frametwin.errors import InputError
from frametwin.files import PathLike, decode_text, parse_json, read_bytes, staged_directory, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe

_OWN_FILES = ("frame.json", "transforms.json", "truth.json", "images", "background")
_SAFE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


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
        At least two views, in the order of the file of the cameras.
    truth
        The real geometry, with the struts of the plan, where it is known.
    plate
        Markers that lie still in the pictures: of ``plate.json``, or as the rig has them; None where there are none.
    documents
        What the files of the cameras held, and ``frame.json`` where the plan comes from it, by name.
    """

    root: Path
    frame: Wireframe
    views: tuple[View, ...]
    truth: Wireframe | None
    plate: Plate | None = None
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
        its camera's, a camera stands in the frame or does not see it, there are fewer than two views,
        nothing is printed, or the truth has other struts than the plan.
    """
    root = Path(folder)
    if not root.is_dir():
        raise InputError.at(root, "folder", "there is no such folder", "give the folder of a capture")
    documents: dict[str, bytes] = {}
    frame_file = path_inside(root, "frame.json", root / "frame.json", "file")
    if frame is None:
        documents["frame.json"] = read_bytes(frame_file)
        frame = frame_json.parse(parse_json(decode_text(documents["frame.json"], frame_file), frame_file), frame_file)
    if not frame.printed.any():
        raise InputError.at(frame_file, "printed", "no strut is printed", "mark the struts that have been printed")
    views, cameras_file, read = read_views(root)
    documents |= read
    plate = None
    rig_file = path_inside(root, RIG_FILE, root / RIG_FILE, "file")
    if rig_file.exists():
        documents[RIG_FILE] = read_bytes(rig_file)
        rig = parse_rig(parse_json(decode_text(documents[RIG_FILE], rig_file), rig_file), rig_file)
        views, plate = _as_well_known(views, rig), rig.plate
    plate_file = path_inside(root, PLATE_FILE, root / PLATE_FILE, "file")
    if plate_file.exists():
        documents[PLATE_FILE] = read_bytes(plate_file)
        plate = parse_plate_file(parse_json(decode_text(documents[PLATE_FILE], plate_file), plate_file), plate_file)
    check_views(frame, [view.camera for view in views], cameras_file)
    truth = None
    truth_file = path_inside(root, "truth.json", root / "truth.json", "file")
    if truth_file.exists():
        truth = frame_json.read(truth_file)
        check_truth(truth, frame, truth_file)
    return Capture(root=root, frame=frame, views=tuple(views), truth=truth, plate=plate, documents=documents)


def _as_well_known(views: Sequence[View], rig: Rig) -> list[View]:
    """The views with how well the rig knows their cameras, by name."""
    known = {camera.name: camera.freedoms_covariance for camera in rig.cameras}
    return [
        replace(view, camera=replace(view.camera, covariance=known.get(view.camera.name, view.camera.covariance)))
        for view in views
    ]


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
    views = transforms_of(cameras, [f"images/{file}" for file in files])
    transforms = {"format": FORMAT, "version": VERSION, **views}
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
