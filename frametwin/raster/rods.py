"""The splatter of blurred rods: pictures of struts, their gradients, and Gauss-Newton terms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from frametwin.compiled.kept_loops import KeptLoops
from frametwin.geometry import bezier
from frametwin.raster.pyramid import Level

rod_kernels = KeptLoops("frametwin.raster.rod_kernels")

DARK = 1e-6
"""Least transmittance, as of the loops."""


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
    joint_size : (V,) radius of each joint's material relative to its thickest strut's; ``None`` for 1.
    """

    control_points: np.ndarray
    joints: np.ndarray
    edges: np.ndarray
    radius: np.ndarray
    opacity: np.ndarray
    joint_size: np.ndarray | None = None

    @property
    def pieces(self) -> int:
        """Straight pieces of a strut."""
        return self.radius.shape[1]

    def points(self) -> np.ndarray:
        """(E, P+1, 3) of the polylines."""
        flat = self.control_points.reshape(-1, 12) @ _flat_basis(self.pieces)
        return np.asarray(flat.reshape(-1, self.pieces + 1, 3))

    def joint_radius(self) -> np.ndarray:
        """(V,) mm: the joint's size times the largest radius of the pieces that end there; 0 where all are missing."""
        result = np.zeros(len(self.joints))
        for side, piece in ((0, 0), (1, -1)):
            there = np.where(self.opacity[:, piece] > 0.5, self.radius[:, piece], 0.0)
            np.maximum.at(result, self.edges[:, side], there)
        return result if self.joint_size is None else result * self.joint_size


@dataclass(frozen=True, eq=False)
class Terms:
    """Half the squared residual of all views, with its Gauss-Newton terms.

    Attributes
    ----------
    loss : half the sum of squared residuals.
    hessian, gradient : (E, 12, 12) and (E, 12) by each strut's control points, in pixels / mm^2 and / mm.
    joint_hessian, joint_gradient : (V, 3, 3) and (V, 3) of the joints' discs.
    widths : (E, P, 2) curvature and slope by the radius of each piece.
    joint_widths : (V, 2) curvature and slope by the radius of each joint's disc.
    """

    loss: float
    hessian: np.ndarray
    gradient: np.ndarray
    joint_hessian: np.ndarray
    joint_gradient: np.ndarray
    widths: np.ndarray
    joint_widths: np.ndarray


@dataclass(frozen=True, eq=False)
class ViewTerms:
    """The terms of every view by itself.

    Attributes
    ----------
    losses : (N,) half the sum of squared residuals of each view.
    hessian, gradient : (E, N, 12, 12) and (E, N, 12), as in `Terms`.
    joint_hessian, joint_gradient : (V, N, 3, 3) and (V, N, 3).
    widths, joint_widths : of all views together, as in `Terms`.
    """

    losses: np.ndarray
    hessian: np.ndarray
    gradient: np.ndarray
    joint_hessian: np.ndarray
    joint_gradient: np.ndarray
    widths: np.ndarray
    joint_widths: np.ndarray

    def summed(self) -> Terms:
        """The terms of all views together."""
        return Terms(
            float(self.losses.sum()),
            self.hessian.sum(axis=1),
            self.gradient.sum(axis=1),
            self.joint_hessian.sum(axis=1),
            self.joint_gradient.sum(axis=1),
            self.widths,
            self.joint_widths,
        )


FINE = 8
"""Pieces from which a polyline is to be where its curve is: with fewer, a strut is only looked for."""


