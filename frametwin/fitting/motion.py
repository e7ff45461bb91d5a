"""Gauss-Newton steps of the frame: smooth motions first, then every joint and strut."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from frametwin.compiled.kept_loops import KeptLoops
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.fast_settings import CoarseStage
from frametwin.mechanics.blocks import BlockMatrix
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods, Terms

step_kernels = KeptLoops("frametwin.fitting.step_kernels")

GROUND = 300.0
"""Stiffness by which a grounded joint sticks to the plate, relative to the median strut's sideways one: enough to
keep feet that no view shows, and nothing against feet that are seen."""

TOGETHER = 16
"""Pairs of joints that are solved for at a time."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the frame is.

    Attributes
    ----------
    joints : (V, 6) freedoms of the joints, from the plan.
    inner : (E, 6) of the struts' inner control points.
    radius : (E,) of the struts, mm.
    opacity : (E, K) 0..1 along them.
    """

    joints: np.ndarray
    inner: np.ndarray
    radius: np.ndarray
    opacity: np.ndarray

    def moved(self, joints: np.ndarray, inner: np.ndarray) -> Pose:
        """The pose after a step."""
        return replace(self, joints=self.joints + joints, inner=self.inner + inner)

    def straightened(self, struts: np.ndarray) -> Pose:
        """With some struts (E,) bent by their joints alone."""
        return replace(self, inner=np.where(struts[:, None], 0.0, self.inner))

    def evened(self, planned: np.ndarray, struts: np.ndarray) -> Pose:
        """With the radii of some struts (E,) off the planned ones (E,) by the factor of the typical other strut."""
        factor = np.median((self.radius / planned)[~struts]) if not struts.all() else 1.0
        return replace(self, radius=np.where(struts, factor * planned, self.radius))


def start_pose(elastic: ElasticFrame) -> Pose:
    """The plan itself."""
    count = len(elastic.edges)
    return Pose(np.zeros((elastic.vertex_count, 6)), np.zeros((count, 6)), elastic.frame.radius, np.ones((count, 1)))


def as_rods(elastic: ElasticFrame, pose: Pose, pieces: int) -> Rods:
    """What the splatter draws of a pose, each strut as ``pieces`` straight ones."""
    middle = (np.arange(pieces) + 0.5) / pieces
    kernel = (middle * pose.opacity.shape[1]).astype(int)
    return Rods(
        control_points=elastic.displaced(elastic.frame.control_points, pose.joints, pose.inner),
        joints=elastic.frame.vertices + pose.joints[:, :3],
        edges=elastic.edges,
        radius=np.repeat(pose.radius[:, None], pieces, axis=1),
        opacity=pose.opacity[:, kernel],
    )


def joint_system(elastic: ElasticFrame, terms: Terms) -> tuple[BlockMatrix, np.ndarray]:
    """Matrix (6V, 6V) and gradient (6V,) of the loss by the joints' freedoms, struts following."""
    blocks, gradient = np.empty(elastic.follow.shape), np.empty(terms.gradient.shape)
    step_kernels.by_ends(elastic.follow, terms.hessian, terms.gradient, blocks, gradient)
    return (
        elastic.assemble(blocks, terms.joint_hessian),
        elastic.assemble_vector(gradient, terms.joint_gradient),
    )


def smooth_descent(
    elastic: ElasticFrame, motions: np.ndarray, pose: Pose, level: Level, stage: CoarseStage, longest: float
) -> Iterator[tuple[Pose, float]]:
    """Levenberg-Marquardt in the span of ``motions`` (6V, M); yields (pose, loss) after every step.

    The elastic energy, weighted with the stage's pull, keeps out motions that stretch the frame for little gain.
    ``longest`` caps the shift of 98 % of the joints in mm, by raising the damping: beyond it the pictures are no
    longer nearly linear.
    """
    terms = rods.gauss_newton(as_rods(elastic, pose, stage.pieces), level)
    stiffness = stage.pull * elastic.assemble(elastic.stiffness)
    short = motions.astype(np.float32)  # the damping is far above what is lost, and half of the time is saved
    energy = 0.5 * pose.joints.ravel() @ (stiffness @ pose.joints.ravel())
    damping = 1e-3
    for _ in range(stage.iterations):
        matrix, gradient = joint_system(elastic, terms)
        reduced = (short.T @ ((matrix + stiffness) @ short)).astype(np.float64)
        slope = motions.T @ (gradient + stiffness @ pose.joints.ravel())
        diagonal = np.diag(reduced)
        bulk = np.diag(diagonal + 0.1 * diagonal.mean())
        step, damping = _capped(motions, reduced, slope, bulk, damping, longest)
        trial = pose.moved(step, np.zeros_like(pose.inner))
        found = rods.gauss_newton(as_rods(elastic, trial, stage.pieces), level)
        strain = 0.5 * trial.joints.ravel() @ (stiffness @ trial.joints.ravel())
        if found.loss + strain >= terms.loss + energy:
            damping *= 4.0
            if damping > 1e6:
                return
            continue
        fall = terms.loss + energy - found.loss - strain
        pose, terms, energy, damping = trial, found, strain, max(damping / 6.0, 1e-4)
        yield pose, terms.loss
        if fall < stage.gain * terms.loss:
            return


