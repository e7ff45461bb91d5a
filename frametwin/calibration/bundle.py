"""Bundle adjustment: lenses, cameras and boards moved together until all corners are where they were seen.

B. Triggs et al., "Bundle adjustment: a modern synthesis", 1999; the lenses' earlier calibration enters as a Gaussian
prior, so that their pictures need not be carried along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.spatial.transform import Rotation

from frametwin.cameras.lens_models import project

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LARGEST_STEPS = 60
SETTLED = 1e-6
"""Step in px, about, after which nothing more changes."""

HIDDEN = 1e3
"""Residual in px of a point behind its camera."""


@dataclass(frozen=True, eq=False)
class Eye:
    """A camera of the problem.

    Attributes
    ----------
    model
        Of its lens.
    lens : (P,) array
        Parameters of the lens.
    free : (P,) array
        Which of them are found.
    camera_to_world : (4, 4) array, mm
        OpenCV axes.
    fixed
        Whether the pose is held.
    prior : (P, P) array
        Inverse covariance of the lens about ``prior_mean``; None without a prior.
    prior_mean : (P,) array
        Its mean.
    """

    model: str
    lens: Floats
    free: NDArray[np.bool_]
    camera_to_world: Floats
    fixed: bool = False
    prior: Floats | None = None
    prior_mean: Floats | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A board at a moment, or the object that tells where the world is: its pose in the world in mm."""

    pose: Floats
    fixed: bool = False


@dataclass(frozen=True, eq=False)
class Link:
    """Corners of a body seen by a camera.

    Attributes
    ----------
    eye, body
        Numbers of camera and body.
    points : (N, 3) array, mm
        In the body's axes.
    pixels : (N, 2) array
        As seen, pixel centres at +0.5.
    weight
        One over the standard deviation of the pixels, relative to the others.
    """

    eye: int
    body: int
    points: Floats
    pixels: Floats
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Bundle:
    """The whole problem, or its solution."""

    eyes: tuple[Eye, ...]
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]


@dataclass(frozen=True, eq=False)
class Solution:
    """What came of it.

    Attributes
    ----------
    bundle
        With everything at its place.
    residuals
        (N, 2) px for each link: seen less computed, unweighted.
    sigma
        Standard deviation of one coordinate of a corner in px, by what is left over.
    covariance : (U, U) array
        Of all unknowns, of the size that ``sigma`` says; None if it was not asked for.
    eye_columns
        Unknowns of each camera: where its free lens parameters and its pose (turn about its own axes, centre in the
        world) stand; -1 for what is held.
    """

    bundle: Bundle
    residuals: tuple[Floats, ...]
    sigma: float
    covariance: Floats | None
    eye_columns: tuple[Integers, ...]

    def eye_covariance(self, i: int) -> Floats:
        """(P + 6, P + 6) covariance of lens and pose of a camera; zero for what is held."""
        assert self.covariance is not None
        columns = self.eye_columns[i]
        there = columns >= 0
        result = np.zeros((len(columns), len(columns)))
        result[np.ix_(there, there)] = self.covariance[np.ix_(columns[there], columns[there])]
        return result

    def rms(self, i: int) -> float:
        """Root mean square distance of the corners of a link, px."""
        return float(np.sqrt((self.residuals[i] ** 2).sum(axis=1).mean()))


class _Layout:
    """Where each unknown stands in the vector."""

    def __init__(self, bundle: Bundle) -> None:
        count = 0
        eyes, bodies = [], []
        for eye in bundle.eyes:
            columns = np.full(len(eye.lens) + 6, -1, dtype=np.int64)
            wanted = np.concatenate([eye.free, np.full(6, not eye.fixed)])
            columns[wanted] = count + np.arange(int(wanted.sum()))
            count += int(wanted.sum())
            eyes.append(columns)
        for body in bundle.bodies:
            bodies.append(np.full(6, -1, dtype=np.int64) if body.fixed else count + np.arange(6))
            count += 0 if body.fixed else 6
        self.eyes, self.bodies, self.count = tuple(eyes), tuple(bodies), count


