"""Stages of the fast fit: each takes a state and gives the next one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from frametwin.fitting import camera_steps, presence
from frametwin.fitting.fast_settings import CoarseStage, Stage
from frametwin.fitting.fast_state import Problem, State, drawn, level_of, stepped, terms_of, view_terms_of
from frametwin.fitting.held import held_by
from frametwin.fitting.joint_sizes import learn_joint_sizes
from frametwin.fitting.loads import load_answers, rigid_motions, smooth_warps
from frametwin.fitting.motion import Pose, free_step, smooth_descent, strain
from frametwin.fitting.nearby import Nearby
from frametwin.geometry import bezier
from frametwin.raster import rods
from frametwin.raster.rods import Terms

SIGNIFICANT = 3.0
"""How many times more than by chance free cameras must lower the loss to be asked for."""

STRAINED = 0.2
"""Elastic energy of the pull, as a share of the loss, from which it holds the frame back. Prints that sag by 7 % of
their size have 0.03 to 0.17, by 15 and 25 % 0.29 to 0.39."""

LOOSE = 0.03
"""What is left of pull and drag then; with all of it, joints would creep along their struts for many rounds."""

SETTLED, LETTING_GO = 0.03, 10
"""Share by which the loss has to fall for another round, and the most rounds."""

NEAR = 0.15
"""Pixels below which a step is not worth another one where sharper pictures follow."""

NEAR_LAST = 0.1
"""The same in the last stages: pictures that are hardly sharper than those before leave little to do."""

BOWED_AT = np.linspace(0.0, 1.0, 9)[1:-1]
"""Parameters at which it is asked how far a step bows a strut."""

WEAK = 1e-4
"""What is left of the weight of a strut that is astray, while its neighbours place it."""


def search(problem: Problem, state: State) -> State:
    """The frame's own motions first; where they leave struts astray, also motions that ask nothing of the frame.

    The better of the two stays.
    """
    frame, elastic, settings = problem.frame, problem.elastic, problem.settings
    rigid, answers = rigid_motions(frame.vertices), load_answers(elastic, settings.cells)
    own = _attempt(problem, state, np.concatenate([rigid, answers], axis=1), pull=1.0)
    if _share_astray(problem, own) <= settings.troubled:
        return own
    warps = smooth_warps(elastic, settings.cells)
    afresh = replace(state, record=own.record)
    any_way = _attempt(problem, afresh, np.concatenate([rigid, warps, answers], axis=1), pull=0.0)
    better = min((own, any_way), key=lambda found: found.last_terms.loss)
    return replace(better, record=any_way.record)


def _share_astray(problem: Problem, state: State) -> float:
    """Share of the struts that are astray; stubs do not count."""
    lost = astray(problem, state, problem.settings.refine[-1])
    return float(lost.sum() / max(1, np.count_nonzero(~problem.stubs)))


def _attempt(problem: Problem, state: State, motions: np.ndarray, pull: float) -> State:
    """Smooth motions (6V, M), their elastic energy weighted with ``pull``, and then every joint and strut."""
    state = smooth_stages(problem, state, motions, pull)
    if state.cameras is not None:
        state = held_by(problem, state, "feet")
    return refine(problem, state.anchored().lapped("coarse"))


def smooth_stages(problem: Problem, state: State, motions: np.ndarray, pull: float) -> State:
    """All coarse stages, in the span of ``motions`` (6V, M), their elastic energy weighted with ``pull`` more."""
    for stage in problem.settings.coarse:
        stage = replace(stage, pull=pull * stage.pull)
        if state.cameras is not None:
            state = _smooth_stage_with_cameras(problem, state, motions, stage)
            continue
        level, longest = problem.level(stage), stage.longest / problem.levels.pixels_per_mm(stage.detail)
        for pose, loss in smooth_descent(problem.elastic, motions, state.pose, level, stage, longest):
            state = stepped(problem, replace(state, pose=pose), "smooth motion", loss, level)
    return state


def _smooth_stage_with_cameras(problem: Problem, state: State, motions: np.ndarray, stage: CoarseStage) -> State:
    level, longest = problem.level(stage), stage.longest / problem.levels.pixels_per_mm(stage.detail)
    views = (level, problem.scales(level))
    start = (state.pose, state.freedoms)
    for pose, cameras, loss in camera_steps.smooth_descent(
        problem.elastic, motions, start, problem.prior, views, stage, longest
    ):
        state = stepped(problem, replace(state, pose=pose, cameras=cameras), "smooth motion and cameras", loss, level)
    return state


def refine(problem: Problem, state: State) -> State:
    """The stages with every joint and strut free."""
    for stage in problem.settings.refine:
        state = free_stage(problem, state, stage, near=NEAR)
    return _let_go(problem, state).lapped("refine")


def _let_go(problem: Problem, state: State) -> State:
    """Go on from where the frame is, wherever the pull to its smooth motions holds it back.

    A print that sags by a quarter of its size bends where no smooth motion does. Held back there, its struts would be
    taken for torn off their joints.
    """
    state = noticed(problem, state)
    if not state.strained:
        return state
    stage = loosened(problem.settings.refine[-1])
    return until_settled(problem, state, stage, state.last_terms.loss, anchoring=True).anchored()


def until_settled(
    problem: Problem, state: State, stage: Stage, before: float = np.inf, anchoring: bool = False
) -> State:
    """A stage again and again, until it lowers the loss no more; anchored anew each time if wanted.

    The last one is gone through twice at least: by it what is there of each strut is judged.
    """
    soon = stage.detail < problem.settings.finish[-1].detail
    for _ in range(LETTING_GO):
        state = free_stage(problem, state.anchored() if anchoring else state, stage)
        settled = state.last_terms.loss > (1.0 - SETTLED) * before
        if settled or (soon and _slow(state.record.loss, stage.iterations)):
            break
        before = state.last_terms.loss
    return state


def _slow(loss: Sequence[float], steps: int) -> bool:
    """Whether a round of so many steps like the last one would not lower the loss by half of what is asked."""
    return steps > 1 and 2 * steps * (loss[-2] - loss[-1]) < SETTLED * loss[-1]


def loosened(stage: Stage) -> Stage:
    """The stage with next to nothing of its pull and drag."""
    return replace(stage, pull=LOOSE * stage.pull, drag=LOOSE * stage.drag)


def noticed(problem: Problem, state: State) -> State:
    """The state, and whether it is held back by the pull to the frame's smooth motions."""
    stage = problem.settings.refine[-1]
    whole = _whole(state).astype(np.float64)  # what is not there is bent by nothing
    energy = stage.pull * strain(problem.elastic.stiffened(whole), state.pose, state.anchor)
    loss = loss_of(problem, state) if state.terms is None else state.terms.loss
    return replace(state, strained=state.strained or energy >= STRAINED * loss)


