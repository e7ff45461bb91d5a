"""A fast fit that doubts its views and its cameras before it believes what they show.

First everything is taken as it was given. Where the loss would then fall by much were the cameras free, they are;
a view that disagrees with all others is left out, and the fit made again without it. Nothing of this changes a fit
whose pictures agree with its cameras.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.fitting import gauge
from frametwin.fitting.bent import with_bent_struts
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.fast_stages import (
    camera_gain,
    finish,
    free_stage,
    held_back,
    loss_of,
    noticed,
    recover,
    refine,
    search,
)
from frametwin.fitting.fast_state import Problem, Record, State, crisp_stages, drawn, level_of
from frametwin.fitting.frame_field import moved_curves
from frametwin.fitting.halves import Halves
from frametwin.fitting.held import held_by
from frametwin.fitting.joint_sizes import WORTH, common_size
from frametwin.fitting.known_start import KnownStart
from frametwin.fitting.misplaced import given_second_chance
from frametwin.fitting.torn_ends import Torn, mended, rejoined
from frametwin.fitting.view_misfit import FEWEST, ViewMisfit, disagreeing, view_misfit

CLEARLY = 0.3
"""Share by which freeing the cameras would lower the loss after the first free steps, at which they are freed at once:
the frame has been bent to explain them, and the fit begins anew."""

NOTHING_AGREES = 0.2
"""Misfit of the typical view after the first free steps from which the frame is too far off for the gain to tell."""

SLIGHTLY = 0.05
"""The same in sharper pictures, at which they are freed where the frame is. Exact cameras stay below 0.02, a
hundredth of a degree is at 0.14 and more."""

ROUNDS = 3
"""Times that views are left out, at most."""

LARGER = 1.2
"""How many times larger pictures have to be for a whole stage, if it is not the last."""

SOON = 2
"""Steps of a stage that the last one repeats. After one alone a strut may seem to be bent that is not."""

TRIALS = 2
"""Times that the last free stage is gone through before joints with material of their own are judged among stubs."""

TOGETHER = 10.0
"""How many times more than by chance all cameras must have moved together for the feet to be where they were planned,
before the cameras are believed instead."""

BY_CHANCE = 0.02
"""Least squared correction a freedom, in variances, that counts as chance."""


@dataclass(frozen=True, eq=False)
class Consistent:
    """A fit, and what was made of its views.

    Attributes
    ----------
    problem : Problem
        With the views that were used.
    state : State
    used : (N,) array of bool
    misfit : ViewMisfit
        Of all views.
    torn : Torn
        Ends of struts that hang free; problem and state have a vertex of its own for each.
    halves : Halves
        Struts that were fitted as two; problem and state have both halves of each.
    holds : str
        What holds the world: ``rig`` where the cameras were taken as exact, else ``feet`` or ``cameras``.
    """

    problem: Problem
    state: State
    used: np.ndarray
    misfit: ViewMisfit
    torn: Torn
    halves: Halves
    holds: str


def consistent_fit(problem: Problem, known: KnownStart | None) -> Consistent:
    """Fit a frame, its views and its cameras; from a known start the coarse stages are left out."""
    record = Record()  # whose clock runs from here on
    used = np.arange(problem.levels.view_count)
    for _ in range(ROUNDS):
        part = problem if len(used) == problem.levels.view_count else problem.of_views(used)
        state = _begun(part, State.planned(part, record), None if known is None else known.of_views(used))
        misfit = _misfit(part, state, problem.settings.refine[-1])
        wrong = disagreeing(misfit.total)
        if not problem.settings.leave_out_views or not wrong.size or len(used) - len(wrong) < FEWEST:
            break
        record, used = state.record, np.delete(used, wrong)
    cubic = None if known is None else known.cubic
    part, state, torn, halves = _finished(part, recover(part, state), cubic)
    holds = "rig"
    if state.cameras is not None:
        state, holds = _held(part, state)
    whole = state if state.cameras is None else replace(state, cameras=_spread(state.cameras, used, problem))
    every = replace(part, levels=problem.levels, covariances=problem.covariances)
    misfit = _misfit(every, whole, problem.settings.finish[0])
    mask = np.zeros(problem.levels.view_count, dtype=bool)
    mask[used] = True
    return Consistent(part, state, mask, misfit, torn, halves, holds)


def _spread(cameras: np.ndarray, used: np.ndarray, problem: Problem) -> np.ndarray:
    result = problem.exact_cameras()
    result[used] = cameras
    return result


def _begun(problem: Problem, state: State, known: KnownStart | None) -> State:
    """From the plan or a start to where every joint and strut is free; with cameras where the pictures ask for it."""
    first = state.lapped("set-up")
    state = search(problem, first) if known is None else refine(problem, _started(problem, first, known))
    if state.joint_size is None:
        state = _with_joint_material(problem, state)
    if state.cameras is not None:
        return held_by(problem, state, "feet").anchored()
    if problem.settings.cameras == "exact" or not _asks_for_cameras(problem, state):
        return state
    afresh = replace(first, record=state.record, cameras=problem.exact_cameras(), joint_size=state.joint_size)
    state = search(problem, afresh)
    if state.joint_size is None:  # what cameras explained before may have hidden it
        state = _with_joint_material(problem, state)
    return held_by(problem, state, "feet").anchored()


def _asks_for_cameras(problem: Problem, state: State) -> bool:
    """Whether so much would be won by free cameras, or so little agrees, that the fit has to begin anew with them."""
    stage = problem.settings.refine[-1]
    astray = float(np.median(_misfit(problem, state, stage).total)) > NOTHING_AGREES
    return astray or camera_gain(problem, state, stage) > CLEARLY


def _started(problem: Problem, state: State, known: KnownStart) -> State:
    """The plan as a field moves it, with what is known of cameras and joints."""
    moved = moved_curves(problem.frame, known.field) - problem.frame.control_points
    joints, inner = problem.elastic.freedoms_of(moved)
    cameras = None if problem.settings.cameras == "exact" else known.cameras
    pose = state.pose.moved(joints, inner)
    return replace(state, pose=pose, cameras=cameras, joint_size=known.joint_size).anchored()


def _with_joint_material(problem: Problem, state: State) -> State:
    """Joints get material of their own where the pictures show more than the struts' ends, and the fit goes on."""
    if problem.stubs.any():
        return _with_material_for_stubs(problem, state)
    stage = problem.settings.refine[-1]
    size = common_size(drawn(problem, state, stage.pieces), level_of(problem, state, stage))
    if size == 1.0:
        return state
    return refine(problem, replace(state, joint_size=np.full(problem.elastic.vertex_count, size)))


