"""Joints and struts that have settled in a wrong place, and are given a second chance.

In a print that sags by a sixth of its size or more, a joint may settle on what other struts show. The struts that end
there pull at it in vain; one or two are then taken for torn, others for broken. Both are clues: the end of a strut that
was taken for torn lies where the joint should be, and a strut of which a part seems to be missing may have been bent
away from its place. What is tried stays only where the pictures are explained better.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frametwin.fitting.fast_stages import free_stage, loss_of, until_settled, whiteness_of, without_missing
from frametwin.fitting.fast_state import Problem, State, drawn, level_of
from frametwin.fitting.nearby import Nearby
from frametwin.fitting.torn_ends import Torn, separated, struts_at, without_ends
from frametwin.raster import rods
from frametwin.raster.rods import Rods

STEPS = 3
"""Steps of each stage of a trial, at most."""

ROUNDS, GAIN = 12, 0.01
"""Times that everything is tried, at most, and share by which the loss has to fall for another time."""

SINGLY = 20
"""Joints, and struts, that are tried one by one in each round, at most."""

MOST = 64
"""Struts for which other shapes are looked at, at most."""

BROKEN = 0.9
"""Share of a strut's pixels that are white, below which it is tried again."""

WHITER = 0.1
"""By how much more of struts has to be white in another place ..."""

CLEARLY, ON_PHOTOGRAPHS = 0.5, 0.75
"""... and what share at least, in masks and in photographs: there, struts in shade seem to be broken where they are."""

DIRECTIONS, BOWS = 24, np.arange(0.8, 10.0, 0.8)
"""Directions across a strut in which it is bowed, and by how many radii at its middle."""


def given_second_chance(plan: Problem, problem: Problem, state: State, torn: Torn) -> tuple[Problem, State, Torn]:
    """Try joints with torn ends and struts that seem to be broken again, as long as that explains more.

    Parameters
    ----------
    plan : Problem
        With every strut at its joints.
    problem, state, torn
        With a vertex of its own for each torn end.
    """
    loss = loss_of(problem, state)
    for _ in range(ROUNDS):
        before = loss
        state = _struts_bowed(problem, state)
        problem, state, torn = _joints_moved(plan, problem, state, torn)
        loss = loss_of(problem, state)
        if loss > (1.0 - GAIN) * before:
            break
    return problem, state.lapped("second chance"), torn


def _joints_moved(plan: Problem, problem: Problem, state: State, torn: Torn) -> tuple[Problem, State, Torn]:
    """Move joints to the ends that were taken for torn off them, or those ends back, where that explains more."""
    apart = np.linalg.norm(state.pose.joints[torn.planned :, :3] - state.pose.joints[torn.joints, :3], axis=1)
    furthest = torn.joints[np.argsort(-apart, kind="stable")]
    joints = list(dict.fromkeys(furthest.tolist()))[:SINGLY]
    for joint in joints:
        fewer = torn.only(torn.joints != joint)
        trial = separated(plan, fewer)
        here = struts_at(plan, np.array([joint]))
        near = Nearby.of(problem, state, np.flatnonzero(here))
        state = near.after(state, settled)  # as all that is tried will be
        before = loss_near(near, state)
        for to_ends in (True, False):
            start = _straightened(_joined(state, torn, joint, to_ends), here)
            there = near.in_frame(trial, start)
            tried = there.after(start, settled)
            state = replace(state, record=tried.record)
            if loss_near(there, tried) < before:
                problem, state, torn = trial, there.after(tried, _settled_for_good), fewer
                break
    return problem, state, torn


def _struts_bowed(problem: Problem, state: State) -> State:
    """Bow struts that seem to be broken to where the pictures are white and nothing else is drawn.

    They stay there where the whole explains more: all together, else one by one.
    """
    struts, shapes = _promising(problem, state)
    together = [np.arange(len(struts))] if len(struts) else []
    for chosen in together + [np.array([i]) for i in range(min(len(struts), SINGLY))]:
        near = Nearby.of(problem, state, struts[chosen])
        tried = near.after(_shaped(problem, state, struts[chosen], shapes[chosen]), _settled_and_judged)
        state = replace(state, record=tried.record)
        if loss_near(near, tried) < loss_near(near, state):
            state = near.after(_absent_as_before(tried, state), _settled_for_good)
            if len(chosen) == len(struts):
                break
    return state


def _absent_as_before(state: State, before: State) -> State:
    """The state with struts that are not there at all in the shapes that they had."""
    absent = (state.pose.opacity.mean(axis=1) < 1.0 - BROKEN)[:, None]
    pose, anchor = (
        replace(own, inner=np.where(absent, old.inner, own.inner))
        for own, old in ((state.pose, before.pose), (state.anchor, before.anchor))
    )
    return replace(state, pose=pose, anchor=anchor)


