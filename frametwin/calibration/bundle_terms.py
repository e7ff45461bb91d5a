"""The terms of a bundle adjustment: cameras, bodies and what is seen of them, residuals, derivatives, normal equations.

A body that may have moved between the pictures of a moment is a random effect: its motion is in the covariance of the
pixels, by Woodbury's identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from frametwin.cameras.lens_models import PERSPECTIVE, project

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LOOSE_SURPRISE = 8.0
"""Of a link whose body may have moved: what its surprise may be for each corner (2 is usual) before it counts less."""

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
    motion : (6,) array
        How far the body may have moved from its pose when the picture was taken: standard deviations of a turn in
        radians and of a shift in mm. None for a body that stood still.
    """

    eye: int
    body: int
    points: Floats
    pixels: Floats
    weight: float = 1.0
    motion: Floats | None = None


@dataclass(frozen=True, eq=False)
class Bundle:
    """The whole problem, or its solution."""

    eyes: tuple[Eye, ...]
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]


class Layout:
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


def moved(bundle: Bundle, x: Floats, layout: Layout) -> Bundle:
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


@dataclass(frozen=True, eq=False)
class Batch:
    """All that one camera sees, in one piece, so that numpy does the work.

    Attributes
    ----------
    eye
        Number of the camera.
    points, pixels
        Of its links, one after the other.
    body : (N,) array
        Number of the body of each point.
    weight : (N,) array
        Of each point.
    spans
        Of each link: its number, and where its points begin and end.
    """

    eye: int
    points: Floats
    pixels: Floats
    body: Integers
    weight: Floats
    spans: tuple[tuple[int, int, int], ...]


def batches_of(bundle: Bundle) -> list[Batch]:
    """The links of each camera that has any."""
    found = []
    for eye in sorted({link.eye for link in bundle.links}):
        numbers = [i for i, link in enumerate(bundle.links) if link.eye == eye]
        links = [bundle.links[i] for i in numbers]
        sizes = [len(link.points) for link in links]
        ends = np.cumsum(sizes).tolist()
        spans = tuple((i, end - size, end) for i, size, end in zip(numbers, sizes, ends, strict=True))
        body = np.repeat([link.body for link in links], sizes)
        weight = np.repeat([link.weight for link in links], sizes)
        points, pixels = (np.concatenate(parts) for parts in ([k.points for k in links], [k.pixels for k in links]))
        found.append(Batch(eye, points, pixels, body, weight, spans))
    return found


def _local(bundle: Bundle, batch: Batch) -> tuple[Floats, Floats]:
    """Points of a batch in the world and in the camera's axes."""
    poses, place = np.array([body.pose for body in bundle.bodies]), bundle.eyes[batch.eye].camera_to_world
    world = np.einsum("nij,nj->ni", poses[batch.body, :3, :3], batch.points) + poses[batch.body, :3, 3]
    return world, (world - place[:3, 3]) @ place[:3, :3]


def residuals_of(bundle: Bundle, batch: Batch) -> Floats:
    """(N, 2) seen less computed, px."""
    eye = bundle.eyes[batch.eye]
    local = _local(bundle, batch)[1]
    with np.errstate(all="ignore"):
        left = batch.pixels - project(eye.model, eye.lens, local)[0]
    bad = ~np.isfinite(left).all(axis=1) | ((local[:, 2] <= 0.0) & (eye.model == PERSPECTIVE))
    return np.where(bad[:, None], HIDDEN, np.clip(left, -1e6, 1e6))


def link_residuals(bundle: Bundle, batches: Sequence[Batch]) -> tuple[Floats, ...]:
    """Residuals (N, 2) of every link, in the order of the links."""
    found: list[Floats] = [np.zeros((0, 2))] * len(bundle.links)
    for batch in batches:
        left = residuals_of(bundle, batch)
        for number, begin, end in batch.spans:
            found[number] = left[begin:end]
    return tuple(found)


def _is_loose(bundle: Bundle, batch: Batch) -> bool:
    return any(bundle.links[number].motion is not None for number, _, _ in batch.spans)


def cost_of(bundle: Bundle, batches: Sequence[Batch], robust_px: float | None) -> float:
    """Half of what is minimised."""
    total = 0.0
    for batch in batches:
        left = residuals_of(bundle, batch)
        square = (left**2).sum(axis=1)
        if robust_px is not None:
            square = 2.0 * robust_px**2 * (np.sqrt(1.0 + square / robust_px**2) - 1.0)
        square = square * batch.weight**2
        by_body = jacobian_of(bundle, batch)[1] if _is_loose(bundle, batch) else None
        for number, begin, end in batch.spans:
            link = bundle.links[number]
            if link.motion is None or by_body is None:
                total += float(square[begin:end].sum())
                continue
            surprise = _surprise(link, left[begin:end], by_body[2 * begin : 2 * end])
            if robust_px is not None:
                usual = LOOSE_SURPRISE * (end - begin)
                surprise = 2.0 * usual * (np.sqrt(1.0 + surprise / usual) - 1.0)
            total += surprise
    for eye in bundle.eyes:
        if eye.prior is not None:
            off = off_prior(eye)
            total += float(off @ eye.prior @ off)
    return 0.5 * total


