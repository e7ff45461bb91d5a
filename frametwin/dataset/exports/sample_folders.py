"""A folder for each sample: nerfstudio, COLMAP's text models, OBJ, and plain numpy arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.cameras import transforms_of, write_colmap_text
from frametwin.capture.capture import Capture, read_capture
from frametwin.capture.picture import Picture
from frametwin.dataset.exports.pictures import put_image
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.folder import Dataset, sample_name
from frametwin.dataset.hashes import REMEDY
from frametwin.dataset.true_curves import intervals_of
from frametwin.errors import InputError
from frametwin.files import write_json, write_text
from frametwin.formats import write_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.decoding import decoded
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.twin.twin import FILE_NAME as TWIN_FILE
from frametwin.twin.twin import read_twin

SampleWriter = Callable[[Capture, Path, Path, ExportSettings], None]
"""Writes a sample: the capture, the folder of its run, the folder to write into, and how."""

POINTS_A_STRUT = 24
"""Of the plan's point cloud, with which splatting begins."""

GREY = 200


def write_folders(
    write: SampleWriter,
    dataset: Dataset,
    stage: Path,
    settings: ExportSettings,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Write every sample of a dataset into a folder of its own below one that exists."""
    for i, entry in enumerate(dataset.samples):
        report(progress, Progress("exporting samples", i, len(dataset.samples)))
        place = stage / sample_name(entry.index)
        place.mkdir()
        write(read_capture(entry.folder), dataset.run_folder(entry.index), place, settings)
    return {}


def write_nerfstudio(capture: Capture, run: Path, place: Path, settings: ExportSettings) -> None:
    """See `frametwin.dataset.export.export_dataset`."""
    cameras, names = [], []
    for view in capture.views:
        names.append(f"images/{put_image(view.image, place / 'images', settings.link)}")
        pose = _scaled(view.camera.camera_to_world, settings.scale)
        cameras.append(replace(view.camera, camera_to_world=pose))
    told = transforms_of(cameras, names)
    transforms = {"camera_model": told["camera_model"], "ply_file_path": "plan.ply", "frames": told["frames"]}
    write_json(place / "transforms.json", transforms)
    points = settings.scale * _plan_points(capture.frame)
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"property uchar {colour}" for colour in ("red", "green", "blue")]
    rows = [f"{x:.9g} {y:.9g} {z:.9g} {GREY} {GREY} {GREY}" for x, y, z in points.tolist()]
    write_text(place / "plan.ply", "\n".join([*header, "end_header", *rows]) + "\n")


def write_colmap(capture: Capture, run: Path, place: Path, settings: ExportSettings) -> None:
    """See `frametwin.dataset.export.export_dataset`."""
    cameras = []
    for view in capture.views:
        name = put_image(view.image, place / "images", settings.link)
        pose = _scaled(view.camera.camera_to_world, settings.scale)
        cameras.append(replace(view.camera, name=name, camera_to_world=pose))
    model = place / "sparse" / "0"
    write_colmap_text(model, cameras)
    points = settings.scale * _plan_points(capture.frame)
    rows = [f"{i} {x!r} {y!r} {z!r} {GREY} {GREY} {GREY} 0" for i, (x, y, z) in enumerate(points.tolist(), start=1)]
    write_text(model / "points3D.txt", "\n".join(["# POINT3D_ID X Y Z R G B ERROR TRACK[]", *rows]) + "\n")


def write_obj(capture: Capture, run: Path, place: Path, settings: ExportSettings) -> None:
    """See `frametwin.dataset.export.export_dataset`."""
    shapes: dict[str, Wireframe] = {"plan": capture.frame}
    curves: dict[str, np.ndarray] = {}
    if capture.truth is not None:
        shapes["truth"] = capture.truth
    if (run / TWIN_FILE).is_file():
        twin = read_twin(run)
        shapes["twin"], curves["twin"] = twin.as_wireframe(capture.frame), settings.scale * twin.curves
    scale = np.diag([settings.scale] * 3 + [1.0])
    for name, shape in shapes.items():
        scaled = shape if settings.scale == 1.0 else shape.transformed(scale)
        write_frame(place / f"{name}.obj", scaled, curves.get(name))


def write_npz(capture: Capture, run: Path, place: Path, settings: ExportSettings) -> None:
    """See `frametwin.dataset.export.export_dataset`."""
    arrays: dict[str, Any] = arrays_of(capture, settings.scale)
    np.savez_compressed(place / "sample.npz", **arrays)


def arrays_of(capture: Capture, scale: float = 1.0) -> dict[str, np.ndarray]:
    """A sample as arrays: E struts, V vertices, N views.

    Parameters
    ----------
    capture
        The sample, with its truth; all of its pictures have one size.
    scale
        Length in the arrays of one mm.

    Returns
    -------
    ``images`` (N, H, W) or (N, H, W, 3) uint8, red, green, blue; ``K`` (N, 3, 3), pixel centres at +0.5;
    ``camera_to_world`` (N, 4, 4), OpenCV axes; ``camera_model`` (N,), ``OPENCV`` or ``OPENCV_FISHEYE``, and
    ``distortion`` (N, 5), k1, k2, p1, p2, k3 of the one and k1, k2, k3, k4, 0 of the other; ``edges`` (E, 2);
    ``printed`` (E,); ``radius`` (E,); ``vertices`` (V, 3) and ``control_points`` (E, 4, 3) of the plan, the same as
    ``truth_vertices`` and ``truth_control_points``; ``present`` (E, 2), the interval of the curve parameter at which
    each true strut is there.

    Raises
    ------
    InputError
        If there is no truth, or the pictures differ in size or in the number of channels.
    """
    if capture.truth is None:
        raise InputError.at(capture.root, "truth.json", "is missing", "make the sample again")
    images = [_pixels(view.image) for view in capture.views]
    if len({image.shape for image in images}) > 1:
        raise InputError.at(capture.root, "images", "are not all of one size", "export it as nerfstudio or colmap")
    cameras = [view.camera for view in capture.views]
    frame, truth = capture.frame, capture.truth
    return {
        "images": np.stack(images),
        "K": np.stack([camera.K for camera in cameras]),
        "camera_to_world": np.stack([_scaled(camera.camera_to_world, scale) for camera in cameras]),
        "camera_model": np.array([camera.model for camera in cameras]),
        "distortion": np.stack([np.array([*camera.distortion, 0.0])[:5] for camera in cameras]),
        "edges": frame.edges,
        "printed": frame.printed,
        "radius": scale * frame.radius,
        "vertices": scale * frame.vertices,
        "control_points": scale * frame.control_points,
        "truth_vertices": scale * truth.vertices,
        "truth_control_points": scale * truth.control_points,
        "present": intervals_of(capture.root, frame.printed),
    }


def _scaled(pose: np.ndarray, scale: float) -> np.ndarray:
    """A pose (4, 4) with its position in another unit."""
    scaled = np.array(pose)
    scaled[:3, 3] *= scale
    return scaled


def _plan_points(frame: Wireframe) -> np.ndarray:
    """(N, 3) mm on the printed struts of the plan: what is known before any picture is looked at."""
    u = (np.arange(POINTS_A_STRUT) + 0.5) / POINTS_A_STRUT
    return bezier.evaluate(frame.control_points[frame.printed], u).reshape(-1, 3)


def _pixels(picture: Picture) -> np.ndarray:
    image = decoded(picture.data, picture.path, REMEDY)
    return image if image.ndim == 2 else image[..., 2::-1]
