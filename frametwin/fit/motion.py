"""Gauss-Newton steps of the frame: smooth motions first, then every joint and strut."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.fit.elastic import INNER, ElasticFrame
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods, Terms


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the frame is.

    Attributes
    ----------
    joints : (V, 6) freedoms of the joints, from the plan.
    inner : (E, 6) of the struts' inner control points.
    radius, opacity : (E, P) of the rods.
    """

    joints: np.ndarray
    inner: np.ndarray
    radius: np.ndarray
    opacity: np.ndarray

    def moved(self, joints: np.ndarray, inner: np.ndarray) -> Pose:
        """The pose after a step."""
        return replace(self, joints=self.joints + joints, inner=self.inner + inner)


def start_pose(elastic: ElasticFrame, pieces: int) -> Pose:
    """The plan itself."""
    count = len(elastic.edges)
    radius = np.repeat(elastic.frame.radius[:, None], pieces, axis=1)
    return Pose(np.zeros((elastic.vertex_count, 6)), np.zeros((count, 6)), radius, np.ones((count, pieces)))


def as_rods(elastic: ElasticFrame, pose: Pose) -> Rods:
    """What the splatter draws of a pose."""
    return Rods(
        control_points=elastic.displaced(elastic.frame.control_points, pose.joints, pose.inner),
        joints=elastic.frame.vertices + pose.joints[:, :3],
        edges=elastic.edges,
        radius=pose.radius,
        opacity=pose.opacity,
    )


def joint_system(elastic: ElasticFrame, terms: Terms) -> tuple:
    """Matrix (6V, 6V) and gradient (6V,) of the loss by the joints' freedoms, struts following."""
    follow = elastic.follow
    turned = follow.transpose(0, 2, 1)
    blocks = np.matmul(turned, np.matmul(terms.hessian, follow))
    gradient = np.matmul(turned, terms.gradient[:, :, None])[:, :, 0]
    return (
        elastic.assemble(blocks, terms.joint_hessian),
        elastic.assemble_vector(gradient, terms.joint_gradient),
    )


def smooth_descent(
    elastic: ElasticFrame,
    motions: np.ndarray,
    pose: Pose,
    level: Level,
    iterations: int,
    longest: float,
    gain: float,
):
    """Levenberg-Marquardt in the span of ``motions`` (6V, M); yields (pose, loss) after every step.

    ``longest`` caps the shift of 98 % of the joints in mm, by raising the damping: beyond it the pictures are no
    longer nearly linear.
    """
    terms = rods.gauss_newton(as_rods(elastic, pose), level)
    damping = 1e-3
    for _ in range(iterations):
        matrix, gradient = joint_system(elastic, terms)
        reduced = motions.T @ (matrix @ motions)
        slope = motions.T @ gradient
        diagonal = np.diag(reduced)
        bulk = np.diag(diagonal + 0.1 * diagonal.mean())
        step, damping = _capped(motions, reduced, slope, bulk, damping, longest)
        trial = pose.moved(step, np.zeros_like(pose.inner))
        found = rods.gauss_newton(as_rods(elastic, trial), level)
        if found.loss >= terms.loss:
            damping *= 4.0
            if damping > 1e6:
                return
            continue
        fall = terms.loss - found.loss
        pose, terms, damping = trial, found, max(damping / 6.0, 1e-4)
        yield pose, terms.loss
        if fall < gain * terms.loss:
            return


def _capped(motions, reduced, slope, bulk, damping, longest):
    while True:
        step = (motions @ np.linalg.solve(reduced + damping * bulk, -slope)).reshape(-1, 6)
        if np.percentile(np.linalg.norm(step[:, :3], axis=1), 98) <= longest or damping > 1e5:
            return step, damping
        damping *= 2.5


def free_step(
    elastic: ElasticFrame, terms: Terms, pose: Pose, anchor: Pose, pull: float, drag: float
) -> tuple[np.ndarray, np.ndarray]:
    """One Gauss-Newton step of every joint and strut.

    Minimises the linearised loss + pull E(pose + step - anchor) + drag E(step) over the step, E the elastic energy.
    The struts' own freedoms are eliminated strut by strut; what is left is sparse.

    Returns
    -------
    (V, 6) and (E, 6).
    """
    follow = elastic.follow
    turned = follow.transpose(0, 2, 1)
    away = (pose.joints - anchor.joints).ravel()[elastic.freedoms]
    bent = pose.inner - anchor.inner
    outer = np.matmul(turned, np.matmul(terms.hessian, follow)) + (pull + drag) * elastic.stiffness
    mixed = np.matmul(turned, terms.hessian[:, :, INNER])
    inner = terms.hessian[:, INNER, INNER] + (pull + drag) * elastic.inner_stiffness
    slope = np.matmul(turned, terms.gradient[:, :, None]) + pull * np.matmul(
        elastic.stiffness, away[:, :, None]
    )
    inner_slope = terms.gradient[:, INNER, None] + pull * np.matmul(elastic.inner_stiffness, bent[:, :, None])
    solved = np.linalg.solve(inner, np.concatenate([mixed.transpose(0, 2, 1), inner_slope], axis=2))
    outer -= np.matmul(mixed, solved[:, :, :12])
    slope -= np.matmul(mixed, solved[:, :, 12:])
    matrix = elastic.assemble(outer, terms.joint_hessian)
    right = -elastic.assemble_vector(slope[:, :, 0], terms.joint_gradient)
    joints = elastic.solve(matrix, right)
    own = -solved[:, :, 12] - np.matmul(solved[:, :, :12], joints[elastic.freedoms][:, :, None])[:, :, 0]
    return joints.reshape(-1, 6), own
