"""Whether the parts of a capture fit each other: cameras that see the frame, their pictures, a truth of that frame."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence

import numpy as np

from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

NEAREST_SHARE = 0.02
"""A camera keeps this share of the frame's extent from every strut (and three radii)."""

FAIR_SIZE = 0.05
"""Share of a picture that a frame covers where its cameras are no more than far away."""

_SAMPLES = 9  # points on each strut


def check_views(frame: Wireframe, cameras: Sequence[Camera], path: str | os.PathLike[str]) -> None:
    """Refuse cameras that stand in the printed frame, or do not see any of it.

    Parameters
    ----------
    frame
        The plan; its printed struts count.
    cameras
        The cameras, in the order of the views in the file ``path``.

    Raises
    ------
    InputError
        With the number of the view.
    """
    try:
        _check_views(frame, cameras, path)
    except InputError:
        if _in_metres(frame, cameras, path):
            problem = "the cameras stand as if their positions were in metres"
            remedy = 'write "unit": "m" at the top of the file, or give them in mm'
            remedy = remedy if _is_transforms(path) else "scale the model to mm, as COLMAP's model_aligner does"
            raise InputError.at(path, "unit", problem, remedy) from None
        raise


def _in_metres(frame: Wireframe, cameras: Sequence[Camera], path: str | os.PathLike[str]) -> bool:
    """Whether every camera would see the frame at a fair size, were its position a thousand times as far."""
    try:
        moved = []
        for camera in cameras:
            pose = np.array(camera.camera_to_world)
            pose[:3, 3] *= 1000.0
            moved.append(dataclasses.replace(camera, camera_to_world=pose))
        _check_views(frame, moved, path)
    except InputError:
        return False
    points = frame.control_points.reshape(-1, 3)
    sizes = [np.ptp(camera.project(points, distort=False)[0], axis=0).max() / camera.width for camera in moved]
    return bool(min(sizes) > FAIR_SIZE)


def _check_views(frame: Wireframe, cameras: Sequence[Camera], path: str | os.PathLike[str]) -> None:
    printed, _, _ = frame.printed_part()
    points = bezier.evaluate(printed.control_points, np.linspace(0.0, 1.0, _SAMPLES)).reshape(-1, 3)
    low, high = printed.bounds
    nearest = max(NEAREST_SHARE * printed.extent, 3.0 * float(printed.radius.max()))
    for i, camera in enumerate(cameras):
        own = _is_transforms(path)
        field = f"frames[{i}].transform_matrix" if own else f"image {camera.name[:60]}"
        remedy = "give the pose of the camera in mm, in the coordinates of frame.json"
        if ((camera.centre > low) & (camera.centre < high)).all():
            raise InputError.at(path, field, "the camera stands inside the frame", remedy)
        distance = float(np.linalg.norm(points - camera.centre, axis=1).min())
        if distance < nearest:
            raise InputError.at(path, field, f"the camera is only {distance:.3g} mm from a strut", remedy)
        pixels, depth = camera.project(points, distort=False)
        ahead = depth > 0.0
        if not ahead.any():
            raise InputError.at(
                path,
                field,
                "the camera faces away from the frame",
                f"{remedy} (OpenGL axes: it looks along -z)" if own else remedy,
            )
        x, y = pixels.T
        seen = ahead & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        if not seen.any():
            raise InputError.at(path, field, "the frame is outside of the picture", remedy)
        _check_lens(camera, points[seen], path, f"frames[{i}].k1" if own else field)


def _is_transforms(path: str | os.PathLike[str]) -> bool:
    """Whether the cameras come from ``transforms.json``, whose fields have names, and not from a COLMAP model."""
    return os.fspath(path).endswith(".json")


def _check_lens(camera: Camera, points: np.ndarray, path: str | os.PathLike[str], field: str) -> None:
    """Refuse a distortion without inverse where the points (N, 3) are seen, or that moves them absurdly."""
    if not camera.has_distortion:
        return
    with np.errstate(all="ignore"):  # absurd coefficients overflow; the comparison below fails then
        pixels, depth = camera.project(points)
        found = camera.unproject(pixels, depth)
        shift = np.linalg.norm(pixels - camera.project(points, distort=False)[0], axis=1)
        lost = ~(np.linalg.norm(found - points, axis=1) <= 1e-6 * depth)
        lost |= ~(shift <= 0.5 * np.hypot(camera.width, camera.height))
    if lost.mean() > 0.01:
        raise InputError.at(
            path,
            field,
            "the lens distortion folds the picture where the frame is seen",
            "calibrate the camera again",
        )


def check_truth(truth: Wireframe, frame: Wireframe, path: str | os.PathLike[str]) -> None:
    """Refuse a truth whose struts or vertices are not those of the plan, one by one.

    Raises
    ------
    InputError
        With the first strut that differs.
    """
    remedy = "give the truth the vertices and edges of frame.json, in the same order"
    if truth.vertex_count != frame.vertex_count:
        problem = f"are {truth.vertex_count} where frame.json has {frame.vertex_count}"
        raise InputError.at(path, "vertices", problem, remedy)
    if truth.strut_count != frame.strut_count:
        problem = f"are {truth.strut_count} where frame.json has {frame.strut_count}"
        raise InputError.at(path, "edges", problem, remedy)
    other = np.flatnonzero((truth.edges != frame.edges).any(axis=1))
    if other.size:
        i = int(other[0])
        found, wanted = (tuple(int(v) for v in edges[i]) for edges in (truth.edges, frame.edges))
        raise InputError.at(path, f"edges[{i}]", f"is {found} where frame.json has {wanted}", remedy)


def check_pictures(folder: PathLike, cameras: Sequence[Camera], pictures: dict[str, Sequence[np.ndarray]]) -> None:
    """Refuse pictures, by kind (H, W, ...), that are not one for each camera and of its size.

    Raises
    ------
    InputError
        With the kind and the camera.
    """
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
