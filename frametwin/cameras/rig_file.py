"""Rig folders: calibrated cameras as a thing of their own, with how well they are known.

``rig.json`` (format ``frametwin-rig``, version 1) holds all; ``transforms.json`` beside it serves other tools.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frametwin.arrays import checked_array, is_plain_text
from frametwin.cameras.camera import MAX_PIXELS, Camera
from frametwin.cameras.conversions import OPENGL_AXES
from frametwin.cameras.lens_models import LENS_KEYS, PERSPECTIVE
from frametwin.cameras.plate import Plate, parse_plate
from frametwin.cameras.standing import rigid_pose
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json

Floats = NDArray[np.float64]

FORMAT, VERSION = "frametwin-rig", 1
FILE_NAME = "rig.json"
WORLDS = ("none", "camera", "robot")
"""What the poses are given in: none are known, the axes of the rig's first camera, or the robot's."""

STEPS = ("intrinsics", "extrinsics", "place")
"""Of a calibration, in their order."""

DRIFT = np.array([*3 * [np.deg2rad(0.03)], *3 * [0.2], 5e-4, *2 * [0.3], 1e-3])
"""Standard deviations of what comes on top of a calibration's own errors until the print is seen, of the freedoms that
`frametwin.cameras.Camera` has: warmth, a touched table, a creeping focus. These are the errors of a good calibration
that is repeated."""

POSE_KEYS = ("rotation_x", "rotation_y", "rotation_z", "x", "y", "z")
"""A small turn about the camera's own axes (OpenCV's) in radians, and the place of its centre in the world in mm."""


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera of a rig.

    Attributes
    ----------
    name
        The camera's name.
    width, height
        Size of its pictures in pixels.
    model
        ``OPENCV`` or ``OPENCV_FISHEYE``.
    lens : (P,) array, px
        ``fl_x``, ``fl_y``, ``cx``, ``cy`` (pixel centres at +0.5) and the coefficients of the model, in the order of
        `frametwin.cameras.lens_models.LENS_KEYS`.
    camera_to_world : (4, 4) array, mm
        Pose with OpenCV axes; None as long as it is not known.
    covariance : (P, P) or (P + 6, P + 6) array
        Of the parameters of the lens and, where the pose is known, of `POSE_KEYS`; in px, radians and mm. Rows and
        columns of what is held fixed are zero.
    residuals
        Figures on how well the calibration fits, such as ``rms_px``.
    """

    name: str
    width: int
    height: int
    model: str
    lens: Floats
    camera_to_world: Floats | None = None
    covariance: Floats | None = None
    residuals: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, camera: Camera, covariance: Floats | None = None) -> RigCamera:
        """A camera at its place, as a rig has it, with how well it is known."""
        lens = np.array([camera.fl_x, camera.fl_y, camera.cx, camera.cy, *camera.distortion])
        pose = np.array(camera.camera_to_world)
        return cls(camera.name, camera.width, camera.height, camera.model, lens, pose, covariance)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the rows of the covariance."""
        return LENS_KEYS[self.model] + (() if self.camera_to_world is None else POSE_KEYS)

    @property
    def centre(self) -> Floats:
        """(3,) position in the world, mm; the pose has to be known."""
        assert self.camera_to_world is not None
        return self.camera_to_world[:3, 3]

    @property
    def freedoms_covariance(self) -> Floats | None:
        """(10, 10) as `frametwin.cameras.Camera` has it, with `DRIFT`; None where pose or covariance is not known."""
        if self.camera_to_world is None or self.covariance is None:
            return None
        first = len(self.keys) - len(POSE_KEYS)
        rows = np.zeros((10, len(self.keys)))
        rows[range(3), range(first, first + 3)] = -1.0  # there the picture's content turns, here the camera
        rows[range(3, 6), range(first + 3, first + 6)] = 1.0
        rows[6, :2] = 0.5 / self.lens[:2]
        rows[[7, 8, 9], [2, 3, 4]] = 1.0
        return np.asarray(rows @ self.covariance @ rows.T + np.diag(DRIFT**2))

    def straightened(self) -> RigCamera:
        """The camera as captures have it: of a fisheye, a perspective camera of the same focal length at its place.

        What is not known of the fisheye's bending is left out of the covariance.
        """
        if self.model == PERSPECTIVE:
            return self
        covariance = None
        if self.covariance is not None:
            before = [0, 1, 2, 3, *range(len(self.lens), len(self.covariance))]
            after = [0, 1, 2, 3, *range(9, 5 + len(before))]
            covariance = np.zeros((5 + len(before), 5 + len(before)))
            covariance[np.ix_(after, after)] = self.covariance[np.ix_(before, before)]
        lens = np.array([*self.lens[:4], *np.zeros(5)])
        return replace(self, model=PERSPECTIVE, lens=lens, covariance=covariance)

    def as_camera(self) -> Camera:
        """The camera for everything else in FrameTwin.

        Raises
        ------
        InputError
            If it is a fisheye, or its pose is not known.
        """
        if self.model != PERSPECTIVE:
            problem = f"is {self.model}, which only the rig knows"
            raise InputError.at(f"camera {self.name}", "model", problem, "undistort its pictures first")
        if self.camera_to_world is None:
            remedy = "run frametwin calibrate extrinsics first"
            raise InputError.at(f"camera {self.name}", "transform_matrix", "the pose is not known", remedy)
        fl_x, fl_y, cx, cy = self.lens[:4].tolist()
        pose, lens, known = self.camera_to_world, self.lens[4:9], self.freedoms_covariance
        return Camera(self.name, self.width, self.height, fl_x, fl_y, cx, cy, pose, lens, covariance=known)


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras that were calibrated together.

    Attributes
    ----------
    cameras
        At least one, with different names.
    world
        One of `WORLDS`.
    board
        The board as it is written on the command line.
    placed_by
        The object that tells where the robot's world is, and where it stood; empty as long as it is not known.
    date
        Day and time of the calibration, as ISO 8601 writes it.
    notes
        What a user should know, each with the ``step`` that found it and a ``text``.
    left_out
        Pictures (or single corners of them) that were not used, each with ``step``, ``camera``, ``picture`` and
        ``reason``.
    plate
        Markers in the robot's world that all pictures show; None where there are none.
    """

    cameras: tuple[RigCamera, ...]
    world: str = "none"
    board: str = ""
    placed_by: dict[str, Any] = field(default_factory=dict)
    date: str = ""
    notes: tuple[dict[str, str], ...] = ()
    left_out: tuple[dict[str, str], ...] = ()
    plate: Plate | None = None

    def camera(self, name: str) -> RigCamera:
        """The camera of a name, which has to be there."""
        return next(camera for camera in self.cameras if camera.name == name)

    def in_plan(self, base: Floats | None = None) -> Rig:
        """The same rig in the axes of a plan.

        Parameters
        ----------
        base : (4, 4) array, mm
            From the plan's axes to the robot's; by default they are the same.

        Raises
        ------
        InputError
            If its world is not the robot's.
        """
        if self.world != "robot":
            remedy = "run frametwin calibrate place, so that plan and cameras have one world"
            raise InputError.at(FILE_NAME, "world", "is not the robot's", remedy)
        return self if base is None else self.moved(np.linalg.inv(base))

    def before(self, step: str) -> tuple[tuple[dict[str, str], ...], tuple[dict[str, str], ...]]:
        """Notes and what was left out of the steps before one that is done again."""
        earlier = STEPS[: STEPS.index(step)]
        notes, left_out = (
            tuple(item for item in items if item.get("step") in earlier) for items in (self.notes, self.left_out)
        )
        return notes, left_out

    @property
    def names(self) -> tuple[str, ...]:
        """Of all cameras."""
        return tuple(camera.name for camera in self.cameras)

    def moved(self, motion: Floats) -> Rig:
        """The same rig in a world that differs by a rigid motion.

        Parameters
        ----------
        motion : (4, 4) array, mm
            From the present world to the new one; taken to be exact.
        """
        plate = None if self.plate is None else self.plate.moved(motion)
        return replace(self, cameras=tuple(_moved(camera, motion) for camera in self.cameras), plate=plate)


