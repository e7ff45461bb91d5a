"""Joints that have torn: ends of struts that are not where their joint is.

A fit that believes in every joint bends a torn strut into an S to reach its joint. Freeing its end alone would then
lower the loss, and by the Gauss-Newton terms one knows by how much, and about how far off the end really is. Ends that
gain enough are given a vertex of their own and fitted again. Those that come back to their joint are joined to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from frametwin.fitting import presence
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.fast_stages import free_stage
from frametwin.fitting.fast_state import Problem, State, drawn, level_of, terms_of
from frametwin.fitting.motion import Pose, covariance_between
from frametwin.fitting.nearby import Nearby
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.rods import Terms

GAIN = 0.25
"""Fall of the loss, in squared pixels where the typical strut's radius is 1.8 pixels, from which an end is tried."""

REACH = 0.8
"""Radii that an end would move, from which it is tried ..."""

LIKELY_GAP, GAP = 1.2, 1.5
"""... and from which, once it was fitted by itself, it is taken as torn: in its trial, and in sharper pictures."""

BACK = 0.6
"""Radii from their joints at which all ends of a trial may be for it to be given up at once: those that are torn by
enough to be told were beyond twice that after its first stage."""

FURTHEST = 8.0
"""Radii by which an end is moved at the start of its trial, at most: the terms are linear."""

LIKELY, CERTAIN = 1.0, 4.0
"""Rise of the loss, in the same pixels, were an end joined again and all else to follow, likewise."""

WHITE = 0.85
"""Share of a strut's pixels that must be white for its end to be believed."""

BESIDE, APART = 0.25, 3.0
"""Radii by which outlines may be off a strut's own, or how many times more than those of the typical strut, for its end
to be believed: a strut that bowed otherwise than its curve can is drawn nearer by an end that is free."""

STRETCH = 0.1
"""Share of its length by which a torn strut may be longer or shorter than planned: plastic breaks, it does not
stretch. A strut of which a part is missing would be shortened."""

MOST = 0.1
"""Share of the struts that are tried at a time, at most, those that gain most."""

TRIAL = 3
"""Steps of each stage of a trial, at most."""

ROUNDS = 2
"""Times that ends are tried; of each joint and strut one at a time."""


@dataclass(frozen=True, eq=False)
class Torn:
    """Ends of struts that hang free.

    Attributes
    ----------
    ends : (T, 2) array of int
        Strut, and 0 for its start or 1 for its end.
    joints : (T,) array of int
        The vertex of the plan that each was torn from.
    planned : int
        Vertices of the plan; end i has the vertex ``planned + i`` of a frame of its own.
    """

    ends: np.ndarray
    joints: np.ndarray
    planned: int

    @classmethod
    def none(cls, planned: int) -> Torn:
        """No end of a frame with so many vertices."""
        return cls(np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=np.int64), planned)

    def with_ends(self, ends: np.ndarray, plan: Wireframe) -> Torn:
        """With more ends (N, 2)."""
        joints = plan.edges[ends[:, 0], ends[:, 1]]
        return Torn(np.concatenate([self.ends, ends]), np.concatenate([self.joints, joints]), self.planned)

    def only(self, kept: np.ndarray) -> Torn:
        """Those of ``kept`` (T,)."""
        return Torn(self.ends[kept], self.joints[kept], self.planned)

    def attached(self, struts: int) -> np.ndarray:
        """(E, 2) array of bool, of so many struts."""
        result = np.ones((struts, 2), dtype=bool)
        result[self.ends[:, 0], self.ends[:, 1]] = False
        return result

    def gaps(self, vertices: np.ndarray, struts: int) -> np.ndarray:
        """(E, 2) distances of the ends of so many struts from their joints; 0 for those that are attached."""
        result = np.zeros((struts, 2))
        apart = np.linalg.norm(vertices[self.planned :] - vertices[self.joints], axis=1)
        result[self.ends[:, 0], self.ends[:, 1]] = apart
        return result


