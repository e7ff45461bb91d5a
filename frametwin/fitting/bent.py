"""Struts that are bent as no cubic can be: they are fitted as two curves that meet in the middle.

A strut that is clamped at both ends and bows between them, as s^2 (1 - s)^2 does, leaves at least a sixth of its bow
to the cubic nearest to it. Those that would gain much by a bow (`frametwin.fitting.bows`), and those that seem to be
torn off a joint, are halved: the frame gets a joint in the middle of each, with the freedoms of every other joint, and
all that is known of frames holds for the halves. What is found is one curve of a higher degree again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frametwin.fitting.bows import SHORTEST, suspects
from frametwin.fitting.fast_stages import loss_of, whiteness_of, without_missing
from frametwin.fitting.fast_state import Problem, State, drawn, level_of, terms_of
from frametwin.fitting.halves import SAMPLES, Halves, cut, halved_frame, joined_curve, laid_along
from frametwin.fitting.misplaced import BROKEN, settled
from frametwin.fitting.motion import Pose
from frametwin.fitting.nearby import Nearby
from frametwin.fitting.presence import outline_misfit
from frametwin.fitting.tangled import AROUND_BENT, untangled
from frametwin.fitting.torn_ends import Torn, scale_of, separated, without_ends
from frametwin.geometry import bezier

BENT, RISE = 0.2, 0.2
"""Radii by which the halves of a strut have to be off the cubic nearest to them to stay, and rise of the loss, were
they drawn as it, in squared pixels where the typical strut's radius is 1.8 pixels."""

SURE = 0.35
"""Product of these radii, and of the rise in losses of the typical strut, that it takes where cameras are free or
joints have material of their own: these, not quite right, make straight struts look bowed, mostly by less than this.
Bows of five and eight radii have 0.4 to 50."""

WINS = 0.1
"""Share of these rises, at least, by which the loss is lower with the struts halved than without: what is put down to
bows may be the fault of others."""

CLEAR = 2.5
"""Pixels of the typical strut's radius, at least: in coarser pictures bows are found where there are none."""

ROBBED = 3
"""Struts that seem to be broken, at most, that are halved on trial for it."""

NEIGHBOUR = 1.5
"""Times that outlines are off those of the typical strut from which a strut is halved on trial beside a halved one."""

SOFTER = 0.03
"""Stiffness of halves, by which they are held to where they were, relative to other struts'."""


class Bent(NamedTuple):
    """A fit with some struts in halves, before its last stage; see `frametwin.fitting.consistency.Consistent`.

    Attributes
    ----------
    plan : Problem
        With every end of a strut at its joint.
    problem, state, torn
        With a vertex of its own for each torn end.
    halves : Halves
        Struts of all of these that are halves.
    cubic : (K,) array
        Struts of the plan that are known not to be bent, and stay whole.
    """

    plan: Problem
    problem: Problem
    state: State
    torn: Torn
    halves: Halves
    cubic: np.ndarray

    @property
    def loss(self) -> float:
        """By which what is tried is compared."""
        return loss_of(self.problem, self.state)

    def after(self, other: Bent) -> Bent:
        """The same, with the record of what was tried meanwhile."""
        return self._replace(state=replace(self.state, record=other.state.record))


def with_bent_struts(
    plan: Problem, problem: Problem, state: State, torn: Torn, cubic: np.ndarray | None = None
) -> Bent:
    """Halve struts that are bent as no cubic can be, also such as seem to be torn off joints, where it explains more.

    Parameters
    ----------
    plan, problem, state, torn
        As of `Bent`, with every strut whole.
    cubic : (K,) array, optional
        Struts that are known not to be bent so; they are halved only where they seem to be torn off a joint.
    """
    loose = np.unique(torn.ends[:, 0])
    known = np.setdiff1d(np.zeros(0, dtype=np.intp) if cubic is None else cubic, loose)
    whole = Bent(plan, problem, state, torn, Halves.none(plan.frame), known)
    pixels = problem.levels.density * float(np.median(problem.frame.radius))
    if problem.settings.degree <= 3 or pixels < CLEAR:
        return whole
    asking = suspects(problem, state, problem.settings.finish[0], known)
    for chosen in (np.union1d(asking, loose), np.setdiff1d(asking, loose)) if len(loose) else (asking,):
        found = _halved(whole, chosen)
        whole = whole.after(found)
        if len(found.halves.struts):
            found = _with_robbed(whole, _with_those_hidden_before(whole, found, chosen))
            return _with_neighbours(whole, found, chosen)
    return _with_robbed(whole, whole)