def _capped(
    motions: np.ndarray, reduced: np.ndarray, slope: np.ndarray, bulk: np.ndarray, damping: float, longest: float
) -> tuple[np.ndarray, float]:
    """The step (V, 6), with the damping raised until it is short enough."""
    while True:
        step = (motions @ np.linalg.solve(reduced + damping * bulk, -slope)).reshape(-1, 6)
        if np.percentile(np.linalg.norm(step[:, :3], axis=1), 98) <= longest or damping > 1e5:
            return step, damping
        damping *= 2.5


def strain(elastic: ElasticFrame, pose: Pose, anchor: Pose) -> float:
    """Elastic energy of the way from one pose to another, with that against spinning struts; see `free_step`."""
    away = (pose.joints - anchor.joints).ravel()[elastic.freedoms]
    bent = pose.inner - anchor.inner
    stiffness = elastic.stiffness + elastic.spin_stiffness
    ends = np.einsum("ea,eab,eb->", away, stiffness, away, optimize=True)
    inner = np.einsum("ea,eab,eb->", bent, elastic.inner_stiffness, bent, optimize=True)
    return 0.5 * float(ends + inner)


def free_step(
    elastic: ElasticFrame, terms: Terms, pose: Pose, anchor: Pose, pull: float, drag: float
) -> tuple[np.ndarray, np.ndarray]:
    """One Gauss-Newton step of every joint and strut.

    Minimises the linearised loss + pull E(pose + step - anchor) + drag E(step) over the step, E the elastic energy
    with that against spinning struts. The struts' own freedoms are eliminated strut by strut; what is left is sparse.

    Returns
    -------
    (V, 6) and (E, 6).
    """
    system = without_inner(elastic, terms, (pose, anchor), (pull, drag))
    joints = -elastic.solve(system.matrix, system.slope)
    own = -system.goes - np.matmul(system.follows, joints[elastic.freedoms][:, :, None])[:, :, 0]
    return joints.reshape(-1, 6), own


@dataclass(frozen=True, eq=False)
class WithoutInner:
    """The system of pictures and elastic energy with the struts' own freedoms eliminated.

    Attributes
    ----------
    matrix, slope : (6V, 6V) and (6V,) over the joints' freedoms.
    inverse : (E, 6, 6) of the matrices of what was eliminated.
    follows, goes : (E, 6, 12) and (E, 6)
        With the sign turned, how the struts' own follow the joints', and how they go besides.
    """

    matrix: BlockMatrix
    slope: np.ndarray
    inverse: np.ndarray
    follows: np.ndarray
    goes: np.ndarray


def without_inner(
    elastic: ElasticFrame, terms: Terms, poses: tuple[Pose, Pose], weights: tuple[float, float]
) -> WithoutInner:
    """Eliminate the struts' own freedoms from the system of `free_step`.

    Parameters
    ----------
    elastic, terms
        The frame, and what the pictures say of it.
    poses
        The present one and the anchor.
    weights
        The pull and the drag.
    """
    pose, anchor = poses
    pull, weight = weights[0], weights[0] + weights[1]
    count, away = len(elastic.edges), pose.joints - anchor.joints
    outer, slope, inverse, follows, goes = (
        np.empty((count, *shape)) for shape in ((12, 12), (12,), (6, 6), (6, 12), (6,))
    )
    step_kernels.without_inner(
        elastic.follow,
        terms.hessian,
        terms.gradient,
        elastic.stiffness,
        elastic.spin_stiffness,
        elastic.inner_stiffness,
        elastic.freedoms,
        away.ravel(),
        pose.inner - anchor.inner,
        np.array([pull, weight]),
        outer,
        slope,
        inverse,
        follows,
        goes,
    )
    held = GROUND * weight * elastic.frame.grounded[:, None] / np.median(elastic.frame.radius) ** 2
    shifted = held * away[:, :3] * (pull / max(weight, 1e-30))
    return WithoutInner(
        elastic.assemble(outer, terms.joint_hessian + held[:, :, None] * np.eye(3)),
        elastic.assemble_vector(slope, terms.joint_gradient + shifted),
        inverse,
        follows,
        goes,
    )


def covariance_between(elastic: ElasticFrame, terms: Terms, weight: float, pairs: np.ndarray) -> np.ndarray:
    """How loosely pictures and elastic energy hold pairs of joints to each other.

    Parameters
    ----------
    elastic, terms
        The frame, and what the pictures say of it.
    weight : float
        Of the elastic energy.
    pairs : (N, 2) array of int
        Joints.

    Returns
    -------
    (N, 3, 3) array, mm^2 pixels^-2
        The inverse of it takes the shift from one joint to the other to twice the rise of the loss that moving them
        together costs when all else follows.
    """
    planned = start_pose(elastic)  # from where it is measured does not matter to the matrix
    system = without_inner(elastic, terms, (planned, planned), (0.0, weight))
    factor = elastic.anchored(system.matrix).factorise()
    result = np.empty((len(pairs), 3, 3))
    for begin in range(0, len(pairs), TOGETHER):
        some = pairs[begin : begin + TOGETHER]
        apart = np.zeros((6 * elastic.vertex_count, len(some), 3))
        for sign, joint in ((1.0, some[:, 0]), (-1.0, some[:, 1])):
            apart[6 * joint[:, None] + np.arange(3), np.arange(len(some))[:, None], np.arange(3)] = sign
        solved = factor.solve(apart.reshape(len(apart), -1)).reshape(apart.shape)
        result[begin : begin + TOGETHER] = np.einsum("npi,npj->pij", apart, solved, optimize=True)
    return result