def loss_of(problem: Problem, state: State) -> float:
    """Half the sum of squared residuals by which what is tried is compared."""
    stage = problem.settings.refine[-1]
    return rods.squared_loss(drawn(problem, state, stage.pieces), level_of(problem, state, stage))


def _whole(state: State) -> np.ndarray:
    """(E,) array of bool: struts of which nothing is missing."""
    return np.asarray(state.pose.opacity.mean(axis=1) == 1.0)


def finish(problem: Problem, state: State, stage: Stage) -> State:
    """One of the last stages; until it settles where a print is strained or its joints have sizes of their own."""
    problem, stage = held_back(problem, state, stage)
    slow = state.strained or state.joint_size is not None or state.cameras is not None
    return until_settled(problem, state, stage) if slow else free_stage(problem, state, stage, near=NEAR_LAST)


def held_back(problem: Problem, state: State, stage: Stage) -> tuple[Problem, Stage]:
    """The problem and one of its last stages as they hold the frame back.

    A strained print is not held back any more, but for struts of which a part is missing: by what little is seen of
    them they would be bent at will.
    """
    if not state.strained:
        return problem, stage
    held = problem.elastic.stiffened(np.where(_whole(state), 1.0, 1.0 / LOOSE))
    return replace(problem, elastic=held), loosened(stage)


