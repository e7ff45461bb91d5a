"""Captures from a rig: raw pictures of its cameras, the plan, and what the rig knows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.pictures import ENDINGS
from frametwin.cameras.lens_models import FISHEYE, project
from frametwin.cameras.rig_file import FILE_NAME, Rig, RigCamera, rig_data
from frametwin.capture.capture import write_capture
from frametwin.capture.image_files import image_size
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report

Floats = NDArray[np.float64]


def capture_from_rig(
    rig: Rig,
    pictures: PathLike,
    frame: Wireframe,
    out: PathLike,
    *,
    base: Floats | None = None,
    background: PathLike | None = None,
    moment: str | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> tuple[str, ...]:
    """Make a capture folder.

    Parameters
    ----------
    rig
        With poses in the robot's world.
    pictures
        A folder with a picture for each camera, named after it, or with a folder of pictures for each camera.
    frame
        The plan, with what has been printed.
    out
        The capture to be.
    base : (4, 4) array, mm
        From the plan's axes to the robot's; by default they are the same. The capture is in the plan's.
    background
        The same of the views before printing.
    moment
        Name of the pictures, where the folders of the cameras hold several.
    overwrite
        Replace an existing folder.
    progress
        Called after each camera.

    Returns
    -------
    names
        Of the rig's cameras of which there is no picture.

    Raises
    ------
    InputError
        If the robot's world is not known, pictures are missing, ambiguous or of another size, or the cameras do not see
        the frame.
    """
    rig = rig.in_plan(base)
    files = {camera.name: _picture_of(Path(pictures), camera.name, moment) for camera in rig.cameras}
    used = [camera for camera in rig.cameras if files[camera.name] is not None]
    if len(used) < 2:
        names = ", ".join(f"{camera.name}.png" for camera in rig.cameras[:3])
        problem = f"holds pictures of {len(used)} of the rig's {len(rig.cameras)} cameras"
        raise InputError.at(pictures, "folder", problem, f"name them after the cameras: {names} ...")
    before = [] if background is None else [_picture_before(Path(background), camera.name) for camera in used]
    views, grounds = [], []
    for i, camera in enumerate(used):
        views.append(_view(camera, files[camera.name]))
        grounds += [_view(camera, file)[1] for file in before[i : i + 1]]
        report(progress, Progress("reading pictures", i + 1, len(used)))
    shown = replace(rig, cameras=tuple(camera for camera, _ in views))
    write_capture(
        out,
        frame,
        [camera.as_camera() for camera in shown.cameras],
        [image for _, image in views],
        backgrounds=None if background is None else grounds,
        extra={FILE_NAME: rig_data(shown)},
        overwrite=overwrite,
    )
    return tuple(name for name, file in files.items() if file is None)


def pictures_named(folder: Path, name: str) -> list[Path]:
    """Pictures in a folder that have the name of a camera, in any format."""
    beside = [folder / f"{name}{ending}" for ending in (*ENDINGS, *(ending.upper() for ending in ENDINGS))]
    return sorted({path.resolve(): path for path in beside if path.is_file()}.values())


def _picture_of(folder: Path, name: str, moment: str | None) -> Path | None:
    """The picture of a camera, if there is one."""
    if not folder.is_dir():
        raise InputError.at(folder, "folder", "there is no such folder", "give the folder with the pictures")
    found = pictures_named(folder, name)
    own = folder / name
    if not found and own.is_dir():
        found = sorted(path for path in own.iterdir() if path.suffix.lower() in ENDINGS)
        found = [path for path in found if moment is None or path.stem == moment]
    if len(found) > 1:
        problem = f"there are {len(found)} pictures of {name}"
        raise InputError.at(
            folder, name, problem, "leave one of them, or say with --moment which (name without ending)"
        )
    return found[0] if found else None


def _picture_before(folder: Path, name: str) -> Path:
    """The picture of a camera before printing, which has to be there."""
    file = _picture_of(folder, name, None)
    if file is None:
        remedy = "give one for each camera of which there is a picture"
        raise InputError.at(folder, name, "its picture before printing is missing", remedy)
    return file


def _view(camera: RigCamera, path: Path | None) -> tuple[RigCamera, NDArray[np.uint8]]:
    """Camera and picture (H, W, 3) for everything else: pictures of a fisheye become those of a perspective lens."""
    assert path is not None
    if path.suffix.lower() in (".png", ".jpg", ".jpeg"):
        image_size(path)
    data = np.fromfile(path, dtype=np.uint8)
    found = cv2.imdecode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION) if data.size else None
    if found is None:
        raise InputError.at(path, "image", "cannot be decoded", "save it again, as PNG or JPEG")
    image = np.asarray(found[..., ::-1], dtype=np.uint8)
    if image.shape[:2] != (camera.height, camera.width):
        problem = f"is {image.shape[1]} x {image.shape[0]} pixels, the camera has {camera.width} x {camera.height}"
        raise InputError.at(path, "size", problem, "give the picture as it was taken, or calibrate again")
    if (image[..., :1] == image).all():
        image = image[..., 0]
    if camera.model != FISHEYE:
        return camera, np.ascontiguousarray(image)
    return _perspective(camera, np.ascontiguousarray(image))


def _perspective(camera: RigCamera, image: NDArray[np.uint8]) -> tuple[RigCamera, NDArray[np.uint8]]:
    """A fisheye picture as a perspective camera of the same focal length has it; what is beyond is cut."""
    fl_x, fl_y, cx, cy = camera.lens[:4].tolist()
    y, x = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float64) + 0.5
    directions = np.stack([(x - cx) / fl_x, (y - cy) / fl_y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    pixels = project(camera.model, camera.lens, directions)[0] - 0.5
    maps = pixels.astype(np.float32).reshape(camera.height, camera.width, 2)
    flat = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)
    return camera.straightened(), np.asarray(flat, dtype=np.uint8)
