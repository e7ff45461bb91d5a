"""The pinhole camera with OpenCV distortion, and the few operations that need nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.arrays import checked_array
from frametwin.cameras import distortion as perspective_lens
from frametwin.cameras import fisheye as fisheye_lens
from frametwin.errors import InputError

Floats = NDArray[np.float64]

MAX_PIXELS = 32768  # longest side; larger values are broken files, not cameras
RIGID_TOLERANCE = 1e-4  # a rotation written with five digits still passes
FOCAL_RANGE = (1e-3, 1e7)  # pixels; what is beyond is no lens

PERSPECTIVE, FISHEYE = "OPENCV", "OPENCV_FISHEYE"
DISTORTION_KEYS: dict[str, tuple[str, ...]] = {
    PERSPECTIVE: ("k1", "k2", "p1", "p2", "k3"),
    FISHEYE: ("k1", "k2", "k3", "k4"),
}
"""Coefficients of each lens model, in the order in which they stand in arrays."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera.

    Attributes
    ----------
    name
        The camera's name, or its picture's file name.
    width, height
        Picture size in pixels.
    fl_x, fl_y
        Focal lengths in pixels.
    cx, cy
        Principal point in pixels; the middle of the picture is ``(width / 2, height / 2)``.
    camera_to_world
        (4, 4) rigid pose in mm, OpenCV axes (x right, y down, z forward).
    distortion
        OpenCV's coefficients: (5,) k1, k2, p1, p2, k3, zeros for none; of a fisheye (4,) k1, k2, k3, k4.
    model
        ``OPENCV`` (perspective) or ``OPENCV_FISHEYE``.
    covariance
        How well the camera is known: covariance (10, 10) of its turns about its own axes (radians), its centre in the
        world (mm), the logarithm of its focal length, its principal point (px) and k1; ``None`` where nobody says. A
        turn is positive where the picture's content turns so: that of the camera itself has the other sign.
    source
        Where the values come from, such as a file and a field; only named in error messages, not kept.

    Raises
    ------
    InputError
        For sizes or focal lengths that are not positive or not those of a camera, values that are not finite, a pose
        that is not rigid, or an unknown model.
    """

    name: str
    width: int
    height: int
    fl_x: float
    fl_y: float
    cx: float
    cy: float
    camera_to_world: Floats
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    model: str = PERSPECTIVE
    covariance: Floats | None = None
    source: InitVar[str | None] = None

    def __post_init__(self, source: str | None) -> None:
        where = source or f"camera {self.name}"
        for key in ("width", "height", "fl_x", "fl_y", "cx", "cy"):
            value = float(checked_array(getattr(self, key), "f", (), where, key))
            object.__setattr__(self, key, value)
            if key in ("fl_x", "fl_y") and value <= 0.0:
                raise InputError.at(where, key, "is not positive", "give the focal length in pixels, above 0")
            if key in ("fl_x", "fl_y") and not FOCAL_RANGE[0] <= value <= FOCAL_RANGE[1]:
                raise InputError.at(where, key, f"{value:g} is not a focal length", "give it in pixels")
        for key in ("width", "height"):
            value = getattr(self, key)
            if value != int(value) or not 1 <= value <= MAX_PIXELS:
                problem = f"{value:g} is not a whole number from 1 to {MAX_PIXELS}"
                raise InputError.at(where, key, problem, "give the picture size in pixels")
            object.__setattr__(self, key, int(value))
        pose = checked_array(self.camera_to_world, "f", (4, 4), where, "camera_to_world")
        _check_rigid(where, pose)
        if self.model not in DISTORTION_KEYS:
            remedy = f"use one of {', '.join(DISTORTION_KEYS)}"
            raise InputError.at(where, "model", f"{self.model!r} is not known", remedy)
        count = len(DISTORTION_KEYS[self.model])
        coefficients = checked_array(self.distortion, "f", (count,), where, "distortion")
        arrays = {"camera_to_world": pose, "distortion": coefficients}
        if self.covariance is not None:
            arrays["covariance"] = checked_array(self.covariance, "f", (10, 10), where, "covariance")
        for key, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, key, array)

    @property
    def K(self) -> Floats:
        """(3, 3) intrinsics, pixel centres at +0.5."""
        return np.array([[self.fl_x, 0.0, self.cx], [0.0, self.fl_y, self.cy], [0.0, 0.0, 1.0]])

    @property
    def K_opencv(self) -> Floats:
        """(3, 3) intrinsics for OpenCV's picture functions, whose pixel centres are whole numbers."""
        return self.K - np.array([[0.0, 0.0, 0.5], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])

    @cached_property
    def world_to_camera(self) -> Floats:
        """(4, 4) rigid motion from the world to the camera, the inverse of ``camera_to_world``."""
        rotation = self.camera_to_world[:3, :3].T
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        matrix[:3, 3] = -rotation @ self.camera_to_world[:3, 3]
        matrix.setflags(write=False)
        return matrix

    @property
    def deviations(self) -> Floats | None:
        """(10,) standard deviations of what `covariance` has, each whatever the others are."""
        return None if self.covariance is None else np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def centre(self) -> Floats:
        """(3,) position in the world, mm."""
        return self.camera_to_world[:3, 3]

    @property
    def forward(self) -> Floats:
        """(3,) unit viewing direction in the world."""
        return self.camera_to_world[:3, 2]

    @property
    def has_distortion(self) -> bool:
        """Whether pictures differ from a pinhole camera's: a coefficient is not zero, or the lens is a fisheye."""
        return self.model != PERSPECTIVE or bool(np.any(self.distortion != 0.0))

    def distort(self, plane: ArrayLike) -> Floats:
        """Points (..., 2) on the plane at depth 1, as the lens shifts them."""
        return (fisheye_lens if self.model == FISHEYE else perspective_lens).distort(plane, self.distortion)

    def undistort(self, plane: ArrayLike) -> Floats:
        """The inverse of `distort`; NaN where there is none."""
        return (fisheye_lens if self.model == FISHEYE else perspective_lens).undistort(plane, self.distortion)

    def project(self, points: ArrayLike, distort: bool = True) -> tuple[Floats, Floats]:
        """Pixels of world points.

        Parameters
        ----------
        points
            (..., 3) mm.
        distort
            Whether the lens distortion is applied; ``False`` is the view of ``without_distortion()``.

        Returns
        -------
        pixels
            (..., 2) x (column) and y (row), pixel centres at +0.5; NaN for points not in front of the
            camera.
        depth
            (...) distance along the viewing direction in mm, negative behind the camera.
        """
        points = np.asarray(points, dtype=np.float64)
        local = points @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        depth = local[..., 2]
        ahead = np.where(depth > 0.0, depth, np.nan)
        plane = local[..., :2] / ahead[..., None]
        if distort and self.has_distortion:
            plane = self.distort(plane)
        return plane * (self.fl_x, self.fl_y) + (self.cx, self.cy), depth

    def unproject(self, pixels: ArrayLike, depth: ArrayLike) -> Floats:
        """World points of pixels at a depth along the viewing direction; the inverse of ``project``.

        Parameters
        ----------
        pixels
            (..., 2), distorted where the camera distorts.
        depth
            (...) mm, broadcast against the pixels.

        Returns
        -------
        (..., 3) mm; NaN where the distortion has no inverse (far outside of the picture).
        """
        plane = (np.asarray(pixels, dtype=np.float64) - (self.cx, self.cy)) / (self.fl_x, self.fl_y)
        if self.has_distortion:
            plane = self.undistort(plane)
        depth = np.asarray(depth, dtype=np.float64)[..., None]
        local = np.concatenate(np.broadcast_arrays(plane[..., :1], plane[..., 1:], 1.0), axis=-1) * depth
        return local @ self.camera_to_world[:3, :3].T + self.camera_to_world[:3, 3]

    def resized(self, width: int, height: int) -> Camera:
        """The camera of the same picture resampled to another size."""
        sx, sy = width / self.width, height / self.height
        scales = np.array([*7 * [1.0], sx, sy, 1.0])
        return replace(
            self,
            width=width,
            height=height,
            fl_x=self.fl_x * sx,
            fl_y=self.fl_y * sy,
            cx=self.cx * sx,
            cy=self.cy * sy,
            covariance=None if self.covariance is None else self.covariance * np.outer(scales, scales),
        )

    def without_distortion(self) -> Camera:
        """The pinhole camera with the same intrinsics, whose pictures are the undistorted ones."""
        return replace(self, distortion=np.zeros(5), model=PERSPECTIVE) if self.has_distortion else self


