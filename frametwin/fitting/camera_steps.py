"""Gauss-Newton steps of frame and cameras together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from frametwin.fitting.camera_freedoms import (
    FREEDOMS,
    CameraPrior,
    CameraTerms,
    camera_terms,
    coupling_to_freedoms,
    joined_rows,
    with_cameras,
)
from frametwin.fitting.elastic import INNER, ElasticFrame
from frametwin.fitting.fast_settings import CoarseStage
from frametwin.fitting.motion import Pose, as_rods, joint_system, without_inner
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Terms, ViewTerms


def smooth_descent(
    elastic: ElasticFrame,
    motions: np.ndarray,
    start: tuple[Pose, np.ndarray],
    prior: CameraPrior,
    views: tuple[Level, np.ndarray],
    stage: CoarseStage,
    longest: float,
) -> Iterator[tuple[Pose, np.ndarray, float]]:
    """As `motion.smooth_descent`, cameras included; yields (pose, freedoms, loss) after every step.

    ``start`` are pose and freedoms (N, 10), ``views`` the pictures and their pixels (N,) to one of the full picture.
    """
    pose, freedoms = start
    level, scales = views

    def look(at: Pose, cameras: np.ndarray) -> tuple[ViewTerms, CameraTerms, float, float]:
        seen = with_cameras(level, cameras, scales)
        drawn = as_rods(elastic, at, stage.pieces)
        terms = rods.gauss_newton_by_view(drawn, seen)
        loss = float(terms.losses.sum())
        shift = at.joints.ravel()
        extra = 0.5 * shift @ (stiffness @ shift) + prior.loss(cameras)
        return terms, camera_terms(drawn, terms, seen.cameras, scales), loss, extra

    stiffness = stage.pull * elastic.assemble(elastic.stiffness)
    terms, cams, loss, extra = look(pose, freedoms)
    damping, size = 1e-3, motions.shape[1]
    for _ in range(stage.iterations):
        summed = terms.summed()
        matrix, gradient = joint_system(elastic, summed)
        coupling = motions.T @ coupling_to_freedoms(elastic, cams)
        full = np.zeros((size + coupling.shape[1],) * 2)
        full[:size, :size] = motions.T @ ((matrix + stiffness) @ motions)
        full[:size, size:], full[size:, :size] = coupling, coupling.T
        full[size:, size:] = _camera_matrix(cams, prior)
        slope = np.concatenate(
            [
                motions.T @ (gradient + stiffness @ pose.joints.ravel()),
                (cams.gradient + prior.pull(freedoms)).ravel(),
            ]
        )
        diagonal = np.diag(full).copy()
        diagonal[:size] += 0.1 * diagonal[:size].mean()
        while True:
            step = np.linalg.solve(full + damping * np.diag(diagonal), -slope)
            moved = (motions @ step[:size]).reshape(-1, 6)
            if np.percentile(np.linalg.norm(moved[:, :3], axis=1), 98) <= longest or damping > 1e5:
                break
            damping *= 2.5
        trial = pose.moved(moved, np.zeros_like(pose.inner))
        turned = freedoms + step[size:].reshape(-1, FREEDOMS)
        found = look(trial, turned)
        if found[2] + found[3] >= loss + extra:
            damping *= 4.0
            if damping > 1e6:
                return
            continue
        fall = loss + extra - found[2] - found[3]
        pose, freedoms, damping = trial, turned, max(damping / 6.0, 1e-4)
        terms, cams, loss, extra = found
        yield pose, freedoms, loss
        if fall < stage.gain * loss:
            return


def _camera_matrix(cams: CameraTerms, prior: CameraPrior) -> np.ndarray:
    """(10N, 10N) of the cameras by themselves."""
    views = len(cams.matrix)
    result = np.zeros((views, FREEDOMS, views, FREEDOMS))
    every = np.arange(views)
    result[every, :, every] = cams.matrix + prior.weight
    return result.reshape(views * FREEDOMS, views * FREEDOMS)


@dataclass(frozen=True, eq=False)
class Reduced:
    """The system with the struts' own freedoms and the joints eliminated: what is left is the cameras'.

    Attributes
    ----------
    matrix, slope : (10N, 10N) and (10N,).
    joints, coupling : (6V,) the joints' step with cameras fixed, and (6V, 10N) how it changes with theirs.
    inner, inner_joints, inner_cameras : (E, 6), (E, 6, 12) and (E, 6, 10N) of the struts' own, likewise.
    """

    matrix: np.ndarray
    slope: np.ndarray
    joints: np.ndarray
    coupling: np.ndarray
    inner: np.ndarray
    inner_joints: np.ndarray
    inner_cameras: np.ndarray


def reduced_system(
    elastic: ElasticFrame,
    terms: Terms,
    cams: CameraTerms,
    poses: tuple[Pose, Pose],
    known: tuple[np.ndarray, CameraPrior],
    weights: tuple[float, float],
) -> Reduced:
    """Eliminate the frame from one Gauss-Newton step; see `motion.free_step` for the frame's part.

    ``poses`` are the present one and the anchor, ``known`` the cameras' freedoms (N, 10) and their prior, ``weights``
    the pull and the drag of the elastic energy.
    """
    freedoms, prior = known
    count, size = len(elastic.edges), cams.matrix.shape[0] * FREEDOMS
    struts = cams.struts.reshape(count, 12, size)
    frame = without_inner(elastic, terms, poses, weights)
    inner_coupled = np.ascontiguousarray(struts[:, INNER])
    by_cameras = np.matmul(frame.inverse, inner_coupled)
    remaining = np.array(elastic.follow.transpose(0, 2, 1))
    remaining[:, :, INNER] -= frame.follows.transpose(0, 2, 1)
    coupled = np.matmul(remaining, struts)
    flat = inner_coupled.reshape(-1, size).T
    own = _camera_matrix(cams, prior) - flat @ by_cameras.reshape(-1, size)
    own_slope = (cams.gradient + prior.pull(freedoms)).ravel() - flat @ frame.goes.ravel()
    border = joined_rows(elastic, coupled, cams)
    both = elastic.anchored(frame.matrix).factorise().solve(np.column_stack([frame.slope, border]))
    joints, by_border = both[:, 0], both[:, 1:]
    return Reduced(
        matrix=own - border.T @ by_border,
        slope=own_slope - border.T @ joints,
        joints=joints,
        coupling=by_border,
        inner=frame.goes,
        inner_joints=frame.follows,
        inner_cameras=by_cameras,
    )


def whole_step(elastic: ElasticFrame, system: Reduced) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(V, 6), (E, 6) and (N, 10): the step of joints, struts and cameras."""
    cameras = -np.linalg.solve(system.matrix, system.slope)
    joints = -(system.joints + system.coupling @ cameras)
    own = -system.inner - np.matmul(system.inner_joints, joints[elastic.freedoms][:, :, None])[:, :, 0]
    own -= system.inner_cameras @ cameras
    return joints.reshape(-1, 6), own, cameras.reshape(-1, FREEDOMS)


def gain_of_cameras(system: Reduced) -> float:
    """By how much the loss would fall, to second order, were the cameras free."""
    return 0.5 * float(system.slope @ np.linalg.solve(system.matrix, system.slope))
