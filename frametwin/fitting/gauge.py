"""What holds the world when cameras are free: feet on the plate, the cameras' own places, and lengths.

Pictures cannot tell a print that is shifted, turned or enlarged from cameras that are so together. Such a similarity
of everything changes no pixel; which one is right is decided here, after the fit, by what is known beside the pictures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.fitting.camera_freedoms import FREEDOMS, SHIFT, TURN, whitening
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.motion import Pose
from frametwin.fitting.stubs import tell_typical
from frametwin.geometry import bezier
from frametwin.geometry.rotations import rotation_matrices, turns_of
from frametwin.geometry.wireframe import Wireframe

FEET = 0.05
"""mm: standard deviation of a foot on the plate, as it was planned and as it is seen."""

LENGTH = 1e-3
"""Least standard deviation of the common factor of all struts' lengths."""

UNEVEN, AS_MANY = 0.01, 4
"""Standard deviation of a strut's length, as a share of it, before any is seen, and how many struts that is worth."""

COMMON = 0.2
"""How far all lengths are off together, as a share of how far single ones are: in frames that sag, 0.01 to 0.25."""

ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Similarity:
    """x -> scale rotation x + shift; scale, rotation (3, 3), shift (3,) mm."""

    scale: float
    rotation: np.ndarray
    shift: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) after it."""
        return self.scale * points @ self.rotation.T + self.shift

    def after(self, other: Similarity) -> Similarity:
        """The other one first, then this."""
        return Similarity(self.scale * other.scale, self.rotation @ other.rotation, self(other.shift))


IDENTITY = Similarity(1.0, np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class Lengths:
    """What the struts' lengths say of the scale of everything.

    Attributes
    ----------
    longer
        Logarithm of how much longer the struts are than planned: the median, of struts whose ends are seen.
    deviation
        Standard deviation of what of it is no scale: struts get shorter as they are squashed, and longer where they
        hang, the more together the more it differs from strut to strut.
    """

    longer: float
    deviation: float

    @classmethod
    def of(cls, elastic: ElasticFrame, pose: Pose) -> Lengths:
        """Those of a frame in a pose."""
        plan = elastic.frame.control_points
        planned = bezier.arc_length(plan)
        seen = tell_typical(planned, elastic.frame.radius)
        longer = np.log(bezier.arc_length(elastic.displaced(plan, pose.joints, pose.inner)) / planned)[seen]
        count = len(longer)
        low, high = np.percentile(longer, [16.0, 84.0])
        spread = (count * (0.5 * (high - low)) ** 2 + AS_MANY * UNEVEN**2) / (count + AS_MANY)
        return cls(float(np.median(longer)), float(np.sqrt(LENGTH**2 + (COMMON**2 + 1.0 / count) * spread)))


def foot_deviation(frame: Wireframe, outline_error: float) -> float:
    """mm: standard deviation of a foot where outlines are wrong by ``outline_error`` mm, at all feet alike.

    What all share does not become less by their number, so each is worth the less the more there are.
    """
    return float(np.hypot(FEET, outline_error * np.sqrt(frame.grounded.sum())))


def moved_rig(packed: np.ndarray, freedoms: np.ndarray, motion: Similarity) -> np.ndarray:
    """Freedoms (N, 10) of cameras that were moved along; packed (N, 17) are the rig's own."""
    result = freedoms.copy()
    own = packed[:, :9].reshape(-1, 3, 3)
    rest = -np.einsum("vca,vc->va", own, packed[:, 9:12])
    result[:, SHIFT] = motion(rest + freedoms[:, SHIFT]) - rest
    turned = rotation_matrices(freedoms[:, TURN]) @ own @ motion.rotation.T
    result[:, TURN] = turns_of(turned @ own.transpose(0, 2, 1))
    return result


def moved_pose(elastic: ElasticFrame, pose: Pose, motion: Similarity) -> Pose:
    """The print moved along, with its radii."""
    plan = elastic.frame.control_points
    curves = motion(elastic.displaced(plan, pose.joints, pose.inner))
    joints, inner = elastic.freedoms_of(curves - plan)
    loose = np.ones(elastic.vertex_count, dtype=bool)
    loose[elastic.edges.ravel()] = False
    joints[loose] = pose.joints[loose]
    return Pose(joints, inner, pose.radius * motion.scale, pose.opacity)