def noted(step: str, texts: Iterable[str]) -> tuple[dict[str, str], ...]:
    """Sentences of a step as they stand in ``rig.json``."""
    return tuple({"step": step, "text": text} for text in texts)


def _moved(camera: RigCamera, motion: Floats) -> RigCamera:
    assert camera.camera_to_world is not None
    covariance = camera.covariance
    if covariance is not None:
        turn = np.eye(len(covariance))
        turn[-3:, -3:] = motion[:3, :3]
        covariance = turn @ covariance @ turn.T
    return replace(camera, camera_to_world=motion @ camera.camera_to_world, covariance=covariance)


def write_rig(folder: Path, rig: Rig) -> None:
    """Write ``rig.json`` and, where the poses are known, ``transforms.json`` into a folder that exists."""
    write_json(folder / FILE_NAME, rig_data(rig))
    if rig.world != "none":
        write_json(folder / "transforms.json", transforms(rig))


def rig_data(rig: Rig) -> dict[str, Any]:
    """What ``rig.json`` holds."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "date": rig.date,
        "world": rig.world,
        "board": rig.board,
        "object": rig.placed_by or None,
        **({} if rig.plate is None else {"plate": rig.plate.as_dict()}),
        "notes": list(rig.notes),
        "left_out": list(rig.left_out),
        "cameras": [_written(camera) for camera in rig.cameras],
    }


def _written(camera: RigCamera) -> dict[str, Any]:
    pose = None if camera.camera_to_world is None else camera.camera_to_world @ OPENGL_AXES
    return {
        "name": camera.name,
        "w": camera.width,
        "h": camera.height,
        "model": camera.model,
        **dict(zip(LENS_KEYS[camera.model], camera.lens.tolist(), strict=True)),
        "transform_matrix": None if pose is None else pose.tolist(),
        "covariance_of": list(camera.keys),
        "covariance": None if camera.covariance is None else camera.covariance.tolist(),
        "residuals": camera.residuals,
    }


def transforms(rig: Rig) -> dict[str, Any]:
    """The cameras as nerfstudio's ``transforms.json`` has them, each with its own lens; pictures are not there."""
    frames = []
    for camera in rig.cameras:
        written = _written(camera)
        lens = {key: written[key] for key in ("w", "h", *LENS_KEYS[camera.model], "transform_matrix")}
        frames.append({"file_path": f"images/{camera.name}.png", "camera_model": camera.model, **lens})
    return {"camera_model": rig.cameras[0].model, "frames": frames}