def solve(
    bundle: Bundle,
    *,
    robust_px: float | None = None,
    covariance: bool = False,
    steps: int = LARGEST_STEPS,
    watch: Callable[[], object] | None = None,
) -> Solution:
    """Adjust a bundle by Levenberg's and Marquardt's damped Gauss-Newton steps.

    Parameters
    ----------
    bundle
        Where to start; all that is not held is changed.
    robust_px
        Residual in px from which on corners count less and less (soft L1); None for plain least squares.
    covariance
        Whether to find the covariance.
    steps
        Most steps.
    watch
        Called before each step; may raise to stop.
    """
    layout = _Layout(bundle)
    damping, cost = 1e-4, _cost(bundle, robust_px)
    for _ in range(steps if layout.count else 0):
        if watch is not None:
            watch()
        normal, gradient = _normal_equations(bundle, layout, robust_px)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled, slope = normal / np.outer(scale, scale), gradient / scale
        step, trial, trial_cost = np.zeros(layout.count), bundle, cost
        while damping < 1e8:
            step = _damped_step(scaled, slope, damping)
            trial = moved(bundle, step / scale, layout)
            trial_cost = _cost(trial, robust_px)
            if trial_cost <= cost:
                break
            damping *= 10.0
        if not trial_cost <= cost:
            break
        gain, cost, bundle = cost - trial_cost, trial_cost, trial
        damping = max(0.1 * damping, 1e-12)
        if np.abs(step).max() < SETTLED or gain <= 1e-14 * cost:
            break
    left = tuple(_link_residuals(bundle, link) for link in bundle.links)
    sigma = _sigma(bundle, left, layout.count)
    matrix = _covariance(bundle, layout, sigma) if covariance else None
    return Solution(bundle, left, sigma, matrix, layout.eyes)


def _damped_step(scaled: Floats, slope: Floats, damping: float) -> Floats:
    try:
        return np.asarray(linalg.solve(scaled + damping * np.eye(len(scaled)), slope, assume_a="pos"))
    except linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(scaled + damping * np.eye(len(scaled)), slope, rcond=1e-12)[0])