def mended(problem: Problem, state: State) -> tuple[Problem, State, Torn]:
    """Free the ends that are torn, where the settings let any be.

    Parameters
    ----------
    problem, state
        After every joint and strut were free.

    Returns
    -------
    problem, state, torn
        With a vertex more for each torn end.
    """
    torn = Torn.none(problem.elastic.vertex_count)
    plan, stage = problem, problem.settings.refine[-1]
    for _ in range(ROUNDS if problem.settings.learn_torn else 0):
        ends, shift = _suspects(problem, state, stage, torn)
        if not len(ends):
            break
        trial_torn = torn.with_ends(ends, plan.frame)
        trial = separated(plan, trial_torn)
        tried = _freed(trial, state, trial_torn, shift)
        near = Nearby.of(trial, tried, np.flatnonzero(struts_at(plan, trial_torn.joints[len(torn.ends) :])))
        for again in problem.settings.refine[-2:]:
            few = replace(again, iterations=min(again.iterations, TRIAL))
            tried = near.after(tried, partial(free_stage, stage=few))
            if _came_back(tried, trial_torn, len(torn.ends)):
                return problem, replace(state, record=tried.record).lapped("torn ends"), torn
        if not _new_ends_apart(near, tried, trial_torn, len(torn.ends), stage):
            state = replace(state, record=tried.record)
            break
        kept = _apart(trial, tried, trial_torn, stage, (LIKELY_GAP, LIKELY))
        found = trial_torn.only(kept)
        if not kept[len(torn.ends) :].any():
            state = replace(state, record=tried.record)
            break
        problem, state = separated(plan, found), without_ends(tried, torn.planned, kept)
        torn = found
        state = near.in_frame(problem, state).after(state, partial(free_stage, stage=stage))
    return problem, state.lapped("torn ends"), torn


def struts_at(plan: Problem, joints: np.ndarray) -> np.ndarray:
    """(E,) array of bool: struts that end at some joints (N,)."""
    return np.asarray(np.isin(plan.frame.edges, joints).any(axis=1))


def _came_back(state: State, torn: Torn, known: int) -> bool:
    """Whether all ends after the first ``known`` are at their joints again, or nearly so."""
    ends = state.pose.joints[torn.planned + known :, :3]
    gap = np.linalg.norm(ends - state.pose.joints[torn.joints[known:], :3], axis=1)
    return bool((gap < BACK * state.pose.radius[torn.ends[known:, 0]]).all())


def _new_ends_apart(near: Nearby, state: State, torn: Torn, known: int, stage: Stage) -> bool:
    """Whether any end after the first ``known`` may be torn, by what is seen of those alone that were tried."""
    places = np.searchsorted(near.joints, torn.planned + np.arange(known, len(torn.ends)))
    strut, side = torn.ends[known:].T
    ends = np.stack([np.searchsorted(near.struts, strut), side], axis=1)
    joints = np.searchsorted(near.joints, torn.joints[known:])
    there = _ends_apart(near.part, near.taken(state), (ends, places, joints), stage, (LIKELY_GAP, LIKELY))
    return bool(there.any())


def rejoined(plan: Problem, problem: Problem, state: State, torn: Torn, stage: Stage) -> tuple[Problem, State, Torn]:
    """Join ends to their joints that sharper pictures show to be there."""
    if not len(torn.ends):
        return problem, state, torn
    kept = _apart(problem, state, torn, stage, (GAP, CERTAIN))
    if kept.all():
        return problem, state, torn
    found = torn.only(kept)
    return separated(plan, found), without_ends(state, torn.planned, kept), found