def free_stage(
    problem: Problem, state: State, stage: Stage, lost: np.ndarray | None = None, near: float = 0.0
) -> State:
    """Gauss-Newton steps of every joint and strut.

    Parameters
    ----------
    problem, state, stage
        What is fitted, from where, and how.
    lost : (E,) array of bool, optional
        Struts that are astray and shall go where their neighbours take them.
    near : float, pixels
        The stage ends when nearly all joints move by less.
    """
    level, density = problem.level(stage), problem.levels.pixels_per_mm(stage.detail)
    hidden = None if state.joint_size is None else problem.stubs  # behind the material of their joints
    for _ in range(stage.iterations):
        terms, joints, inner, cameras = _free_step(problem, state, stage, lost)
        furthest = _furthest(joints, problem.resting) * density
        share = stage.share * min(1.0, stage.longest / max(furthest, 1e-12))
        joints, inner = share * joints, share * inner
        if stage.longest_bow is not None:
            inner = not_bowed_far(problem, joints, inner, stage.longest_bow / density)
        pose = state.pose.moved(joints, inner)
        if problem.settings.learn_thickness and stage.detail > 1.0:
            pose = presence.learn_thickness(pose, problem.frame.radius, terms.widths, hidden)
        moved = None if state.cameras is None else state.cameras + share * cameras
        sizes = _joint_sizes(problem, state, pose, terms, stage) if stage.detail > 1.0 else state.joint_size
        state = replace(state, pose=pose, terms=terms, cameras=moved, joint_size=sizes)
        state = stepped(problem, state, "joints and struts", terms.loss, level)
        if furthest < near:
            break
    return state


def not_bowed_far(problem: Problem, joints: np.ndarray, inner: np.ndarray, longest: float) -> np.ndarray:
    """What of a step (V, 6), (E, 6) is left of the latter when no strut is bowed by more than so many mm.

    A strut that others hide is seen by little but pixels at the foot of an edge. To turn one of them, a step would bow
    the strut by many radii; in others it was hardly seen to bow at all.
    """
    plan = problem.frame.control_points
    step = problem.elastic.displaced(plan, joints, inner) - plan
    bow = step - bezier.straight(step[:, 0], step[:, 3])
    chord = plan[:, 3] - plan[:, 0]
    tangent = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-12)
    bow -= np.einsum("eij,ej->ei", bow, tangent)[..., None] * tangent[:, None]  # which no picture shows
    far = np.linalg.norm(bezier.evaluate(bow, BOWED_AT), axis=2).max(axis=1)
    too_much = np.maximum(0.0, far - longest) / np.maximum(far, 1e-12)
    return np.asarray(inner - (too_much[:, None, None] * bow[:, 1:3]).reshape(-1, 6))


def _furthest(joints: np.ndarray, resting: int) -> float:
    """mm by which 99 % of all joints move at most, some of which rest, in a step (V, 6) of the others."""
    return float(np.percentile(np.pad(np.linalg.norm(joints[:, :3], axis=1), (0, resting)), 99))


def _joint_sizes(problem: Problem, state: State, pose: Pose, terms: Terms, stage: Stage) -> np.ndarray | None:
    """Sizes by which joints become as large as the terms of a state ask for, when struts are as thick as in a pose."""
    if state.joint_size is None:
        return None
    seen = drawn(problem, state, stage.pieces)
    thicker = replace(seen, radius=np.repeat(pose.radius[:, None], stage.pieces, axis=1))
    return learn_joint_sizes(state.joint_size, seen.joint_radius(), thicker.joint_radius(), terms.joint_widths)


def _free_step(
    problem: Problem, state: State, stage: Stage, lost: np.ndarray | None
) -> tuple[Terms, np.ndarray, np.ndarray, np.ndarray | float]:
    """The terms, and the step of joints (V, 6), struts (E, 6) and cameras (N, 10), which stay while struts are lost."""
    if state.cameras is None or lost is not None:
        terms = terms_of(problem, state, stage)
        heard = terms if lost is None else _without(terms, problem.frame.edges, lost)
        return terms, *free_step(problem.elastic, heard, state.pose, state.anchor, stage.pull, stage.drag), 0.0
    terms, system = camera_system(problem, state, stage)
    return terms, *camera_steps.whole_step(problem.elastic, system)