def _with_those_hidden_before(whole: Bent, found: Bent, looked_at: np.ndarray) -> Bent:
    """Halve also struts that ask for it only once others are halved."""
    found = found._replace(state=settled(found.problem, found.state))  # others had been drawn for them
    asking = suspects(found.problem, found.state, found.problem.settings.refine[-1], found.cubic)
    more = np.setdiff1d(asking, np.concatenate([looked_at, found.halves.second]))
    return _with(whole, found, more)


def _with_robbed(whole: Bent, found: Bent) -> Bent:
    """Halve also struts that seem to be broken, where they are then whole and that explains more.

    One that bows along a straight one may have left its place to it: that one has then bent to where both are seen.
    """
    white = whiteness_of(found.problem, found.state, found.problem.settings.refine[-1])[: found.halves.planned_struts]
    robbed = np.flatnonzero(_may_be_bent(whole, found) & (white < BROKEN))
    again = _with(whole, found, robbed[np.argsort(-white[robbed], kind="stable")][:ROBBED])
    bent = np.flatnonzero(np.isin(again.halves.struts, robbed))
    both = np.concatenate([again.halves.struts[bent], again.halves.second[bent]])
    there = again.state.pose.opacity[both].mean(axis=1) > BROKEN
    return again if there.all() else found.after(again)  # what is not there can be drawn anywhere


def _with_neighbours(whole: Bent, found: Bent, looked_at: np.ndarray) -> Bent:
    """Halve also struts that end where a halved one does and whose outlines are off, where that explains more.

    A joint that has left its place bends what is straight there, and straightens what is bent.
    """
    problem, halves, edges = found.problem, found.halves, whole.plan.frame.edges
    stage, state = problem.settings.refine[-1], found.state
    off = halves.larger(outline_misfit(drawn(problem, state, stage.pieces), level_of(problem, state, stage)))
    beside = np.isin(edges, edges[halves.struts]).any(axis=1) & (off > NEIGHBOUR * float(np.median(off)))
    return _with(whole, found, np.setdiff1d(np.flatnonzero(beside & _may_be_bent(whole, found)), looked_at))


def _may_be_bent(whole: Bent, found: Bent) -> np.ndarray:
    """(E,) array of bool: struts that are not halved, not too short, and of which at least a part seems to be there."""
    frame, pose = whole.plan.frame, found.state.pose
    count = frame.strut_count
    may = (frame.chord_lengths > SHORTEST * pose.radius[:count]) & pose.opacity[:count].any(axis=1)
    may[found.halves.struts] = False
    may[whole.cubic] = False
    return np.asarray(may)


def _with(whole: Bent, found: Bent, more: np.ndarray) -> Bent:
    """With more struts halved where they need it and that explains more."""
    if not len(more):
        return found
    again = _halved(whole.after(found), np.union1d(found.halves.struts, more))
    return again if len(again.halves.struts) and again.loss < found.loss else found.after(again)


def _halved(whole: Bent, struts: np.ndarray) -> Bent:
    """With those of the struts halved that need it; as it is but for the record where that explains no more."""
    while len(struts):
        found = _tried(whole, replace(whole.halves, struts=struts))
        whole = whole.after(found)
        kept, rise = _needed(found.problem, found.state, found.halves)
        if kept.all():
            least = found.loss + WINS * rise.sum()
            loose = np.isin(whole.torn.ends[:, 0], struts).any()  # which are told apart from bent ones by little
            if (not loose and least < whole.loss) or least < _settled_loss(whole, struts):
                return found._replace(state=untangled(found.problem, found.state, found.halves))
            break
        struts = struts[kept]
    return whole