def _without_motion(link: Link, by_body: Floats, values: Floats) -> Floats:
    """Values (2N, ...) times the inverse covariance of a link's pixels, the body's own motion in it (Woodbury)."""
    assert link.motion is not None
    scaled = link.weight * by_body
    inner = scaled.T @ scaled + np.diag(link.motion**-2.0)
    return link.weight**2 * (values - by_body @ (link.weight**2 * np.linalg.solve(inner, by_body.T @ values)))


def _surprise(link: Link, left: Floats, by_body: Floats) -> float:
    """Squared Mahalanobis length of the residuals of a link whose body may have moved."""
    flat = left.ravel()
    return float(flat @ _without_motion(link, by_body, flat))


def normal_equations(
    bundle: Bundle, batches: Sequence[Batch], layout: Layout, robust_px: float | None
) -> tuple[Floats, Floats]:
    """Matrix (U, U) and right-hand side (U,) of a Gauss-Newton step; far-off corners count less."""
    normal, gradient = np.zeros((layout.count, layout.count)), np.zeros(layout.count)
    for batch in batches:
        left = residuals_of(bundle, batch)
        columns = layout.eyes[batch.eye]
        own = columns[columns >= 0]
        by_eye, by_body = jacobian_of(bundle, batch)
        by_eye = by_eye[:, columns >= 0]
        heavy_eye, heavy_body, pull = _weighed(bundle, batch, left, by_eye, by_body, robust_px)
        normal[np.ix_(own, own)] += by_eye.T @ heavy_eye
        gradient[own] += by_eye.T @ pull
        for number, begin, end in batch.spans:
            body = layout.bodies[bundle.links[number].body]
            if body[0] < 0:
                continue
            lines, place = slice(2 * begin, 2 * end), slice(int(body[0]), int(body[0]) + 6)
            normal[place, place] += by_body[lines].T @ heavy_body[lines]
            gradient[place] += by_body[lines].T @ pull[lines]
            mixed = by_eye[lines].T @ heavy_body[lines]
            normal[own, place] += mixed
            normal[place, own] += mixed.T
    add_priors(bundle, layout, normal, gradient)
    return normal, gradient


def _weighed(
    bundle: Bundle, batch: Batch, left: Floats, by_eye: Floats, by_body: Floats, robust_px: float | None
) -> tuple[Floats, Floats, Floats]:
    """Both derivatives and the residuals (2N, ...), times the inverse covariance of the pixels."""
    share = batch.weight**2
    if robust_px is not None:
        share = share / np.sqrt(1.0 + (left**2).sum(axis=1) / robust_px**2)
    heavy = np.repeat(share, 2)[:, None]
    result = heavy * by_eye, heavy * by_body, heavy[:, 0] * left.ravel()
    for number, begin, end in batch.spans:
        link, lines = bundle.links[number], slice(2 * begin, 2 * end)
        if link.motion is None:
            continue
        arm = by_body[lines]
        factor = 1.0
        if robust_px is not None:
            factor /= np.sqrt(1.0 + _surprise(link, left[begin:end], arm) / (LOOSE_SURPRISE * (end - begin)))
        for whole, part in zip(result, (by_eye[lines], arm, left[begin:end].ravel()), strict=True):
            whole[lines] = factor * _without_motion(link, arm, part)
    return result


def off_prior(eye: Eye) -> Floats:
    """How far a lens is from the mean of its prior."""
    return eye.lens if eye.prior_mean is None else eye.lens - eye.prior_mean


def add_priors(bundle: Bundle, layout: Layout, normal: Floats, gradient: Floats) -> None:
    for eye, columns in zip(bundle.eyes, layout.eyes, strict=True):
        if eye.prior is not None:
            own = columns[: len(eye.lens)]
            there = own >= 0
            normal[np.ix_(own[there], own[there])] += eye.prior[np.ix_(there, there)]
            gradient[own[there]] -= (eye.prior @ off_prior(eye))[there]


def jacobian_of(bundle: Bundle, batch: Batch) -> tuple[Floats, Floats]:
    """Derivatives of a batch's computed pixels by its camera (2N, P + 6) and by each point's body (2N, 6)."""
    eye = bundle.eyes[batch.eye]
    world, local = _local(bundle, batch)
    with np.errstate(all="ignore"):
        _, by_local, by_lens = project(eye.model, eye.lens, local)
    by_local = np.where(np.isfinite(by_local), by_local, 0.0)
    by_lens = np.where(np.isfinite(by_lens), by_lens, 0.0)
    by_turn = by_local @ _cross(local)  # the camera turns by w: local becomes exp(-w) local
    by_world = by_local @ eye.camera_to_world[:3, :3].T
    by_eye = np.concatenate([by_lens, by_turn, -by_world], axis=2)
    origins = np.array([body.pose[:3, 3] for body in bundle.bodies])[batch.body]
    by_body = np.concatenate([-by_world @ _cross(world - origins), by_world], axis=2)
    count = 2 * len(world)
    return by_eye.reshape(count, -1), by_body.reshape(count, -1)


def _cross(vectors: Floats) -> Floats:
    """(N, 3, 3) matrices of cross products."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