def _with_material_for_stubs(problem: Problem, state: State) -> State:
    """The same of a frame with stubs, which may have been made long and thick by what their joints show.

    They are as thick as the others at first, and what that is worth shows only when they have gone back to their place.
    """
    stage = problem.settings.refine[-1]
    pose = state.pose.evened(problem.frame.radius, problem.stubs).straightened(problem.stubs)
    even = replace(state, pose=pose, anchor=state.anchor.straightened(problem.stubs))
    size = common_size(drawn(problem, even, stage.pieces), level_of(problem, even, stage))
    if size == 1.0:
        return state
    tried = replace(even, joint_size=np.full(problem.elastic.vertex_count, size))
    for _ in range(TRIALS):
        tried = free_stage(problem, tried, stage)
    if loss_of(problem, tried) < (1.0 - WORTH) * loss_of(problem, state):
        return tried.lapped("refine")
    return replace(state, record=tried.record).lapped("refine")


def _finished(plan: Problem, state: State, cubic: np.ndarray | None) -> tuple[Problem, State, Torn, Halves]:
    """The last stages; torn ends, bent struts and cameras that are not exact to the last digit are freed on the way.

    Struts of which it is known that they are ``cubic`` (K,) are not looked at for bends.
    """
    problem, state, torn = given_second_chance(plan, *mended(plan, state))
    state, halves = noticed(problem, state), Halves.none(plan.frame)
    *sharp, sharpest = problem.settings.finish
    for stage in sharp:
        exact = state.cameras is None
        state = _sharpened(problem, state, _shortened(problem, stage))
        if exact and state.cameras is not None:  # what seemed broken before may have been off by its cameras alone
            problem, state, torn = given_second_chance(plan, problem, state, torn)
        problem, state, torn = rejoined(plan, problem, state, torn, stage)
    if sharp:
        plan, problem, state, torn, halves, _ = with_bent_struts(plan, problem, state, torn, cubic)
        if len(halves.struts):
            state = _sharpened(problem, state, sharp[-1])
    crisp = _crisp_stages(problem, state)
    last = replace(sharpest, iterations=1) if crisp and not len(halves.struts) else sharpest
    state = finish(problem, state, last) if sharp else _sharpened(problem, state, last)
    return problem, _crisped(problem, state, crisp).lapped("finish"), torn, halves


