"""Struts that are bent as no cubic can be: they are fitted as two curves that meet in the middle.

A strut that is clamped at both ends and bows between them, as s^2 (1 - s)^2 does, leaves at least a sixth of its bow
to the cubic nearest to it. By the Gauss-Newton terms of struts in two halves one knows by how much the loss would fall
were each free to bow. Those that gain enough, and those that seem to be torn off a joint, are halved: the frame gets a
joint in the middle of each, with the freedoms of every other joint, and all that is known of frames holds for the
halves. What is found is one curve of a higher degree again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from frametwin.fitting import presence
from frametwin.fitting.fast_stages import without_missing
from frametwin.fitting.fast_state import Problem, State, drawn, level_of, terms_of
from frametwin.fitting.misplaced import loss_of, settled
from frametwin.fitting.motion import Pose
from frametwin.fitting.part_fit import PartFit
from frametwin.fitting.torn_ends import Torn, scale_of, separated, without_ends
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods

GAIN, UNUSUAL = 0.25, 10.0
"""Fall of the loss by a bow, in squared pixels where the typical strut's radius is 1.8 pixels, and how many times more
than that of the typical strut, from which a strut is halved on trial."""

THERE = 0.5
"""Share of a strut that must be there for it."""

BESIDE, APART = 0.2, 2.5
"""Radii by which outlines are off a strut's own, and how many times more than those of the typical strut, likewise: a
bow that is far from the strut gains little at first."""

SHORTEST = 8.0
"""Radii of the shortest strut that is halved: of shorter ones one sees little but their joints."""

MOST = 0.1
"""Share of the struts that are halved at a time, at most, those that gain most."""

BENT, RISE = 0.2, 0.5
"""Radii by which the halves of a strut have to be off the cubic nearest to them to stay, and rise of the loss, were
they drawn as it, in squared pixels where the typical strut's radius is 1.8 pixels."""

NEAR, PAIRS = 8.0, 6
"""Radii between the middles of two struts of one joint that may have changed places, and how many are tried."""

SOFTER = 0.03
"""Stiffness of halves, by which they are held to where they were, relative to other struts'."""

SAMPLES = 33
"""Parameters by which one curve is laid through two halves."""

Bent: TypeAlias = "tuple[Problem, Problem, State, Torn, Halves]"
"""Plan, problem, state, torn ends and halves, of one and the same frame."""


@dataclass(frozen=True, eq=False)
class Halves:
    """Struts that are fitted as two, the second halves after all struts of the plan.

    Attributes
    ----------
    struts : (H,) array of int
        The second half of strut ``struts[i]`` is strut ``planned_struts + i``; they meet at vertex
        ``planned_vertices + i``.
    planned_struts, planned_vertices : int
        Of the plan.
    """

    struts: np.ndarray
    planned_struts: int
    planned_vertices: int

    @classmethod
    def none(cls, frame: Wireframe) -> Halves:
        """Of a frame whose struts are all whole."""
        return cls(np.zeros(0, dtype=np.int64), frame.strut_count, frame.vertex_count)

    @property
    def second(self) -> np.ndarray:
        """(H,) array of int: the struts that are second halves."""
        return self.planned_struts + np.arange(len(self.struts))

    def halved(self, values: np.ndarray) -> np.ndarray:
        """Values of struts (E, ...), those of a strut for both its halves (E + H, ...)."""
        return np.concatenate([values, values[self.struts]])

    def larger(self, values: np.ndarray) -> np.ndarray:
        """(E,) of the values of both halves (E + H,) the larger."""
        result = values[: self.planned_struts].copy()
        result[self.struts] = np.maximum(result[self.struts], values[self.second])
        return result

    def joined(self, part: PartFit, degree: int) -> PartFit:
        """What was found with struts in halves, of whole struts.

        Of standard deviations that of the worse half counts. Struts that were halved get curves of ``degree``.
        """
        if not len(self.struts):
            return part
        first, second = part.control_points[self.struts], part.control_points[self.second]
        cubic = part.control_points[: self.planned_struts].copy()
        cubic[self.struts] = joined_curve(first, second, 3)
        found: dict[str, Any] = {name: getattr(part, name) for name in ("sigma_across", "sigma_along")}
        found = {name: None if values is None else self.larger(values) for name, values in found.items()}
        return replace(
            part,
            control_points=cubic,
            vertices=part.vertices[: self.planned_vertices],
            thickness=self._along(part.thickness),
            opacity=self._along(part.opacity),
            confidence=-self.larger(-part.confidence),
            joint_radius=None if part.joint_radius is None else part.joint_radius[: self.planned_vertices],
            attached=None if part.attached is None else self._ends(part.attached),
            gap=None if part.gap is None else self._ends(part.gap),
            bent=dict(zip(self.struts.tolist(), joined_curve(first, second, degree), strict=True)),
            **found,
        )

    def _along(self, values: np.ndarray) -> np.ndarray:
        """(E, K) of values along both halves (E + H, K): of each two that follow each other the mean."""
        result = values[: self.planned_struts].copy()
        both = np.concatenate([values[self.struts], values[self.second]], axis=1)
        result[self.struts] = both.reshape(len(both), -1, 2).mean(axis=2)
        return result

    def _ends(self, values: np.ndarray) -> np.ndarray:
        """(E, 2) values of the ends of whole struts, from those of both halves (E + H, 2)."""
        result = values[: self.planned_struts].copy()
        result[self.struts, 1] = values[self.second, 1]
        return result