def look_at(centre: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Floats:
    """Pose of a camera that looks from one point at another.

    Parameters
    ----------
    centre, target
        (3,) mm.
    up
        (3,) direction that shall point upwards in the picture. Where it is parallel to the view (a camera
        straight above), world y takes its place, and world x if that is parallel as well.

    Returns
    -------
    (4, 4) camera to world, OpenCV axes.

    Raises
    ------
    ValueError
        If centre and target coincide.
    """
    centre, target = np.asarray(centre, dtype=np.float64), np.asarray(target, dtype=np.float64)
    forward = target - centre
    distance = np.linalg.norm(forward)
    if not distance > 0.0:
        raise ValueError("a camera cannot look at its own centre")
    forward /= distance
    for candidate in (np.asarray(up, dtype=np.float64), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])):
        right = np.cross(forward, candidate)
        length = np.linalg.norm(right)
        if length > 1e-6 * np.linalg.norm(candidate):
            break
    right /= length
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = centre
    return pose


def packed(cameras: Iterable[Camera]) -> Floats:
    """Pinhole parameters of several cameras in one array, for compiled kernels. Distortion is left out.

    Returns
    -------
    (N, 16) rows: rotation world to camera, row by row (9), translation in mm (3), fl_x, fl_y, cx, cy.
    """
    rows = [
        np.concatenate([c.world_to_camera[:3, :3].ravel(), c.world_to_camera[:3, 3], [c.fl_x, c.fl_y, c.cx, c.cy]])
        for c in cameras
    ]
    return np.array(rows, dtype=np.float64).reshape(len(rows), 16)


def _check_rigid(where: str, pose: Floats) -> None:
    key, rotation = "camera_to_world", pose[:3, :3]
    if np.abs(pose[3] - (0.0, 0.0, 0.0, 1.0)).max() > RIGID_TOLERANCE:
        raise InputError.at(where, key, "its last row is not 0 0 0 1", "give a rigid pose")
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > RIGID_TOLERANCE or np.linalg.det(rotation) < 0.0:
        raise InputError.at(
            where, key, "its 3 x 3 part is not a rotation", "give a pose without scale, shear and mirroring"
        )