def _crisp_stages(problem: Problem, state: State) -> tuple[Stage, ...]:
    """Those that are gone through after the last stage: none where cameras or joints are not known so closely."""
    if state.joint_size is not None or not problem.levels.black_and_white:
        return ()
    return crisp_stages(problem.settings, problem.levels)


def _crisped(problem: Problem, state: State, stages: tuple[Stage, ...]) -> State:
    """After stages in pictures of black and white; errors are still told by the terms of those before."""
    terms = state.terms
    for stage in stages:
        held, own = held_back(problem, state, stage)
        state = free_stage(held, state, own)
    return replace(state, terms=terms)


def _shortened(problem: Problem, stage: Stage) -> Stage:
    """The stage in one step where its pictures are hardly larger than those before, and in `SOON` where the last ones
    are hardly larger than they: another one follows."""
    before, after = problem.settings.refine[-1].detail, problem.settings.finish[-1].detail
    small, now, large = (problem.levels.pixels_per_mm(detail) for detail in (before, stage.detail, after))
    if now <= LARGER * small:
        return replace(stage, iterations=1)
    return replace(stage, iterations=min(SOON, stage.iterations)) if large <= LARGER * now else stage


def _sharpened(problem: Problem, state: State, stage: Stage) -> State:
    """After one of the last stages, and cameras freed where that asks for it."""
    state = finish(problem, state, stage)
    return _freed(problem, state, stage) if state.cameras is None and problem.settings.cameras == "auto" else state


def _freed(problem: Problem, state: State, stage: Stage) -> State:
    """The state with cameras that moved to where the loss is lowest, if it is much lower there."""
    if camera_gain(problem, state, stage) < SLIGHTLY:
        return state
    state = replace(state, cameras=problem.exact_cameras())
    for _ in range(2):
        state = held_by(problem, free_stage(problem, state, stage), "feet").anchored()
    return state


def _held(problem: Problem, state: State) -> tuple[State, str]:
    """The world as it is most probably held, and by what."""
    wanted, covariances = problem.settings.hold, problem.covariances
    if wanted != "auto":
        return held_by(problem, state, wanted), wanted
    on_feet, on_cameras = held_by(problem, state, "feet"), held_by(problem, state, "cameras")
    if not problem.frame.grounded.any():
        return on_cameras, "cameras"
    alone = gauge.rig_misfit(on_cameras.freedoms, covariances)
    together = gauge.rig_misfit(on_feet.freedoms, covariances) - alone
    chance = max(alone / (on_feet.freedoms.size - 6), BY_CHANCE)
    return (on_cameras, "cameras") if together / 6.0 > TOGETHER * chance else (on_feet, "feet")


def _misfit(problem: Problem, state: State, stage: Stage) -> ViewMisfit:
    return view_misfit(drawn(problem, state, stage.pieces), level_of(problem, state, stage))