def _promising(problem: Problem, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Struts (N,) of which a part seems to be missing, and shapes (N, 4, 3) in which they would be whiter."""
    stage = problem.settings.refine[-1]
    now = drawn(problem, state, stage.pieces)
    white = whiteness_of(problem, state, stage)
    struts = np.argsort(white, kind="stable")
    struts = struts[((white < BROKEN) & ~problem.stubs)[struts]][:MOST]
    if not len(struts):
        return struts, np.zeros((0, 4, 3))
    shapes = shapes_to_try(now.control_points[struts], state.pose.radius[struts])
    seen, there = _seen_in(problem, state, struts, shapes)
    best = (seen * (2.0 * there - 1.0)).argmax(axis=1)
    rows = np.arange(len(struts))
    least = ON_PHOTOGRAPHS if problem.settings.outline_error > 0.0 else CLEARLY
    whiter = there[rows, best] > np.maximum(white[struts] + WHITER, least)
    return struts[whiter], shapes[rows, best][whiter]


def _seen_in(problem: Problem, state: State, struts: np.ndarray, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the pictures show where struts (N,) would be in other shapes (N, C, 4, 3), were they alone absent now.

    Returns
    -------
    (N, C) pixels that would be in plain view, and (N, C) how white these are, 0..1.
    """
    stage = problem.settings.refine[-1]
    now, level = drawn(problem, state, stage.pieces), level_of(problem, state, stage)
    absent = np.zeros((len(now.edges), 1), dtype=bool)
    absent[struts] = True
    through = rods.transmittance(replace(now, opacity=np.where(absent, 0.0, now.opacity)), level)
    count = shapes.shape[1]
    radius, edges = (np.repeat(one[struts], count, axis=0) for one in (now.radius, now.edges))
    tries = Rods(shapes.reshape(-1, 4, 3), now.joints, edges, radius, np.zeros_like(radius))
    residual = np.float32(1.0) - through - level.target
    weight, slope = np.moveaxis(rods.opacity_terms(tries, level, through, residual), 2, 0)
    there = np.clip(-slope / np.maximum(weight, 1e-12), 0.0, 1.0)
    seen = weight.sum(axis=1)
    white = (weight * there).sum(axis=1) / np.maximum(seen, 1e-12)
    return seen.reshape(-1, count), white.reshape(-1, count)


def _shaped(problem: Problem, state: State, struts: np.ndarray, shapes: np.ndarray) -> State:
    """The state with struts (N,) whole, in shapes (N, 4, 3) between the ends that they have."""
    present = drawn(problem, state, 1).control_points[struts]
    inner, bent, opacity = state.pose.inner.copy(), state.anchor.inner.copy(), state.pose.opacity.copy()
    inner[struts] += (shapes - present)[:, 1:3].reshape(-1, 6)
    bent[struts] = inner[struts]
    opacity[struts] = 1.0
    pose = replace(state.pose, inner=inner, opacity=opacity)
    return replace(state, pose=pose, anchor=replace(state.anchor, inner=bent), terms=None)


def shapes_to_try(control_points: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(N, C, 4, 3) struts between the same ends (N, 4, 3): straight, and bowed to all sides by many radii (N,)."""
    start, chord = control_points[:, 0], control_points[:, 3] - control_points[:, 0]
    tangent = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-9)
    helper = np.eye(3)[np.abs(tangent).argmin(axis=1)]
    across = np.cross(tangent, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beside = np.cross(tangent, across)
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    unit = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * beside[:, None]
    far = BOWS[:, None, None] * radius[:, None, None, None] * unit[:, None]
    bow = np.concatenate([np.zeros((len(radius), 1, 3)), far.reshape(len(radius), -1, 3)], axis=1)
    ends = np.stack([start, start + chord / 3.0, start + 2.0 * chord / 3.0, start + chord], axis=1)
    shapes = np.repeat(ends[:, None], bow.shape[1], axis=1)
    shapes[:, :, 1:3] += 4.0 / 3.0 * bow[:, :, None]
    return shapes


def _straightened(state: State, struts: np.ndarray) -> State:
    """The state with some struts (E,) whole again, and bent by their joints alone."""
    opacity = np.where(struts[:, None], 1.0, state.pose.opacity)
    pose = replace(state.pose.straightened(struts), opacity=opacity)
    return replace(state, pose=pose, anchor=state.anchor.straightened(struts), terms=None)


def _joined(state: State, torn: Torn, joint: int, to_ends: bool) -> State:
    """The state with all ends that were torn off a joint back there; the joint at the furthest of them, if wanted."""
    here = np.flatnonzero(torn.joints == joint)
    ends = state.pose.joints[torn.planned + here]
    far = np.linalg.norm(ends[:, :3] - state.pose.joints[joint, :3], axis=1)
    pose, anchor = (replace(one, joints=one.joints.copy()) for one in (state.pose, state.anchor))
    shift = ends[np.argmax(far), :3] - pose.joints[joint, :3] if to_ends else np.zeros(3)
    pose.joints[joint, :3] += shift
    anchor.joints[joint, :3] += shift
    return without_ends(replace(state, pose=pose, anchor=anchor), torn.planned, torn.joints != joint)


def _settled_for_good(problem: Problem, state: State) -> State:
    """After as many steps as lower the loss: what has been put elsewhere is seldom near its place yet."""
    return until_settled(problem, state, problem.settings.refine[-1])


def loss_near(near: Nearby, state: State) -> float:
    """As `loss_of`, of a few struts."""
    return loss_of(near.part, near.taken(state))


def _settled_and_judged(problem: Problem, state: State) -> State:
    """As `settled`, without what is then seen to be missing."""
    state = settled(problem, state)
    return without_missing(problem, state) if problem.settings.learn_opacity else state


def settled(problem: Problem, state: State) -> State:
    """After a few steps of the last two stages in which every joint and strut is free, as all that is tried gets."""
    for stage in problem.settings.refine[-2:]:
        state = free_stage(problem, state, replace(stage, iterations=min(stage.iterations, STEPS)))
    return state
