"""A sample as arrays: what the tensors of `frametwin.dataset.tensors` and the exports for learning are made of."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import numpy as np

from frametwin.cameras.camera import FISHEYE, Camera
from frametwin.capture.capture import Capture, View
from frametwin.capture.picture import Picture
from frametwin.dataset.camera_errors import TRUE_FILE, with_true_cameras
from frametwin.dataset.folder import Sample, files_below
from frametwin.dataset.strut_map import covered_share
from frametwin.dataset.tensor_kinds import KINDS, PARTS, POSES
from frametwin.dataset.true_curves import check_belongs, intervals_of
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.exr import Passes, read_passes
from frametwin.imaging.masks import decode, mask_itself
from frametwin.simulation.curve_truth import FILE_NAME as CURVES_FILE
from frametwin.simulation.curve_truth import REMEDY, CurveTruth, read_curves

Arrays = dict[str, np.ndarray]


def parts_of(sample: Sample) -> tuple[str, ...]:
    """The `PARTS` that a sample has, by the names of its files."""
    names = files_below(sample.folder)
    there = {
        "backgrounds": any(name.startswith("background/") for name in names),
        "true_cameras": TRUE_FILE in names,
        "visibility": CURVES_FILE in names,
        "passes": any(name.startswith("passes/") for name in names),
    }
    return tuple(part for part in PARTS if there.get(part, True))


def sample_arrays(capture: Capture, parts: Collection[str] = PARTS, scale: float = 1.0) -> Arrays:
    """The arrays of a sample; see `frametwin.dataset.tensor_kinds.KINDS` for shapes, types and units.

    Parameters
    ----------
    capture
        The sample, which has a truth.
    parts
        Some of `PARTS`.
    scale
        Length in the arrays of one mm.

    Raises
    ------
    InputError
        If a part is not there, a file is damaged, or the pictures are not all of one size.
    """
    reader = _Reader(capture)
    makers: dict[str, Callable[[], Arrays]] = {
        "images": lambda: {"images": _stacked([reader.image(view) for view in capture.views], capture)},
        "backgrounds": lambda: {"backgrounds": _stacked(_backgrounds(capture), capture)},
        "masks": lambda: {"masks": np.stack(_one_size(reader.masks(), capture))},
        "cameras": lambda: _camera_arrays([view.camera for view in capture.views]),
        "true_cameras": lambda: {f"true_{name}": array for name, array in _camera_arrays(reader.true_cameras).items()},
        "curves": lambda: _curve_arrays(reader),
        "visibility": lambda: _visibility_arrays(reader),
        "passes": lambda: _pass_arrays(reader),
    }
    arrays: Arrays = {}
    for part in PARTS:
        if part in parts:
            arrays |= makers[part]()
    return {name: _finished(name, array, scale) for name, array in arrays.items()}


def _finished(name: str, array: np.ndarray, scale: float) -> np.ndarray:
    """An array in its unit and of its type."""
    if KINDS[name].unit == "mm" and scale != 1.0:
        array = np.array(array, dtype=np.float64)
        array[(..., slice(3), 3) if name in POSES else ...] *= scale
    return np.require(array, KINDS[name].dtype, ["C", "W"])


class _Reader:
    """Reads each file of a sample once, when it is first needed."""

    def __init__(self, capture: Capture) -> None:
        self.capture = capture
        self._images: dict[Path, np.ndarray] = {}
        self._passes: list[Passes] | None = None
        self._noted: CurveTruth | None = None
        self.true_cameras = [view.camera for view in with_true_cameras(capture).views]

    @property
    def truth(self) -> Wireframe:
        if self.capture.truth is None:
            raise InputError.at(self.capture.root, "truth.json", "is missing", REMEDY)
        return self.capture.truth

    @property
    def present(self) -> np.ndarray:
        """(E, 2) interval at which each strut is there."""
        return intervals_of(self.capture.root, self.capture.frame.printed)

    def noted(self) -> CurveTruth:
        """The content of ``curves.npz``."""
        if self._noted is None:
            path = self.capture.root / CURVES_FILE
            self._noted = read_curves(path)
            check_belongs(self._noted, self.capture, self.truth, path)
        return self._noted

    def image(self, view: View) -> np.ndarray:
        """The picture of a view, (H, W) or (H, W, 3) as OpenCV has it."""
        if view.image.path not in self._images:
            self._images[view.image.path] = decode(view.image, view.camera)
        return self._images[view.image.path]

    def passes(self) -> list[Passes]:
        """Those of all views."""
        if self._passes is None:
            folder = self.capture.root / "passes"
            self._passes = [read_passes(folder / f"{view.image.path.stem}.exr") for view in self.capture.views]
            for view, passes in zip(self.capture.views, self._passes, strict=True):
                size = (view.camera.height, view.camera.width)
                if passes.depth.shape != size:
                    name = f"{view.image.path.stem}.exr"
                    raise InputError.at(folder / name, "size", f"is not {size[1]} x {size[0]} as the picture", REMEDY)
        return self._passes

    def masks(self) -> list[np.ndarray]:
        """(H, W) share of every pixel that the print covers, as the lens sees it."""
        return [self._mask(i, view) for i, view in enumerate(self.capture.views)]

    def _mask(self, i: int, view: View) -> np.ndarray:
        itself = mask_itself(self.image(view)) if view.background is None else None
        if itself is not None:
            return itself
        if (self.capture.root / "passes").is_dir():
            return (self.passes()[i].strut >= 0).astype(np.float32)
        noted = self.noted()
        return covered_share(noted.points, noted.radius, noted.present, self.true_cameras[i])


def _backgrounds(capture: Capture) -> list[np.ndarray]:
    pictures: list[Picture] = [view.background for view in capture.views if view.background is not None]
    if len(pictures) < len(capture.views):
        raise InputError.at(capture.root / "background", "folder", "does not exist", "leave backgrounds out of parts")
    return [decode(picture, view.camera) for picture, view in zip(pictures, capture.views, strict=True)]


def _one_size(images: list[np.ndarray], capture: Capture) -> list[np.ndarray]:
    if len({image.shape for image in images}) > 1:
        remedy = "give all views one size, and colour to all or none"
        raise InputError.at(capture.root, "images", "are not all of one size and kind", remedy)
    return images


def _stacked(images: list[np.ndarray], capture: Capture) -> np.ndarray:
    """(N, C, H, W), red, green, blue, of pictures as OpenCV has them."""
    stack = np.stack(_one_size(images, capture))
    return stack[:, None] if stack.ndim == 3 else stack[..., ::-1].transpose(0, 3, 1, 2)


def _camera_arrays(cameras: Sequence[Camera]) -> Arrays:
    distortion = np.zeros((len(cameras), 5))
    for row, camera in zip(distortion, cameras, strict=True):
        row[: len(camera.distortion)] = camera.distortion
    return {
        "K": np.stack([camera.K for camera in cameras]),
        "distortion": distortion,
        "fisheye": np.array([camera.model == FISHEYE for camera in cameras]),
        "camera_to_world": np.stack([camera.camera_to_world for camera in cameras]),
        "world_to_camera": np.stack([camera.world_to_camera for camera in cameras]),
    }


def _curve_arrays(reader: _Reader) -> Arrays:
    frame, truth, noted = reader.capture.frame, reader.truth, reader.noted()
    return {
        "edges": frame.edges,
        "printed": frame.printed,
        "radius": frame.radius,
        "vertices": frame.vertices,
        "control_points": frame.control_points,
        "truth_vertices": truth.vertices,
        "truth_control_points": truth.control_points,
        "present": reader.present,
        "points": noted.points,
        "tangents": noted.tangents,
        "point_radius": noted.radius,
        "point_present": noted.present,
    }


def _visibility_arrays(reader: _Reader) -> Arrays:
    noted = reader.noted()
    return {
        "pixels": noted.pixels,
        "pixel_tangents": noted.pixel_tangents,
        "pixel_depth": noted.depth,
        "visible": noted.visible,
    }


def _pass_arrays(reader: _Reader) -> Arrays:
    passes = reader.passes()
    for name in ("depth", "strut"):
        _one_size([getattr(item, name) for item in passes], reader.capture)
    return {
        "depth": np.stack([item.depth for item in passes]),
        "normal": np.stack([item.normal for item in passes]).transpose(0, 3, 1, 2),
        "strut": np.stack([item.strut for item in passes]),
    }