def joined_curve(first: np.ndarray, second: np.ndarray, degree: int) -> np.ndarray:
    """One curve through two that follow each other, by least squares with both ends fixed.

    Parameters
    ----------
    first, second : (N, 4, 3) array, mm
    degree : int

    Returns
    -------
    (N, degree + 1, 3) array, mm
    """
    half = np.linspace(0.0, 1.0, SAMPLES)
    lengths = bezier.arc_length(first), bezier.arc_length(second)
    cut = lengths[0] / np.maximum(lengths[0] + lengths[1], 1e-12)  # so that the speed is about even
    points = np.concatenate([bezier.evaluate(first, half), bezier.evaluate(second, half[1:])], axis=1)
    result = np.empty((len(first), degree + 1, 3))
    for i, where in enumerate(points):
        u = np.concatenate([cut[i] * half, cut[i] + (1.0 - cut[i]) * half[1:]])
        basis = bezier.bernstein(degree, u)
        ends = where[[0, -1]]
        inner = np.linalg.lstsq(basis[:, 1:-1], where - basis[:, [0, -1]] @ ends, rcond=None)[0]
        result[i] = np.concatenate([ends[:1], inner, ends[1:]])
    return result


def halved_frame(frame: Wireframe, halves: Halves) -> Wireframe:
    """The frame with a vertex in the middle of each of the struts, whose second halves come after all others."""
    first, second = bezier.split(frame.control_points, 0.5)
    chosen, count = halves.struts, len(halves.struts)
    middle = frame.vertex_count + np.arange(count)
    edges = halves.halved(frame.edges)
    edges[chosen, 1] = edges[halves.second, 0] = middle
    return frame.replace(
        vertices=np.concatenate([frame.vertices, second[chosen, 0]]),
        edges=edges,
        control_points=_cut(frame.control_points, halves),
        grounded=np.concatenate([frame.grounded, np.zeros(count, dtype=bool)]),
        **{name: halves.halved(getattr(frame, name)) for name in ("radius", "printed", "batch")},
    )


def _cut(curves: np.ndarray, halves: Halves) -> np.ndarray:
    """(E + H, 4, 3) of curves (E, 4, 3), some of them in two halves."""
    first, second = bezier.split(curves[halves.struts], 0.5)
    result = halves.halved(curves)
    result[halves.struts], result[halves.second] = first, second
    return result