def held_world(
    elastic: ElasticFrame,
    pose: Pose,
    packed: np.ndarray,
    freedoms: np.ndarray,
    covariances: np.ndarray,
    feet: float | None = FEET,
) -> Similarity:
    """The similarity that brings print and cameras to where feet, cameras and lengths most probably are.

    Gauss-Newton over the seven freedoms of a similarity; feet with Huber's weights, so that one that is hidden or came
    off the plate does not carry the others along. ``feet`` ``None`` leaves them out; ``covariances`` (N, 10, 10) are
    the cameras' own.
    """
    total = IDENTITY
    frame = elastic.frame
    where = frame.vertices[frame.grounded] + pose.joints[frame.grounded, :3]
    planned = frame.vertices[frame.grounded]
    lengths, white = Lengths.of(elastic, pose), whitening(covariances)
    for _ in range(ROUNDS):
        rows, values = [], []
        if feet is not None and len(planned):
            now = total(where)
            gap = np.linalg.norm(now - planned, axis=1)
            weight = 1.0 / np.sqrt(np.maximum(1.0, gap / (2.0 * feet))) / feet
            rows.append((_by_similarity(now) * weight[:, None, None]).reshape(-1, 7))
            values.append(((now - planned) * weight[:, None]).ravel())
        own = moved_rig(packed, freedoms, total)
        rows.append(_by_camera(packed, own, white))
        values.append(np.matmul(white, own[:, :, None]).ravel())
        rows.append(np.array([[0.0] * 6 + [1.0 / lengths.deviation]]))
        values.append(np.array([(np.log(total.scale) + lengths.longer) / lengths.deviation]))
        step = -np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
        small = Similarity(float(np.exp(step[6])), rotation_matrices(step[3:6]), step[:3])
        total = small.after(total)
        if np.abs(step).max() < 1e-9:
            break
    return total


def _by_similarity(points: np.ndarray) -> np.ndarray:
    """(N, 3, 7) motion of points by shift, turn about the origin and logarithm of the scale."""
    x, y, z = points.T
    zero = np.zeros_like(x)
    result = np.zeros((len(points), 3, 7))
    result[:, :, :3] = np.eye(3)
    result[:, :, 3] = np.stack([zero, -z, y], axis=1)
    result[:, :, 4] = np.stack([z, zero, -x], axis=1)
    result[:, :, 5] = np.stack([-y, x, zero], axis=1)
    result[:, :, 6] = points
    return result


def _by_camera(packed: np.ndarray, freedoms: np.ndarray, white: np.ndarray) -> np.ndarray:
    """(10N, 7) cameras' freedoms, made independent by ``white`` (N, 10, 10), by the similarity."""
    own = packed[:, :9].reshape(-1, 3, 3)
    centres = -np.einsum("vca,vc->va", own, packed[:, 9:12]) + freedoms[:, SHIFT]
    result = np.zeros((len(packed), FREEDOMS, 7))
    result[:, TURN, 3:6] = -own
    result[:, SHIFT] = _by_similarity(centres)
    return np.asarray(np.matmul(white, result)).reshape(-1, 7)


def rig_misfit(freedoms: np.ndarray, covariances: np.ndarray) -> float:
    """Squared corrections of all cameras over their variances: about 10 a camera if the rig errs as stated."""
    return float(np.square(np.matmul(whitening(covariances), freedoms[:, :, None])).sum())


def world_deviation(
    elastic: ElasticFrame, pose: Pose, packed: np.ndarray, covariances: np.ndarray, holds: str, foot: float = FEET
) -> np.ndarray:
    """(E,) mm: standard deviation of where the world is held, at the middle of each strut.

    An exact rig holds it exactly. Else it is that of the similarity which `held_world` finds, in the direction in which
    it is largest.

    Parameters
    ----------
    elastic, pose : the frame, as it was found.
    packed, covariances : (N, 17) and (N, 10, 10) the rig's cameras that were used, and how well each is known.
    holds : ``rig``, ``feet`` or ``cameras``.
    foot : mm, standard deviation of a foot.
    """
    frame = elastic.frame
    if holds == "rig":
        return np.zeros(frame.strut_count)
    rows = [_by_camera(packed, np.zeros((len(packed), FREEDOMS)), whitening(covariances))]
    rows.append(np.array([[*6 * [0.0], 1.0 / Lengths.of(elastic, pose).deviation]]))
    if holds == "feet":
        rows.append(_by_similarity(frame.vertices[frame.grounded]).reshape(-1, 7) / foot)
    known = np.concatenate(rows)
    moved = _by_similarity(frame.vertices[frame.edges].mean(axis=1))
    spread = np.matmul(np.matmul(moved, np.linalg.inv(known.T @ known)), moved.transpose(0, 2, 1))
    return np.asarray(np.sqrt(np.linalg.eigvalsh(spread)[:, -1]))
