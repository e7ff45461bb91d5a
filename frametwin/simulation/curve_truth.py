"""The exact truth about every strut's curve in every view, and its file ``curves.npz``.

Every strut is sampled at even parameters. A sample is **visible** in a view if

- it is present: the strut is printed, and there at this parameter;
- its projection is inside of the picture;
- no other strut stands in front of it: along the ray from the camera through the sample, none is entered more than the
  sample's radius before this strut's own surface. Struts that touch or meet in a joint do not hide each other there;
- the strut does not stand in front of itself: along the ray to that point of the surface around the sample which
  faces the camera, no part of the strut is entered more than the sample's radius before. A strut seen at a slant does
  not hide itself, however small the angle; one that points at the camera shows its near end only.

Struts are solid: what a sphere of the local radius fills as it is swept along the curve, ends included.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.files import PathLike, write_bytes
from frametwin.geometry import bezier
from frametwin.geometry.radii import radii_at
from frametwin.geometry.rotation_frames import tangents as unit_tangents
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.occlusion import seen, strut_pieces

FILE_NAME = "curves.npz"
SAMPLES = 33
"""Samples of a strut, at even parameters from 0 to 1."""

END_ON = 1e-6
"""A tangent that makes a smaller angle with the ray, in radians, has no direction in the picture."""

REMEDY = "make the sample again"


@dataclass(frozen=True, eq=False)
class CurveTruth:
    """Samples of E struts at S parameters, in N views. Single precision, but for the parameters.

    Attributes
    ----------
    parameters : (S,) float64 from 0 to 1, even.
    points : (E, S, 3) world, mm.
    tangents : (E, S, 3) unit, world, in the direction of rising parameters.
    radius : (E, S) mm, the real one.
    present : (E, S) bool: the strut is printed and really there.
    pixels : (N, E, S, 2) the projected samples, pixel centres at +0.5; NaN behind the camera.
    pixel_tangents : (N, E, S, 2) unit, in the picture; zero where the curve points at the camera or is behind it.
    depth : (N, E, S) mm along the viewing direction.
    visible : (N, E, S) bool; see the module.
    cameras : the N names.
    """

    parameters: np.ndarray
    points: np.ndarray
    tangents: np.ndarray
    radius: np.ndarray
    present: np.ndarray
    pixels: np.ndarray
    pixel_tangents: np.ndarray
    depth: np.ndarray
    visible: np.ndarray
    cameras: tuple[str, ...]


def curve_truth(truth: Wireframe, present: np.ndarray, thickness: np.ndarray, cameras: Sequence[Camera]) -> CurveTruth:
    """Sample the real struts and see them from every camera.

    Parameters
    ----------
    truth
        The real geometry, in mm; its printed struts are there.
    present
        (E, 2) interval of the curve parameter at which each strut is there, ``[0, 0]`` if not at all.
    thickness
        (E, K) real radius in mm at even parameters, K >= 2, linear in between.
    cameras
        Of the views; they may have lens distortion, and stand outside of the struts.
    """
    present, thickness = np.asarray(present, dtype=np.float64), np.asarray(thickness, dtype=np.float64)
    count = truth.strut_count
    if present.shape != (count, 2) or thickness.ndim != 2 or thickness.shape[0] != count or thickness.shape[1] < 2:
        raise ValueError(f"present {present.shape} and thickness {thickness.shape} are not those of {count} struts")
    u = np.linspace(0.0, 1.0, SAMPLES)
    points = bezier.evaluate(truth.control_points, u)
    tangents = unit_tangents(truth.control_points, u)
    radius = radii_at(thickness, np.broadcast_to(u, (count, SAMPLES)))
    low, high = present[:, :1], present[:, 1:]
    there = truth.printed[:, None] & (high > low) & (u >= low) & (u <= high)
    pieces = strut_pieces(truth, present, thickness)
    pixels, directions, depth, visible = [], [], [], []
    for camera in cameras:
        place, ahead = camera.project(points)
        pixels.append(place)
        directions.append(pixel_tangents(points, tangents, camera))
        depth.append(ahead)
        visible.append(seen(points, tangents, radius, there & _inside(points, place, camera), pieces, camera))
    shape = (len(cameras), count, SAMPLES)
    return CurveTruth(
        parameters=u,
        points=points.astype(np.float32),
        tangents=tangents.astype(np.float32),
        radius=radius.astype(np.float32),
        present=there,
        pixels=np.array(pixels, dtype=np.float32).reshape(*shape, 2),
        pixel_tangents=np.array(directions, dtype=np.float32).reshape(*shape, 2),
        depth=np.array(depth, dtype=np.float32).reshape(shape),
        visible=np.array(visible, dtype=bool).reshape(shape),
        cameras=tuple(camera.name for camera in cameras),
    )


def pixel_tangents(points: np.ndarray, tangents: np.ndarray, camera: Camera) -> np.ndarray:
    """Unit directions (..., 2) in the picture of tangents (..., 3) at points (..., 3); zero where there is none."""
    rotation = camera.world_to_camera[:3, :3]
    local, along = points @ rotation.T + camera.world_to_camera[:3, 3], tangents @ rotation.T
    depth = np.where(local[..., 2:] > 0.0, local[..., 2:], np.nan)
    plane = local[..., :2] / depth
    step = along[..., :2] - plane * along[..., 2:]  # of the point on the plane at depth 1, times the depth
    # The angle between ray and tangent: the cross product, with the ray at its length.
    angle = np.linalg.norm(np.cross(local, along), axis=-1) / np.linalg.norm(local, axis=-1)
    length = np.linalg.norm(step, axis=-1, keepdims=True)
    fine = (angle >= END_ON) & (local[..., 2] > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = step / length
        if camera.has_distortion:
            near = 1e-6
            step = camera.distort(plane + near * step) - camera.distort(plane - near * step)
        step = step * (camera.fl_x, camera.fl_y)
        step = step / np.linalg.norm(step, axis=-1, keepdims=True)
    return np.where(fine[..., None], step, 0.0)


def _inside(points: np.ndarray, pixels: np.ndarray, camera: Camera) -> np.ndarray:
    """(...) bool: in front of the camera and inside of its picture."""
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= 0.0) & (pixels < (camera.width, camera.height)), axis=-1)
    if camera.has_distortion:
        # Far outside, the formula of the lens folds back into the picture; what is there has another origin.
        straight, _ = camera.project(points, distort=False)
        plane = (straight - (camera.cx, camera.cy)) / (camera.fl_x, camera.fl_y)
        back = camera.undistort((pixels[inside] - (camera.cx, camera.cy)) / (camera.fl_x, camera.fl_y))
        inside[inside] = np.linalg.norm(back - plane[inside], axis=-1) < 1e-6
    return inside


# --- The file

_SINGLE = {
    "points": ("E", "S", 3),
    "tangents": ("E", "S", 3),
    "radius": ("E", "S"),
    "pixels": ("N", "E", "S", 2),
    "pixel_tangents": ("N", "E", "S", 2),
    "depth": ("N", "E", "S"),
}
_LOGICAL = {"present": ("E", "S"), "visible": ("N", "E", "S")}


def write_curves(path: PathLike, truth: CurveTruth) -> None:
    """Write ``curves.npz``; the same truth gives the same bytes.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    arrays: dict[str, Any] = {"parameters": truth.parameters, "cameras": np.array(truth.cameras, dtype=np.str_)}
    arrays.update({name: getattr(truth, name) for name in (*_SINGLE, *_LOGICAL)})
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # not compressed: that makes it a sixth smaller and takes thirty times as long
    write_bytes(path, buffer.getvalue())


