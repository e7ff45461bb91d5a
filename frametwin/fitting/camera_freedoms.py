"""Cameras that may be a little elsewhere than the rig says.

A small motion of a camera is, in its own view, the same as a motion of everything it sees: turned back, shifted back,
and for the focal length, the principal point and the lens spread across the picture. So the Gauss-Newton terms that
the splatter gives for every strut in every view already hold the cameras' own terms and how they are coupled to the
struts; nothing else has to be drawn.

What a camera can do, ten numbers: turns about its own three axes (radians), shifts of its centre along the world's
(mm), the logarithm of its focal length, its principal point (pixels of the full picture), and the lens's k1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from frametwin.cameras import Camera
from frametwin.compiled.kept_loops import KeptLoops
from frametwin.fitting.elastic import ElasticFrame
from frametwin.geometry.rotations import rotation_matrices
from frametwin.ranges import check_settings, within
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods, ViewTerms

camera_kernels = KeptLoops("frametwin.fitting.camera_kernels")

TURN, SHIFT, FOCAL, CENTRE, LENS = slice(0, 3), slice(3, 6), 6, slice(7, 9), 9
FREEDOMS = 10

NOISE = 0.15
"""Standard deviation of a pixel on an edge, which also stands for what the model leaves out."""

ALIKE = 50.0
"""Pixels along a strut's outline that share its error where light and shading have drawn it: so many of them tell no
more than one."""


def pixel_noise(outline_error: float) -> float:
    """Standard deviation of a pixel on an edge, of outlines that are wrong by ``outline_error`` pixels alike."""
    return float(np.hypot(NOISE, outline_error * np.sqrt(ALIKE)))


@dataclass(frozen=True)
class RigErrors:
    """Standard deviations of what a rig says of its cameras, each camera by itself.

    Attributes
    ----------
    turn : degrees, about each axis.
    shift : mm, along each axis.
    focal : share of the focal length.
    centre : pixels of the principal point.
    lens : of the distortion's k1.
    """

    turn: Annotated[float, within(1e-6, 90.0)] = 0.3
    shift: Annotated[float, within(1e-6, 1e4)] = 2.0
    focal: Annotated[float, within(1e-9, 1.0)] = 0.005
    centre: Annotated[float, within(1e-6, 1e4)] = 2.0
    lens: Annotated[float, within(1e-9, 10.0)] = 0.01

    def __post_init__(self) -> None:
        check_settings(self, "rig errors")

    def deviations(self) -> np.ndarray:
        """(10,) one a freedom, in its own unit."""
        return np.array([*3 * [np.deg2rad(self.turn)], *3 * [self.shift], self.focal, *2 * [self.centre], self.lens])


def rig_covariances(cameras: Sequence[Camera], errors: RigErrors) -> np.ndarray:
    """Covariances (N, 10, 10) of cameras: their own, or where a camera has none, ``errors``."""
    usual = np.diag(errors.deviations() ** 2)
    return np.array([usual if camera.covariance is None else camera.covariance for camera in cameras])


def deviations_of(covariances: np.ndarray) -> np.ndarray:
    """Standard deviations (N, 10) of each freedom, whatever the others are."""
    return np.asarray(np.sqrt(np.diagonal(covariances, axis1=-2, axis2=-1)))


def whitening(covariances: np.ndarray) -> np.ndarray:
    """Matrices (N, 10, 10) that make corrections of cameras independent and one standard deviation long."""
    scale = deviations_of(covariances)
    even = covariances / (scale[:, :, None] * scale[:, None, :])  # the units differ by many orders of magnitude
    return np.asarray(np.linalg.inv(np.linalg.cholesky(even)) / scale[:, None, :])


@dataclass(frozen=True, eq=False)
class CameraPrior:
    """What is known of the cameras before any picture is looked at.

    Attributes
    ----------
    weight : (N, 10, 10) weights of the cameras' freedoms in the loss.
    """

    weight: np.ndarray

    @classmethod
    def of(cls, covariances: np.ndarray, noise: float = NOISE) -> CameraPrior:
        """From covariances (N, 10, 10); the loss is the squared residual, so its noise is that of a pixel."""
        white = whitening(covariances)
        return cls(noise**2 * np.matmul(white.transpose(0, 2, 1), white))

    def pull(self, freedoms: np.ndarray) -> np.ndarray:
        """(N, 10) gradient of its part of the loss at the cameras' freedoms (N, 10)."""
        return np.asarray(np.matmul(self.weight, freedoms[:, :, None])[:, :, 0])

    def loss(self, freedoms: np.ndarray) -> float:
        """Its part of the loss."""
        return 0.5 * float((freedoms * self.pull(freedoms)).sum())