def with_bent_struts(plan: Problem, problem: Problem, state: State, torn: Torn) -> Bent:
    """Halve struts that are bent as no cubic can be, where that explains more.

    Parameters
    ----------
    plan : Problem
        With every strut at its joints.
    problem, state, torn
        With a vertex of its own for each torn end.

    Returns
    -------
    plan, problem, state, torn, halves
        All with the halves as struts of their own.
    """
    whole = Halves.none(plan.frame)
    if problem.settings.degree <= 3:
        return plan, problem, state, torn, whole
    found = plan, problem, state, torn, whole
    suspects = _suspects(problem, state)
    loose = np.unique(torn.ends[:, 0])
    for chosen in (np.union1d(suspects, loose), np.setdiff1d(suspects, loose)):
        tried = _halved(found, chosen)
        found = _after(found, tried)
        if len(tried[4].struts):
            break
        if not len(loose):
            return found
    else:
        return found
    more = np.setdiff1d(_suspects(tried[1], tried[2]), np.concatenate([chosen, tried[4].second]))
    if len(more):  # what bent struts hid before
        again = _halved(found, np.union1d(tried[4].struts, more))
        tried = _after(tried, again)
        if len(again[4].struts) > len(tried[4].struts) and loss_of(again[1], again[2]) < loss_of(tried[1], tried[2]):
            return again
    return tried


def _after(found: Bent, later: Bent) -> Bent:
    """What was found, with the record of what was tried later."""
    plan, problem, state, torn, halves = found
    return plan, problem, replace(state, record=later[2].record), torn, halves


def _halved(whole: Bent, struts: np.ndarray) -> Bent:
    """With those of the struts halved that need it; as it is but for the record where that explains no more."""
    plan, problem, state, torn, none = whole
    while len(struts):
        halves = replace(none, struts=struts)
        found = _tried(plan, problem, state, torn, halves)
        state = replace(state, record=found[2].record)
        kept = _needed(found[1], found[2], halves)
        if kept.all():
            least = loss_of(found[1], found[2])
            if least < loss_of(problem, state) or least < loss_of(problem, settled(problem, state)):
                return _untangled(*found, halves)
            break
        struts = struts[kept]
    return plan, problem, state, torn, none


def _untangled(plan: Problem, problem: Problem, state: State, torn: Torn, halves: Halves) -> Bent:
    """Let halved struts of one joint change places in the middle, where that explains more.

    Two that bow towards each other may each be drawn along the other's middle, which the pictures hardly show.
    """
    pairs = _near_pairs(problem, state, halves)
    if pairs:
        state = settled(problem, state)  # as all that is tried will be
    for i, j in pairs:
        tried = settled(problem, _with_middles_exchanged(problem, state, halves, i, j))
        state = replace(state, record=tried.record)
        if loss_of(problem, tried) < loss_of(problem, state):
            state = tried
    return plan, problem, state, torn, halves


def _near_pairs(problem: Problem, state: State, halves: Halves) -> list[tuple[int, int]]:
    """Pairs of halved struts that share a joint and whose middles are near each other, the nearest first."""
    edges, radius = problem.frame.edges, float(np.median(state.pose.radius))
    ends = np.stack([edges[halves.struts, 0], edges[halves.second, 1]], axis=1)
    middles = drawn(problem, state, 1).joints[halves.planned_vertices + np.arange(len(ends))]
    found = {}
    for i, j in combinations(range(len(ends)), 2):
        apart = float(np.linalg.norm(middles[i] - middles[j]))
        if apart < NEAR * radius and np.intersect1d(ends[i], ends[j]).size:
            found[i, j] = apart
    return sorted(found, key=lambda pair: found[pair])[:PAIRS]


def _with_middles_exchanged(problem: Problem, state: State, halves: Halves, i: int, j: int) -> State:
    """The state with the middle of one halved strut where that of another is, and bows through it."""
    curves = drawn(problem, state, 1).control_points
    middles = halves.planned_vertices + np.array([i, j])
    places = drawn(problem, state, 1).joints[middles[::-1]]
    for which, place in zip((i, j), places, strict=True):
        first, second = halves.struts[which], halves.second[which]
        chord = bezier.straight(curves[[first], 0], curves[[second], 3])
        bow = place - 0.5 * (chord[0, 0] + chord[0, 3])
        chord[0, 1:3] += 4.0 / 3.0 * bow
        curves[first], curves[second] = (half[0] for half in bezier.split(chord, 0.5))
    joints, inner = _laid_along(problem, state.pose.joints, curves, middles)
    pose, anchor = replace(state.pose, joints=joints, inner=inner), state.anchor
    own = np.array([[halves.struts[which], halves.second[which]] for which in (i, j)]).ravel()
    from_here = replace(anchor, joints=anchor.joints.copy(), inner=anchor.inner.copy())
    from_here.joints[middles], from_here.inner[own] = joints[middles], inner[own]
    return replace(state, pose=pose, anchor=from_here, terms=None)


