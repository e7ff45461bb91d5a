"""The views of a ``transforms.json`` (nerfstudio's, poses in mm): their cameras, without their pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.cameras import Camera, from_nerfstudio
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json
from frametwin.formats import frame_json

FORMAT = "frametwin-capture"
VERSION = 1

APPLIED = ("applied_transform", "applied_scale")
"""What nerfstudio's converters did to the poses that they were given: turned their axes, scaled their positions."""


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
    entries, shared = entries_of(read_json(file), file)
    stems = [PurePosixPath(str(entry.get("file_path", f"view_{i:02d}"))).stem for i, entry in enumerate(entries)]
    return tuple(read_camera(entry, shared, stems[i], file, i) for i, entry in enumerate(entries))


def entries_of(data: dict[str, Any], path: Path) -> tuple[list[dict[str, Any]], dict[str, Any]]:
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


def read_camera(
    entry: dict[str, Any],
    shared: dict[str, Any],
    name: str,
    path: Path,
    i: int,
    size: tuple[int, int] | None = None,
) -> Camera:
    """The camera of view ``i`` of the file ``path``, from its entry and what all views share.

    What converters have applied to the poses is undone, and a ``unit`` of the file is converted to mm.

    Parameters
    ----------
    entry, shared
        See `entries_of`.
    name
        The camera's.
    path, i
        Where it stands.
    size
        Width and height in pixels of its picture, for files that leave it to the picture.

    Raises
    ------
    InputError
        If something is missing, or its pose is not rigid.
    """
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
    source = f"{path}: frames[{i}]"
    camera = from_nerfstudio(entry, shared=shared, name=name, size=size, source=source)
    turn, scale = _applied(shared, path)
    if turn is None and scale == 1.0:
        return camera
    pose = np.array(camera.camera_to_world)
    pose[:3, 3] *= scale
    return replace(camera, camera_to_world=pose if turn is None else turn @ pose)


def _applied(shared: Mapping[str, Any], path: Path) -> tuple[np.ndarray | None, float]:
    """The motion (4, 4) and the factor of positions that take the poses of a file back to where they were, in mm."""
    millimetres, turn = frame_json.UNITS[frame_json.unit_of(shared, path)], None
    applied = shared.get("applied_scale", 1.0)
    scale = float(checked_array(applied, "f", (), str(path), "applied_scale"))
    if not 1e-9 <= scale <= 1e9:
        raise InputError.at(path, "applied_scale", f"is {scale:g}", "give the factor that positions were multiplied by")
    if shared.get("applied_transform") is not None:
        field, rows = "applied_transform", shared["applied_transform"]
        if isinstance(rows, list) and len(rows) == 4:
            rows = checked_array(rows, "f", (4, 4), str(path), field)[:3].tolist()
        motion = np.vstack([checked_array(rows, "f", (3, 4), str(path), field), [0.0, 0.0, 0.0, 1.0]])
        rotation = motion[:3, :3]
        if np.abs(rotation.T @ rotation - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
            problem, remedy = "is not a rigid motion", "give the rotation and shift that the converter applied"
            raise InputError.at(path, field, problem, remedy)
        motion[:3, 3] *= millimetres
        turn = np.linalg.inv(motion)
    return turn, millimetres / scale