def corrected(cameras: Sequence[Camera], freedoms: np.ndarray) -> list[Camera]:
    """The cameras after their freedoms (N, 10), but for the lens, which a pinhole camera has none of."""
    result = []
    for camera, own in zip(cameras, freedoms, strict=True):
        pose = np.array(camera.camera_to_world)
        pose[:3, :3] = pose[:3, :3] @ rotation_matrices(own[TURN]).T
        pose[:3, 3] += own[SHIFT]
        factor = float(np.exp(own[FOCAL]))
        result.append(
            Camera(
                camera.name,
                camera.width,
                camera.height,
                camera.fl_x * factor,
                camera.fl_y * factor,
                camera.cx + own[7],
                camera.cy + own[8],
                pose,
            )
        )
    return result


def view_motions(points: np.ndarray, packed: np.ndarray, scale: float) -> np.ndarray:
    """How points must move to look as they do when a camera changes.

    Parameters
    ----------
    points : (..., 3) mm, in the world.
    packed : (17,) the camera as the splatter has it, at the pictures' size.
    scale : pixels of that size to one of the full picture.

    Returns
    -------
    (..., 3, 10) mm for a unit of each freedom.
    """
    result = np.empty((1, points.size // 3, 3, FREEDOMS))
    flat = np.ascontiguousarray(points.reshape(-1, 3), dtype=np.float64)
    one = (np.array([packed], dtype=np.float64), np.array([scale], dtype=np.float64))
    camera_kernels.motions(flat, *one, result)
    return result.reshape(*points.shape, FREEDOMS)


@dataclass(frozen=True, eq=False)
class CameraTerms:
    """The cameras' part of the Gauss-Newton system.

    Attributes
    ----------
    matrix, gradient : (N, 10, 10) and (N, 10) of each camera by itself.
    struts : (E, 12, N, 10) coupling to the struts' control points.
    joints : (V, 3, N, 10) coupling to the joints' discs.
    """

    matrix: np.ndarray
    gradient: np.ndarray
    struts: np.ndarray
    joints: np.ndarray


def camera_terms(drawn: Rods, terms: ViewTerms, packed: np.ndarray, scales: np.ndarray) -> CameraTerms:
    """Terms of all cameras from those of every strut and joint in every view.

    Parameters
    ----------
    drawn : what the splatter drew.
    terms : its terms, view by view.
    packed : (N, 17) the cameras of the level.
    scales : (N,) pixels of the level to one of the full picture.
    """
    count, views = terms.hessian.shape[:2]
    vertices = len(drawn.joints)
    matrix, gradient = np.empty((views, FREEDOMS, FREEDOMS)), np.empty((views, FREEDOMS))
    struts, joints = np.empty((count, 12, views, FREEDOMS)), np.empty((vertices, 3, views, FREEDOMS))
    camera_kernels.camera_terms(
        np.ascontiguousarray(drawn.control_points, dtype=np.float64),
        np.ascontiguousarray(drawn.joints, dtype=np.float64),
        terms.hessian,
        terms.gradient,
        terms.joint_hessian,
        terms.joint_gradient,
        np.ascontiguousarray(packed, dtype=np.float64),
        np.ascontiguousarray(scales, dtype=np.float64),
        matrix,
        gradient,
        struts,
        joints,
    )
    return CameraTerms(matrix, gradient, struts, joints)


def coupling_to_freedoms(elastic: ElasticFrame, terms: CameraTerms) -> np.ndarray:
    """(6V, 10N) coupling of the cameras to the joints' freedoms, struts following."""
    size = terms.matrix.shape[0] * FREEDOMS
    parts = np.matmul(elastic.follow.transpose(0, 2, 1), terms.struts.reshape(len(terms.struts), 12, size))
    return joined_rows(elastic, parts, terms)


def joined_rows(elastic: ElasticFrame, parts: np.ndarray, terms: CameraTerms) -> np.ndarray:
    """(6V, 10N) sum of struts' coupling (E, 12, 10N) to the freedoms of their ends, and of the joints' own."""
    total = np.zeros((6 * elastic.vertex_count, parts.shape[2]))
    camera_kernels.add_rows(elastic.freedoms, parts, total)
    total.reshape(elastic.vertex_count, 6, -1)[:, :3] += terms.joints.reshape(elastic.vertex_count, 3, -1)
    return total


def moved_cameras(packed: np.ndarray, freedoms: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """(N, 17) packed cameras of a level after their freedoms (N, 10); scales (N,) as in `camera_terms`."""
    result = packed.copy()
    turned = rotation_matrices(freedoms[:, TURN]) @ packed[:, :9].reshape(-1, 3, 3)
    centre = -np.einsum("vca,vc->va", packed[:, :9].reshape(-1, 3, 3), packed[:, 9:12]) + freedoms[:, SHIFT]
    result[:, :9] = turned.reshape(-1, 9)
    result[:, 9:12] = -np.einsum("vca,va->vc", turned, centre)
    result[:, 12:14] *= np.exp(freedoms[:, FOCAL])[:, None]
    result[:, 14:16] += freedoms[:, CENTRE] * scales[:, None]
    result[:, 16] += freedoms[:, LENS]
    return result


def with_cameras(level: Level, freedoms: np.ndarray, scales: np.ndarray) -> Level:
    """The level seen by cameras after their freedoms."""
    return replace(level, cameras=moved_cameras(level.cameras, freedoms, scales))