def _laid_along(
    problem: Problem, joints: np.ndarray, curves: np.ndarray, middles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Freedoms of all joints (V, 6), of which only the ``middles`` change, and of struts (E, 6) that give curves."""
    moved = curves - problem.frame.control_points
    own, _ = problem.elastic.freedoms_of(moved)
    joints = joints.copy()
    joints[middles] = own[middles]
    rest = moved - problem.elastic.displaced(np.zeros_like(moved), joints, np.zeros((len(moved), 6)))
    return joints, rest[:, 1:3].reshape(-1, 6)


def _suspects(problem: Problem, state: State) -> np.ndarray:
    """Struts that would gain much by a bow that is clamped at both ends, or whose outlines are off: `MOST` of all."""
    stage, frame = problem.settings.refine[-1], problem.frame
    whole, level = drawn(problem, state, stage.pieces), level_of(problem, state, stage)
    gain = _gain_of_bows(whole, level)
    least = max(GAIN * scale_of(problem, stage), UNUSUAL * float(np.median(gain)))
    off = presence.outline_misfit(whole, level)
    asks = (gain > least) | (off > max(BESIDE, APART * float(np.median(off))))
    asks &= frame.chord_lengths > SHORTEST * state.pose.radius
    asks &= state.pose.opacity.mean(axis=1) > THERE  # what is not there can be drawn anywhere
    order = np.argsort(-off, kind="stable")
    return np.sort(order[asks[order]][: max(1, int(MOST * frame.strut_count))])


def _gain_of_bows(whole: Rods, level: Level) -> np.ndarray:
    """(E,) falls of the loss were each strut alone free to bow beyond what its cubic can, to second order."""
    struts, pieces = len(whole.edges), max(1, whole.pieces // 2)
    halves = Halves(np.arange(struts), struts, len(whole.joints))
    first, second = bezier.split(whole.control_points, 0.5)
    edges = halves.halved(whole.edges)
    edges[:struts, 1] = edges[struts:, 0] = len(whole.joints) + np.arange(struts)
    drawn_halves = Rods(
        control_points=np.concatenate([first, second]),
        joints=np.concatenate([whole.joints, second[:, 0]]),
        edges=edges,
        radius=halves.halved(whole.radius[:, :pieces]),
        opacity=_cut_along(whole.opacity, halves)[:, :: max(1, whole.pieces // pieces)][:, :pieces],
        joint_size=None if whole.joint_size is None else np.concatenate([whole.joint_size, np.ones(struts)]),
    )
    terms = rods.gauss_newton(drawn_halves, level)
    slope = np.zeros((struts, 9))
    matrix = np.zeros((struts, 9, 9))
    for part, follows in zip((slice(struts), slice(struts, None)), _HALVES_FOLLOW, strict=True):
        slope += terms.gradient[part] @ follows
        matrix += follows.T @ terms.hessian[part] @ follows
    matrix += (1e-6 * np.trace(matrix, axis1=1, axis2=2) + 1e-9)[:, None, None] * np.eye(9)

    def gain(chosen: slice) -> np.ndarray:
        right = slope[:, chosen, None]
        return 0.5 * (right * np.linalg.solve(matrix[:, chosen, chosen], right)).sum(axis=(1, 2))

    return np.asarray(gain(slice(9)) - gain(slice(6)))  # what is left to a cubic's own points is no gain of a bow


def _halves_follow() -> tuple[np.ndarray, np.ndarray]:
    """(12, 9) each: how a strut's halves follow its two inner control points, and a bow that is clamped at its ends."""
    unit = np.eye(4)[:, :, None]
    result = []
    for half, bow in zip(bezier.split(unit, 0.5), ((0.0, 0.0, 1.0, 1.0), (1.0, 1.0, 0.0, 0.0)), strict=True):
        columns = [half[1, :, 0], half[2, :, 0], np.array(bow)]
        result.append(np.kron(np.stack(columns, axis=1), np.eye(3)))
    return result[0], result[1]


_HALVES_FOLLOW = _halves_follow()


def _needed(problem: Problem, state: State, halves: Halves) -> np.ndarray:
    """(H,) array of bool: halved struts that would be far off, and explain less, as the cubics nearest to them."""
    off, rise = _as_cubics(problem, state, halves)
    radius = state.pose.radius[halves.struts]
    return np.asarray((off > BENT * radius) & (rise > RISE * scale_of(problem, problem.settings.refine[-1])))


def _tried(
    plan: Problem, problem: Problem, state: State, torn: Torn, halves: Halves
) -> tuple[Problem, Problem, State, Torn]:
    """Plan, problem, state and torn ends with struts in two halves, those whose ends seemed torn at their joints."""
    frame = halved_frame(plan.frame, halves)
    softer = np.ones(frame.strut_count)
    softer[np.concatenate([halves.struts, halves.second])] = SOFTER
    new_plan = replace(plan, stiffness=softer).with_frame(frame)
    still = ~np.isin(torn.ends[:, 0], halves.struts)
    joined = without_ends(state, torn.planned, still)
    fewer = torn.only(still)
    old = separated(plan, fewer)
    new_torn = Torn(fewer.ends, fewer.joints, frame.vertex_count)
    new = separated(new_plan, new_torn)
    tried = settled(new, _in_halves(old, new, joined, halves))
    if problem.settings.learn_opacity and (state.pose.opacity[halves.struts] < 1.0).any():
        tried = without_missing(new, tried)
    return new_plan, new, tried, new_torn


def _cut_along(values: np.ndarray, halves: Halves) -> np.ndarray:
    """(E + H, K) of values (E, K) along struts, some of them in two halves."""
    twice, count = np.repeat(values[halves.struts], 2, axis=1), values.shape[1]
    result = halves.halved(values)
    result[halves.struts], result[halves.second] = twice[:, :count], twice[:, count:]
    return result


def _in_halves(old: Problem, new: Problem, state: State, halves: Halves) -> State:
    """The state of a problem for the one with struts in two halves, which are where they were."""
    planned, count = halves.planned_vertices, len(halves.struts)

    def cut(pose: Pose) -> Pose:
        curves = old.elastic.displaced(old.frame.control_points, pose.joints, pose.inner)
        known = np.concatenate([pose.joints[:planned], np.zeros((count, 6)), pose.joints[planned:]])
        joints, inner = _laid_along(new, known, _cut(curves, halves), planned + np.arange(count))
        opacity = halves.halved(pose.opacity)
        opacity[np.concatenate([halves.struts, halves.second])] = 1.0
        return Pose(joints, inner, halves.halved(pose.radius), opacity)

    sizes = state.joint_size
    if sizes is not None:
        sizes = np.concatenate([sizes[:planned], np.ones(count), sizes[planned:]])
    return replace(state, pose=cut(state.pose), anchor=cut(state.anchor), joint_size=sizes, terms=None)


def _as_cubics(problem: Problem, state: State, halves: Halves) -> tuple[np.ndarray, np.ndarray]:
    """What it would cost to draw halved struts as the cubics nearest to them.

    Returns
    -------
    (H,) mm by which the halves are off them, at most, and (H,) rises of the loss.
    """
    stage = problem.settings.refine[-1]
    curves = drawn(problem, state, 1).control_points
    first, second = curves[halves.struts], curves[halves.second]
    cut = bezier.split(joined_curve(first, second, 3), 0.5)
    terms = terms_of(problem, state, stage)
    rise, off = np.zeros(len(first)), np.zeros(len(first))
    u = np.linspace(0.0, 1.0, SAMPLES)
    for struts, now, then in ((halves.struts, first, cut[0]), (halves.second, second, cut[1])):
        moved = then - now
        off = np.maximum(off, np.linalg.norm(bezier.evaluate(moved, u), axis=2).max(axis=1))
        step = moved.reshape(-1, 12)
        rise += np.einsum("ea,ea->e", terms.gradient[struts], step)
        rise += 0.5 * np.einsum("ea,eab,eb->e", step, terms.hessian[struts], step)
    return off, rise