def _suspects(problem: Problem, state: State, stage: Stage, torn: Torn) -> tuple[np.ndarray, np.ndarray]:
    """Ends (T, 2) that would gain by being free, and their shifts (T, 3).

    Of each joint and each strut the one that gains most: what pulls at a joint also makes all others pull back.
    """
    terms = terms_of(problem, state, stage)
    gain, shift = _gain_of_ends(terms)
    radius = state.pose.radius[:, None]
    far = np.linalg.norm(shift, axis=2)
    asks = (gain > GAIN * scale_of(problem, stage)) & (far > REACH * radius)
    asks[torn.ends[:, 0], torn.ends[:, 1]] = False
    edges = problem.frame.edges
    asks &= problem.frame.degree[edges] > 1
    order = np.argsort(-gain, axis=None, kind="stable")
    order = order[asks.ravel()[order]]
    for owner in (edges.ravel(), np.arange(2 * len(edges)) // 2):  # one of each joint, and of each strut
        _, first = np.unique(owner[order], return_index=True)
        order = order[np.sort(first)]
    order = order[: max(1, int(MOST * len(edges)))]
    ends = np.stack(np.unravel_index(order, gain.shape), axis=1)
    cap = np.minimum(1.0, FURTHEST * radius / np.maximum(far, 1e-12))[..., None]
    return ends, (cap * shift)[ends[:, 0], ends[:, 1]]


def _gain_of_ends(terms: Terms) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) falls of the loss were each end alone free, all else as it is, and the shifts (E, 2, 3) that do it."""
    corners = (slice(0, 3), slice(9, 12))
    slope = np.stack([terms.gradient[:, corner] for corner in corners], axis=1)
    matrix = np.stack([terms.hessian[:, corner, corner] for corner in corners], axis=1)
    trace = np.trace(matrix, axis1=2, axis2=3)
    matrix = matrix + (1e-6 * trace + 1e-9)[..., None, None] * np.eye(3)
    shift = -np.linalg.solve(matrix, slope[..., None])[..., 0]
    return -0.5 * (slope * shift).sum(axis=-1), shift


def scale_of(problem: Problem, stage: Stage) -> float:
    """Squared pixels of a stage to one where the typical radius is 1.8 pixels."""
    return (problem.levels.pixels_per_mm(stage.detail) * problem.levels.radius / 1.8) ** 2


def separated(plan: Problem, torn: Torn) -> Problem:
    """The problem with a vertex of its own for every torn end."""
    if not len(torn.ends):
        return plan
    return plan.with_frame(plan.frame.detached(torn.ends))


def _freed(problem: Problem, state: State, torn: Torn, shift: np.ndarray) -> State:
    """The state with new vertices for the last ends, moved to where they are expected.

    Their struts are as straight and as long as planned, and are held to that length from there on: how far a strut
    reaches is often hidden by what it was torn from.
    """
    frame, count = problem.frame, len(shift)
    (struts, sides), origins = torn.ends[-count:].T, torn.joints[-count:]
    joints = np.concatenate([state.pose.joints, state.pose.joints[origins]])
    fixed = frame.edges[struts, 1 - sides]
    other = frame.vertices[fixed] + joints[fixed, :3]
    chord = frame.vertices[origins] + joints[origins, :3] + shift - other
    chord *= (frame.chord_lengths[struts] / np.linalg.norm(chord, axis=1))[:, None]
    joints[-count:, :3] = other + chord - frame.vertices[origins]
    inner, bent = state.pose.inner.copy(), state.anchor.inner.copy()
    inner[struts] = bent[struts] = 0.0
    anchor = np.concatenate([state.anchor.joints, joints[-count:]])
    sizes = None if state.joint_size is None else np.concatenate([state.joint_size, np.ones(count)])
    return replace(
        state,
        pose=replace(state.pose, joints=joints, inner=inner),
        anchor=replace(state.anchor, joints=anchor, inner=bent),
        joint_size=sizes,
        terms=None,
    )


def without_ends(state: State, planned: int, kept: np.ndarray) -> State:
    """The state without the vertices of ends that are joined again."""
    vertices = np.concatenate([np.ones(planned, dtype=bool), kept])

    def chosen(pose: Pose) -> Pose:
        return replace(pose, joints=pose.joints[vertices])

    sizes = None if state.joint_size is None else state.joint_size[vertices]
    return replace(state, pose=chosen(state.pose), anchor=chosen(state.anchor), joint_size=sizes, terms=None)


def _apart(problem: Problem, state: State, torn: Torn, stage: Stage, least: tuple[float, float]) -> np.ndarray:
    """(T,) array of bool: ends that are apart from their joints by so many radii, and so much rise of the loss."""
    places = torn.planned + np.arange(len(torn.ends))
    return _ends_apart(problem, state, (torn.ends, places, torn.joints), stage, least)


def _ends_apart(
    problem: Problem,
    state: State,
    which: tuple[np.ndarray, np.ndarray, np.ndarray],
    stage: Stage,
    least: tuple[float, float],
) -> np.ndarray:
    """As `_apart`, of ends (T, 2), their vertices (T,) and the joints (T,) that they were torn from."""
    ends, places, joints = which
    strut = ends[:, 0]
    rods = drawn(problem, state, stage.pieces)
    gap = rods.joints[places] - rods.joints[joints]
    length = bezier.arc_length(rods.control_points[strut])
    planned = bezier.arc_length(problem.frame.control_points[strut])
    radius = state.pose.radius[strut]
    asks = np.linalg.norm(gap, axis=1) > least[0] * radius
    asks &= np.abs(length - planned) < np.maximum(STRETCH * planned, radius)
    if not asks.any():  # what the pictures say takes longer
        return np.asarray(asks)
    level = level_of(problem, state, stage)
    off = presence.outline_misfit(rods, level)
    asks &= presence.strut_whiteness(rods, level)[strut] > WHITE
    asks &= off[strut] < max(BESIDE, APART * float(np.median(off)))
    if not asks.any():
        return np.asarray(asks)
    pairs = np.stack([places, joints], axis=1)
    loose = covariance_between(problem.elastic, terms_of(problem, state, stage), stage.pull, pairs)
    rise = 0.5 * np.einsum("ti,ti->t", gap, np.linalg.solve(loose, gap[:, :, None])[:, :, 0])
    return np.asarray(asks & (rise > least[1] * scale_of(problem, stage)))
