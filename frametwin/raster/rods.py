"""The splatter of blurred rods: pictures of struts, their gradients, and Gauss-Newton terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.geometry import bezier
from frametwin.raster import rod_kernels
from frametwin.raster.pyramid import Level


@dataclass(eq=False)
class Rods:
    """Struts as the splatter sees them.

    Attributes
    ----------
    control_points : (E, 4, 3) in mm.
    joints : (V, 3) in mm, where struts meet.
    edges : (E, 2) the joints of each strut.
    radius : (E, P) in mm, one value for each of P pieces of equal parameter length.
    opacity : (E, P) 0..1.
    """

    control_points: np.ndarray
    joints: np.ndarray
    edges: np.ndarray
    radius: np.ndarray
    opacity: np.ndarray

    @property
    def pieces(self) -> int:
        """Straight pieces of a strut."""
        return self.radius.shape[1]

    def points(self) -> np.ndarray:
        """(E, P+1, 3) of the polylines."""
        return np.matmul(basis(self.pieces), self.control_points)

    def joint_radius(self) -> np.ndarray:
        """(V,) the largest radius of the pieces that end at each joint; 0 where all are missing."""
        ends = np.where(self.opacity[:, [0, -1]] > 0.5, self.radius[:, [0, -1]], 0.0)
        result = np.zeros(len(self.joints))
        np.maximum.at(result, self.edges, ends)
        return result


@dataclass(frozen=True, eq=False)
class Terms:
    """Half the squared residual of all views, with its Gauss-Newton terms.

    Attributes
    ----------
    loss : half the sum of squared residuals.
    hessian, gradient : (E, 12, 12) and (E, 12) by each strut's control points, in pixels / mm^2 and / mm.
    joint_hessian, joint_gradient : (V, 3, 3) and (V, 3) of the joints' discs.
    widths : (E, P, 2) curvature and slope by the radius of each piece.
    """

    loss: float
    hessian: np.ndarray
    gradient: np.ndarray
    joint_hessian: np.ndarray
    joint_gradient: np.ndarray
    widths: np.ndarray


def basis(pieces: int) -> np.ndarray:
    """(P+1, 4) Bernstein values that give a polyline's points from the control points."""
    return bezier.bernstein(3, np.linspace(0.0, 1.0, pieces + 1))


def transmittance(rods: Rods, level: Level) -> np.ndarray:
    """Flat (pixels,) float32 share of the background that is seen through the rods; the picture is 1 minus it."""
    result = np.empty_like(level.target)
    rod_kernels.render(
        rods.points(),
        np.ascontiguousarray(rods.radius, dtype=np.float64),
        np.ascontiguousarray(rods.opacity, dtype=np.float64),
        np.ascontiguousarray(rods.joints, dtype=np.float64),
        rods.joint_radius(),
        level.cameras,
        level.shapes,
        level.offsets,
        level.spread,
        result,
    )
    return result


def gauss_newton(rods: Rods, level: Level) -> Terms:
    """Loss, gradient and the Gauss-Newton approximation of its Hessian."""
    through = transmittance(rods, level)
    residual = np.float32(1.0) - through - level.target
    return Terms(0.5 * float(np.dot(residual, residual)), *pull_back(rods, level, through, residual))


def pull_back(rods: Rods, level: Level, through: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, ...]:
    """Derivatives of a loss whose derivative by the picture is ``residual`` (pixels,): the fields of `Terms`."""
    points = rods.points()
    count, pieces = rods.radius.shape
    hessian, gradient = np.empty((count, 12, 12)), np.empty((count, 12))
    widths = np.empty((count, pieces, 2))
    joint_hessian, joint_gradient = np.empty((len(rods.joints), 3, 3)), np.empty((len(rods.joints), 3))
    view = (level.cameras, level.shapes, level.offsets, level.spread, through, residual)
    radius = np.ascontiguousarray(rods.radius, dtype=np.float64)
    opacity = np.ascontiguousarray(rods.opacity, dtype=np.float64)
    rod_kernels.gather_struts(points, radius, opacity, *view, basis(pieces), hessian, gradient, widths)
    joints = np.ascontiguousarray(rods.joints, dtype=np.float64)
    rod_kernels.gather_joints(joints, rods.joint_radius(), *view, joint_hessian, joint_gradient)
    return hessian, gradient, joint_hessian, joint_gradient, widths


def opacity_terms(rods: Rods, level: Level, through: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """(E, P, 2) curvature and slope of the loss by each piece's opacity; see `rod_kernels.gather_opacity`."""
    evidence = np.empty((*rods.radius.shape, 2))
    rod_kernels.gather_opacity(
        rods.points(),
        np.ascontiguousarray(rods.radius, dtype=np.float64),
        np.ascontiguousarray(rods.opacity, dtype=np.float64),
        level.cameras,
        level.shapes,
        level.offsets,
        level.spread,
        through,
        residual,
        evidence,
    )
    return evidence