def read_rig(folder: PathLike) -> Rig:
    """Read the rig of a folder, or of its ``rig.json``.

    Raises
    ------
    InputError
        If the file is missing or damaged, a camera is not one, or two have the same name.
    """
    path = Path(folder)
    path = path / FILE_NAME if path.is_dir() or path.suffix != ".json" else path
    return parse_rig(read_json(path), path)


def parse_rig(data: dict[str, Any], path: Path) -> Rig:
    """The rig that a file holds; see `read_rig`, whose errors it has."""
    check_format(data, path, FORMAT, VERSION)
    world = data.get("world")
    if world not in WORLDS:
        raise InputError.at(path, "world", f"is {world!r}", f"give one of {', '.join(WORLDS)}")
    entries = data.get("cameras")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        raise InputError.at(path, "cameras", "is not a list of cameras", "write one {...} for each camera")
    cameras = tuple(_read_camera(entry, world != "none", path, f"cameras[{i}]") for i, entry in enumerate(entries))
    _check_names(cameras, path)
    return Rig(
        cameras=cameras,
        world=world,
        board=_text(data, "board", path),
        placed_by=_object(data.get("object"), path, "object"),
        plate=parse_plate(data.get("plate"), path),
        date=_text(data, "date", path),
        notes=tuple(_list(data, "notes", path)),
        left_out=tuple(_list(data, "left_out", path)),
    )