def camera_system(problem: Problem, state: State, stage: Stage) -> tuple[Terms, camera_steps.Reduced]:
    """The terms of all views together, and what is left for the cameras once the frame is eliminated."""
    by_view, cameras = view_terms_of(problem, state, stage)
    terms = by_view.summed()
    known = (state.freedoms, problem.prior)
    weights = (stage.pull, stage.drag)
    return terms, camera_steps.reduced_system(
        problem.elastic, terms, cameras, (state.pose, state.anchor), known, weights
    )


def camera_gain(problem: Problem, state: State, stage: Stage) -> float:
    """By what share the loss would fall, to second order, were the cameras free within the rig's errors.

    0 where it is no more than so many freedoms gain by chance: few pixels are explained better by anything.
    """
    asked = state if state.cameras is not None else replace(state, cameras=problem.exact_cameras())
    terms, system = camera_system(problem, asked, stage)
    gain = camera_steps.gain_of_cameras(system)
    by_chance = 0.5 * problem.noise**2 * len(system.slope)
    return gain / max(terms.loss, 1e-12) if gain > SIGNIFICANT * by_chance else 0.0


def recover(problem: Problem, state: State) -> State:
    """Give struts that lie on black another chance, then take what is still not there as missing."""
    stage, settings = problem.settings.refine[-1], problem.settings
    lost = astray(problem, state, stage)
    if lost.any():
        near = Nearby.of(problem, state, np.flatnonzero(lost))
        state = near.after(state, partial(_put_back, lost=lost[near.struts]))
    if settings.learn_opacity:
        state = _without_missing_stubs(problem, without_missing(problem, state))
    return state.lapped("recover")


def _put_back(problem: Problem, state: State, lost: np.ndarray) -> State:
    """The state with lost struts (E,) where their neighbours expect them, and fitted from there."""
    state = free_stage(problem, state, replace(problem.settings.refine[-1], iterations=2, drag=0.0), lost)
    for again in problem.settings.recover:
        state = free_stage(problem, state, again)
    return state


def without_missing(problem: Problem, state: State) -> State:
    """The state with what is there of each strut as the pictures show it now; stubs as they are."""
    frame, stage = problem.frame, problem.settings.refine[-1]
    now = drawn(problem, state, stage.pieces)
    opacity, _ = presence.believed_opacity(now, level_of(problem, state, stage))
    shortest = presence.shortest_gap(frame.chord_lengths, frame.radius, stage.pieces)
    there = presence.without_gaps(opacity, problem.settings.absent, shortest)
    there[problem.stubs] = now.opacity[problem.stubs]
    return replace(state, pose=replace(state.pose, opacity=there))


def _without_missing_stubs(problem: Problem, state: State) -> State:
    """The state with stubs there or not as the sharpest pictures show each of them as a whole.

    In others one sees hardly more of them than the soft rims of their joints, dark where they are not yet in their
    place. Were they left out for it, nothing would hold the joints above to the feet.
    """
    if not problem.stubs.any():
        return state
    white = whiteness_of(problem, state, problem.settings.finish[-1])
    gone = problem.stubs & (white < problem.settings.absent)
    return replace(state, pose=replace(state.pose, opacity=np.where(gone[:, None], 0.0, state.pose.opacity)))


def astray(problem: Problem, state: State, stage: Stage) -> np.ndarray:
    """(E,) array of bool: struts of whose pixels too few are white; no stubs, of which these tell too little."""
    return (whiteness_of(problem, state, stage) < problem.settings.suspicious) & ~problem.stubs


def whiteness_of(problem: Problem, state: State, stage: Stage) -> np.ndarray:
    """(E,) share of each strut's pixels that are white in the pictures of a stage."""
    return presence.strut_whiteness(drawn(problem, state, stage.pieces), level_of(problem, state, stage))


def _without(terms: Terms, edges: np.ndarray, lost: np.ndarray) -> Terms:
    """The terms with next to nothing from struts that are astray and from joints that only they reach."""
    weight = np.where(lost, WEAK, 1.0)
    joint_weight = np.full(len(terms.joint_gradient), WEAK)
    np.maximum.at(joint_weight, edges, np.repeat(weight[:, None], 2, axis=1))
    return replace(
        terms,
        hessian=terms.hessian * weight[:, None, None],
        gradient=terms.gradient * weight[:, None],
        joint_hessian=terms.joint_hessian * joint_weight[:, None, None],
        joint_gradient=terms.joint_gradient * joint_weight[:, None],
    )