@lru_cache(maxsize=64)
def basis(pieces: int) -> np.ndarray:
    """(P+1, 4) array that gives a polyline's points from the control points.

    From `FINE` pieces on it is the one that is nearest to the curve of all that have its ends, by least squares. With
    its corners on the curve it would lie on the inner side of every bend, and a fit would move the strut outwards to
    make up for it.
    """
    corners = np.linspace(0.0, 1.0, pieces + 1)
    result = bezier.bernstein(3, corners)
    if pieces < FINE:
        return result
    nodes, weights = np.polynomial.legendre.leggauss(4)  # exact for what is multiplied below
    u = (corners[:-1, None] + 0.5 * (nodes + 1.0) / pieces).ravel()
    hats = np.maximum(0.0, 1.0 - np.abs(pieces * u[:, None] - np.arange(pieces + 1)))
    weighted = np.tile(weights, pieces)[:, None] * hats[:, 1:-1]
    wanted = bezier.bernstein(3, u) - hats[:, [0, -1]] @ result[[0, -1]]
    result[1:-1] = np.linalg.solve(weighted.T @ hats[:, 1:-1], weighted.T @ wanted)
    return result


@lru_cache(maxsize=64)
def _flat_basis(pieces: int) -> np.ndarray:
    """(12, 3P+3) array by which a strut's coordinates, in a row, give those of its polyline: one product for all struts
    takes a fourth of the time of one for each."""
    return np.ascontiguousarray(np.kron(basis(pieces), np.eye(3)).T)


KEPT = 12_000_000
"""Most pixels of a level whose last drawing is kept: the stages of a fit ask for one and the same several times."""


MORTON = 5
"""Halvings of a frame's longest side that tell which struts are near each other."""


def _drawing(rods: Rods) -> tuple[np.ndarray, ...]:
    """All that a drawing depends on, as the kernels take it; the polylines follow from the first."""
    return (
        np.ascontiguousarray(rods.control_points, dtype=np.float64),
        np.ascontiguousarray(rods.radius, dtype=np.float64),
        np.ascontiguousarray(rods.opacity, dtype=np.float64),
        np.ascontiguousarray(rods.joints, dtype=np.float64),
        rods.joint_radius(),
    )


def _kept(level: Level, what: str, drawing: tuple[np.ndarray, ...]) -> np.ndarray | None:
    """What was made of the very same drawing the last time, if it was kept."""
    if what not in level.kept:
        return None
    before, result = level.kept[what]
    same = all(np.array_equal(a, b) for a, b in zip(before, drawing, strict=True))
    return result if same else None


def transmittance(rods: Rods, level: Level, keep: bool = True) -> np.ndarray:
    """Flat (pixels,) float32 share of the background that is seen through the rods; the picture is 1 minus it.

    It may be handed out again: it is not to be changed. What is drawn once alone need not be kept in place of the last.
    """
    drawing = _drawing(rods)
    found = _kept(level, "transmittance", drawing)
    if found is not None:
        return found
    result = sharp_transmittance(rods, level)
    level.defocus(result)
    if keep and result.size <= KEPT:
        level.kept["transmittance"] = (drawing, result)
    return result


def sharp_transmittance(rods: Rods, level: Level) -> np.ndarray:
    """The same before lenses that blur by more than a strut's edge have done so."""
    result = np.empty_like(level.target)
    _, radius, opacity, joints, joint_radius = _drawing(rods)
    rod_kernels.render(
        rods.points(),
        radius,
        opacity,
        joints,
        joint_radius,
        level.cameras,
        level.shapes,
        level.offsets,
        level.drawn_spreads,
        result,
    )
    if level.behind is not None:
        np.multiply(result, level.behind, out=result)
        np.maximum(result, np.float32(DARK), out=result)
    return result


def plain_evidence(rods: Rods, level: Level) -> np.ndarray:
    """(E, P, 2) as `opacity_terms`, of what is drawn and the level's own pictures."""
    drawing = _drawing(rods)
    found = _kept(level, "evidence", drawing)
    if found is not None:
        return found
    through = transmittance(rods, level)
    result = opacity_terms(rods, level, through, _compared(through, level)[0])
    level.kept["evidence"] = (drawing, result)
    return result


def squared_loss(rods: Rods, level: Level, keep: bool = True) -> float:
    """Half the sum of squared residuals over all views; see `transmittance`."""
    return float(_compared(transmittance(rods, level, keep), level)[1].sum())