def _settled_loss(whole: Bent, struts: np.ndarray) -> float:
    """The loss with the struts whole, after the steps that halved ones get."""
    near = Nearby.of(whole.problem, whole.state, struts, AROUND_BENT)
    return loss_of(whole.problem, near.after(whole.state, settled))


def _needed(problem: Problem, state: State, halves: Halves) -> tuple[np.ndarray, np.ndarray]:
    """(H,) array of bool: halved struts that would be far off, and explain less, as cubics; and (H,) how much less."""
    off, rise = _as_cubics(problem, state, halves)
    least = RISE * scale_of(problem, problem.settings.refine[-1])
    radii = off / state.pose.radius[halves.struts]
    exact = state.cameras is None and state.joint_size is None
    sure = 0.0 if exact else SURE * loss_of(problem, state) / problem.frame.strut_count
    return np.asarray((radii > BENT) & (rise > least) & (radii * rise > sure)), rise


def _tried(whole: Bent, halves: Halves) -> Bent:
    """With struts in two halves, those whose ends seemed torn at their joints, and settled."""
    plan, problem, state, torn, _, cubic = whole
    frame = halved_frame(plan.frame, halves)
    softer = np.ones(frame.strut_count)
    softer[halves.both] = SOFTER
    new_plan = replace(plan, stiffness=softer).with_frame(frame)
    still = ~np.isin(torn.ends[:, 0], halves.struts)
    joined, fewer = without_ends(state, torn.planned, still), torn.only(still)
    new_torn = Torn(fewer.ends, fewer.joints, frame.vertex_count)
    new = separated(new_plan, new_torn)
    start = _in_halves(separated(plan, fewer), new, joined, halves)
    tried = Nearby.of(new, start, halves.both, AROUND_BENT).after(start, settled)
    if problem.settings.learn_opacity and (state.pose.opacity[halves.struts] < 1.0).any():
        tried = without_missing(new, tried)
    return Bent(new_plan, new, tried, new_torn, halves, cubic)


def _in_halves(old: Problem, new: Problem, state: State, halves: Halves) -> State:
    """The state of a problem for the one with struts in two halves, which are where they were."""
    planned, count = halves.planned_vertices, len(halves.struts)

    def halved(pose: Pose) -> Pose:
        curves = old.elastic.displaced(old.frame.control_points, pose.joints, pose.inner)
        known = np.concatenate([pose.joints[:planned], np.zeros((count, 6)), pose.joints[planned:]])
        joints, inner = laid_along(new, known, cut(curves, halves), planned + np.arange(count))
        opacity = halves.halved(pose.opacity)
        opacity[halves.both] = 1.0
        return Pose(joints, inner, halves.halved(pose.radius), opacity)

    sizes = state.joint_size
    if sizes is not None:
        sizes = np.concatenate([sizes[:planned], np.ones(count), sizes[planned:]])
    return replace(state, pose=halved(state.pose), anchor=halved(state.anchor), joint_size=sizes, terms=None)


def _as_cubics(problem: Problem, state: State, halves: Halves) -> tuple[np.ndarray, np.ndarray]:
    """What it would cost to draw halved struts as the cubics nearest to them.

    Returns
    -------
    (H,) mm by which the halves are off them, at most, and (H,) rises of the loss.
    """
    stage = problem.settings.refine[-1]
    curves = drawn(problem, state, 1).control_points
    first, second = curves[halves.struts], curves[halves.second]
    cubics = bezier.split(joined_curve(first, second, 3), 0.5)
    terms = terms_of(problem, state, stage)
    rise, off = np.zeros(len(first)), np.zeros(len(first))
    u = np.linspace(0.0, 1.0, SAMPLES)
    for struts, now, then in ((halves.struts, first, cubics[0]), (halves.second, second, cubics[1])):
        moved = then - now
        off = np.maximum(off, np.linalg.norm(bezier.evaluate(moved, u), axis=2).max(axis=1))
        step = moved.reshape(-1, 12)
        rise += np.einsum("ea,ea->e", terms.gradient[struts], step)
        rise += 0.5 * np.einsum("ea,eab,eb->e", step, terms.hessian[struts], step)
    return off, rise