def moved(bundle: Bundle, x: Floats, layout: _Layout) -> Bundle:
    """The bundle after a step of all unknowns."""
    eyes = []
    for eye, columns in zip(bundle.eyes, layout.eyes, strict=True):
        step = _picked(x, columns)
        size = len(eye.lens)
        pose = eye.camera_to_world.copy()
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(step[size : size + 3]).as_matrix()
        pose[:3, 3] += step[size + 3 :]
        eyes.append(replace(eye, lens=eye.lens + step[:size], camera_to_world=pose))
    bodies = []
    for body, columns in zip(bundle.bodies, layout.bodies, strict=True):
        step = _picked(x, columns)
        pose = body.pose.copy()
        pose[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += step[3:]
        bodies.append(replace(body, pose=pose))
    return replace(bundle, eyes=tuple(eyes), bodies=tuple(bodies))


def _picked(x: Floats, columns: Integers) -> Floats:
    return np.where(columns >= 0, x[np.maximum(columns, 0)] if len(x) else 0.0, 0.0)


def _local(bundle: Bundle, link: Link) -> tuple[Floats, Floats]:
    """Points of a link in the world and in the camera's axes."""
    body, eye = bundle.bodies[link.body], bundle.eyes[link.eye]
    world = link.points @ body.pose[:3, :3].T + body.pose[:3, 3]
    return world, (world - eye.camera_to_world[:3, 3]) @ eye.camera_to_world[:3, :3]


def _link_residuals(bundle: Bundle, link: Link) -> Floats:
    eye = bundle.eyes[link.eye]
    local = _local(bundle, link)[1]
    with np.errstate(all="ignore"):
        left = link.pixels - project(eye.model, eye.lens, local)[0]
    bad = ~np.isfinite(left).all(axis=1) | ((local[:, 2] <= 0.0) & (eye.model == "OPENCV"))
    return np.where(bad[:, None], HIDDEN, np.clip(left, -1e6, 1e6))


def _prior_root(eye: Eye) -> Floats | None:
    """(F, P) matrix whose product with the lens' distance from its mean is a unit Gaussian."""
    if eye.prior is None:
        return None
    values, vectors = np.linalg.eigh(eye.prior)
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T


def _cost(bundle: Bundle, robust_px: float | None) -> float:
    """Half of what is minimised, in squared pixels."""
    total = 0.0
    for link in bundle.links:
        square = (_link_residuals(bundle, link) ** 2).sum(axis=1)
        if robust_px is not None:
            square = 2.0 * robust_px**2 * (np.sqrt(1.0 + square / robust_px**2) - 1.0)
        total += float(square.sum()) * link.weight**2
    for eye in bundle.eyes:
        if eye.prior is not None:
            off = eye.lens - eye.prior_mean
            total += float(off @ eye.prior @ off)
    return 0.5 * total


def _normal_equations(bundle: Bundle, layout: _Layout, robust_px: float | None) -> tuple[Floats, Floats]:
    """Matrix (U, U) and right-hand side (U,) of a Gauss-Newton step; far-off corners count less."""
    normal, gradient = np.zeros((layout.count, layout.count)), np.zeros(layout.count)

    def add(block: Floats, rows: Integers, columns: Integers) -> None:
        normal[np.ix_(rows[rows >= 0], columns[columns >= 0])] += block[np.ix_(rows >= 0, columns >= 0)]

    for link in bundle.links:
        left = _link_residuals(bundle, link)
        share = np.full(len(left), link.weight**2)
        if robust_px is not None:
            share = share / np.sqrt(1.0 + (left**2).sum(axis=1) / robust_px**2)
        by_eye, by_body = _link_jacobian(bundle, link)
        heavy = np.repeat(share, 2)[:, None]
        eye, body = layout.eyes[link.eye], layout.bodies[link.body]
        add(by_eye.T @ (heavy * by_eye), eye, eye)
        add(by_body.T @ (heavy * by_body), body, body)
        mixed = by_eye.T @ (heavy * by_body)
        add(mixed, eye, body)
        add(mixed.T, body, eye)
        pull = heavy[:, 0] * left.ravel()
        gradient[eye[eye >= 0]] += (by_eye.T @ pull)[eye >= 0]
        gradient[body[body >= 0]] += (by_body.T @ pull)[body >= 0]
    for i, eye_now in enumerate(bundle.eyes):
        if eye_now.prior is not None:
            own = layout.eyes[i][: len(eye_now.lens)]
            add(eye_now.prior, own, own)
            gradient[own[own >= 0]] -= (eye_now.prior @ (eye_now.lens - eye_now.prior_mean))[own >= 0]
    return normal, gradient


def _link_jacobian(bundle: Bundle, link: Link) -> tuple[Floats, Floats]:
    """Derivatives of a link's computed pixels by its camera (2N, P + 6) and by its body (2N, 6)."""
    eye, body = bundle.eyes[link.eye], bundle.bodies[link.body]
    world, local = _local(bundle, link)
    with np.errstate(all="ignore"):
        _, by_local, by_lens = project(eye.model, eye.lens, local)
    by_local = np.where(np.isfinite(by_local), by_local, 0.0)
    by_lens = np.where(np.isfinite(by_lens), by_lens, 0.0)
    by_turn = by_local @ _cross(local)  # the camera turns by w: local becomes exp(-w) local
    by_world = by_local @ eye.camera_to_world[:3, :3].T
    by_eye = np.concatenate([by_lens, by_turn, -by_world], axis=2)
    by_body = np.concatenate([-by_world @ _cross(world - body.pose[:3, 3]), by_world], axis=2)
    count = 2 * len(world)
    return by_eye.reshape(count, -1), by_body.reshape(count, -1)


def _cross(vectors: Floats) -> Floats:
    """(N, 3, 3) matrices of cross products."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _sigma(bundle: Bundle, left: Sequence[Floats], unknowns: int) -> float:
    """Standard deviation of a coordinate, with what the unknowns took up allowed for."""
    if not left:
        return 0.0
    weighted = np.concatenate([(part * link.weight).ravel() for part, link in zip(left, bundle.links, strict=True)])
    given = sum(len(eye.lens) for eye in bundle.eyes if eye.prior is not None)
    freedom = len(weighted) + given - unknowns
    return float(np.sqrt((weighted**2).sum() / max(freedom, 1)))


def _covariance(bundle: Bundle, layout: _Layout, sigma: float) -> Floats:
    """Inverse of the normal equations, corners as sure as sigma says; priors keep their own size."""
    without = replace(bundle, eyes=tuple(replace(eye, prior=None) for eye in bundle.eyes))
    normal = _normal_equations(without, layout, None)[0] / max(sigma, 1e-12) ** 2
    for eye, columns in zip(bundle.eyes, layout.eyes, strict=True):
        if eye.prior is not None:
            own = columns[: len(eye.lens)]
            there = own >= 0
            normal[np.ix_(own[there], own[there])] += eye.prior[np.ix_(there, there)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal * np.outer(scale, scale)
    try:
        inverse = linalg.cho_solve(linalg.cho_factor(scaled), np.eye(len(scaled)))
    except linalg.LinAlgError:
        inverse = np.linalg.pinv(scaled, hermitian=True)
    return np.asarray(0.5 * (inverse + inverse.T) * np.outer(scale, scale))