def gauss_newton(rods: Rods, level: Level) -> Terms:
    """Loss, gradient and the Gauss-Newton approximation of its Hessian."""
    through = transmittance(rods, level)
    residual, losses = _compared(through, level)
    return Terms(float(losses.sum()), *pull_back(rods, level, through, residual))


def gauss_newton_by_view(rods: Rods, level: Level) -> ViewTerms:
    """As `gauss_newton`, of every view by itself."""
    through = transmittance(rods, level)
    residual, losses = _compared(through, level)
    return ViewTerms(losses, *_gather(rods, level, through, residual, len(level.cameras)))


def _compared(through: np.ndarray, level: Level) -> tuple[np.ndarray, np.ndarray]:
    """Residual (pixels,) of what is drawn against the level's own pictures, and half its square for each view (N,)."""
    residual, losses = np.empty_like(level.target), np.empty(len(level.shapes))
    rod_kernels.compare(through, level.target, level.shapes, level.offsets, residual, losses)
    return residual, losses


def pull_back(rods: Rods, level: Level, through: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, ...]:
    """Derivatives of a loss whose derivative by the picture is ``residual`` (pixels,): the fields of `Terms`."""
    hessian, gradient, joint_hessian, joint_gradient, *widths = _gather(rods, level, through, residual, 1)
    return hessian[:, 0], gradient[:, 0], joint_hessian[:, 0], joint_gradient[:, 0], *widths


def _gather(rods: Rods, level: Level, through: np.ndarray, residual: np.ndarray, slots: int) -> tuple[np.ndarray, ...]:
    """Derivatives in so many slots: one for all views together, or one for each."""
    points = rods.points()
    count, pieces = rods.radius.shape
    hessian, gradient = np.empty((count, slots, 12, 12)), np.empty((count, slots, 12))
    widths, joint_widths = np.empty((count, pieces, 2)), np.empty((len(rods.joints), 2))
    joint_hessian = np.empty((len(rods.joints), slots, 3, 3))
    joint_gradient = np.empty((len(rods.joints), slots, 3))
    view = (level.cameras, level.shapes, level.offsets, level.spreads, through, residual)
    radius = np.ascontiguousarray(rods.radius, dtype=np.float64)
    opacity = np.ascontiguousarray(rods.opacity, dtype=np.float64)
    order = _order(rods, level)
    rod_kernels.gather_struts(points, radius, opacity, *view, order, basis(pieces), hessian, gradient, widths)
    joints = np.ascontiguousarray(rods.joints, dtype=np.float64)
    rod_kernels.gather_joints(joints, rods.joint_radius(), *view, joint_hessian, joint_gradient, joint_widths)
    return hessian, gradient, joint_hessian, joint_gradient, widths, joint_widths


def _order(rods: Rods, level: Level) -> np.ndarray:
    """(E,) array of int: an order of struts as by `_neighbours_together`; it changes little from step to step."""
    _, order = level.kept.get("order", ((), np.zeros(0, dtype=np.int64)))
    if len(order) != len(rods.edges):
        order = _neighbours_together(rods.control_points)
        level.kept["order"] = ((), order)
    return order


def _neighbours_together(control_points: np.ndarray) -> np.ndarray:
    """(E,) array of int: struts so that those which follow each other are near each other, along a Morton curve."""
    if not len(control_points):
        return np.zeros(0, dtype=np.int64)
    middle = control_points.mean(axis=1)
    low = middle.min(axis=0)
    cells = 2**MORTON / max(float((middle.max(axis=0) - low).max()), 1e-12)
    cell = np.minimum((cells * (middle - low)).astype(np.int64), 2**MORTON - 1)
    bits = (cell[:, None, :] >> np.arange(MORTON)[:, None]) & 1
    code = (bits << (3 * np.arange(MORTON)[:, None] + np.arange(3))).sum(axis=(1, 2))
    return np.argsort(code, kind="stable")


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
        level.spreads,
        through,
        residual,
        _order(rods, level),
        evidence,
    )
    return evidence