def _check_names(cameras: Sequence[RigCamera], path: Path) -> None:
    names = [camera.name for camera in cameras]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError.at(path, f"cameras[{i}].name", f"{name!r} occurs twice", "give every camera its own name")


def _read_camera(entry: dict[str, Any], posed: bool, path: Path, place: str) -> RigCamera:
    name, model, source = entry.get("name"), entry.get("model"), str(path)
    if not is_plain_text(name) or not set("/\\").isdisjoint(str(name)):
        raise InputError.at(path, f"{place}.name", f"{name!r} is not a name", "give a text without slashes")
    if model not in LENS_KEYS:
        raise InputError.at(path, f"{place}.model", f"is {model!r}", f"give one of {', '.join(LENS_KEYS)}")
    numbers = {}
    for key in ("w", "h", *LENS_KEYS[model]):
        numbers[key] = float(checked_array(entry.get(key), "f", (), source, f"{place}.{key}"))
    for key in ("w", "h"):
        if numbers[key] != int(numbers[key]) or not 1 <= numbers[key] <= MAX_PIXELS:
            problem = f"{numbers[key]:g} is not a whole number from 1 to {MAX_PIXELS}"
            raise InputError.at(path, f"{place}.{key}", problem, "give the picture size in pixels")
    for key in ("fl_x", "fl_y"):
        if not 1e-3 <= numbers[key] <= 1e7:
            problem = f"{numbers[key]:g} is not a focal length"
            raise InputError.at(path, f"{place}.{key}", problem, "give it in pixels")
    pose = _read_pose(entry, path, f"{place}.transform_matrix") if posed else None
    camera = RigCamera(
        name=str(name),
        width=int(numbers["w"]),
        height=int(numbers["h"]),
        model=model,
        lens=np.array([numbers[key] for key in LENS_KEYS[model]]),
        camera_to_world=pose,
        residuals=_object(entry.get("residuals"), path, f"{place}.residuals"),
    )
    return replace(camera, covariance=_read_covariance(entry, camera, path, place))


def _read_pose(entry: dict[str, Any], path: Path, place: str) -> Floats:
    remedy = "give rotation and position in mm, OpenGL axes"
    return np.asarray(rigid_pose(entry.get("transform_matrix"), path, place, remedy) @ OPENGL_AXES)


def _read_covariance(entry: dict[str, Any], camera: RigCamera, path: Path, place: str) -> Floats | None:
    if entry.get("covariance") is None:
        return None
    order, size = entry.get("covariance_of"), len(camera.keys)
    if order != list(camera.keys):
        remedy = f"give the order {' '.join(camera.keys)}"
        raise InputError.at(path, f"{place}.covariance_of", "is another order of parameters", remedy)
    covariance = checked_array(entry["covariance"], "f", (size, size), str(path), f"{place}.covariance")
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    even = np.abs(covariance - covariance.T).max(initial=0.0) <= 1e-6 * max(float(np.abs(covariance).max()), 1e-300)
    if not even or np.linalg.eigvalsh(0.5 * (covariance + covariance.T) / np.outer(scale, scale)).min() < -1e-6:
        remedy = "give a symmetric matrix without negative variances, or null"
        raise InputError.at(path, f"{place}.covariance", "is not a covariance", remedy)
    return 0.5 * (covariance + covariance.T)


def _text(data: dict[str, Any], key: str, path: Path) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise InputError.at(path, key, "is not a text", "give a text")
    return value


def _object(value: Any, path: Path, place: str) -> dict[str, Any]:
    if value is not None and not isinstance(value, dict):
        raise InputError.at(path, place, "is not an object", "give an object in { }, or null")
    return value or {}


def _list(data: dict[str, Any], key: str, path: Path) -> list[dict[str, str]]:
    value = data.get(key, [])
    fine = isinstance(value, list) and all(isinstance(item, dict) for item in value)
    if not fine or not all(isinstance(part, str) for item in value for part in item.values()):
        raise InputError.at(path, key, "is a list of other things", "give a list of objects with texts")
    return list(value)