def read_curves(path: PathLike) -> CurveTruth:
    """Read ``curves.npz``, or the folder of a sample that holds one.

    Raises
    ------
    InputError
        If the file is missing or damaged, or an array is missing, of another type or shape, or holds what cannot be.
    """
    file = Path(path)
    file = file / FILE_NAME if file.is_dir() else file
    if not file.is_file():
        raise InputError.at(file, "file", "does not exist", REMEDY)
    if not zipfile.is_zipfile(file):
        raise InputError.at(file, "file", "is cut short, or no archive of arrays", REMEDY)
    try:
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {name: loaded[name] for name in loaded.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError.at(file, "file", f"cannot be read ({error})", REMEDY) from error
    _check(arrays, file)
    names = arrays.pop("cameras")
    wanted = ("parameters", *_SINGLE, *_LOGICAL)
    return CurveTruth(**{name: arrays[name] for name in wanted}, cameras=tuple(names.tolist()))


def _check(arrays: dict[str, np.ndarray], file: Path) -> None:
    for name in ("parameters", "cameras", *_SINGLE, *_LOGICAL):
        if name not in arrays:
            raise InputError.at(file, name, "is missing", REMEDY)
    if arrays["cameras"].dtype.kind != "U" or arrays["cameras"].ndim != 1:
        raise InputError.at(file, "cameras", "is no list of names", REMEDY)
    if arrays["points"].ndim != 3:
        raise InputError.at(file, "points", f"is of the shape {arrays['points'].shape}", REMEDY)
    sizes = {"N": len(arrays["cameras"]), "E": arrays["points"].shape[0], "S": arrays["points"].shape[1]}
    kinds = {"parameters": np.float64, **dict.fromkeys(_SINGLE, np.float32), **dict.fromkeys(_LOGICAL, np.bool_)}
    for name, axes in {"parameters": ("S",), **_SINGLE, **_LOGICAL}.items():
        shape = tuple(sizes.get(str(axis), axis) for axis in axes)
        found = arrays[name]
        if found.dtype != kinds[name] or found.shape != shape:
            words = f"is {found.dtype} of the shape {found.shape} where {np.dtype(kinds[name])} {shape} is needed"
            raise InputError.at(file, name, words, REMEDY)
    for name in ("parameters", "points", "tangents", "radius", "depth", "pixel_tangents"):
        if not np.isfinite(arrays[name]).all():
            raise InputError.at(file, name, "holds values that are not finite", REMEDY)
    if not (arrays["radius"] > 0.0).all():
        raise InputError.at(file, "radius", "is not above 0 everywhere", REMEDY)
    if not np.isfinite(arrays["pixels"][arrays["depth"] > 0.0]).all():
        raise InputError.at(file, "pixels", "holds values that are not finite", REMEDY)
    if (arrays["visible"] & ~(arrays["present"] & (arrays["depth"] > 0.0))).any():
        raise InputError.at(file, "visible", "is true where nothing is, or behind a camera", REMEDY)
