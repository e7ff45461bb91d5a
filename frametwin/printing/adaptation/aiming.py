"""Aiming what is still to be laid so that the finished print comes to lie where the design has it.

The rest of the print is computed with what is known of its material (`material_fit`), from where it stands, and joints
that are still to come are moved against what they will drift, until they end at the design. Their struts are bent
against what they will droop. The forecast is made anew after every twin, so that what it misses is made up for later
(receding horizon; J. Rawlings, D. Mayne, M. Diehl, "Model predictive control", 2nd ed., 2017, ch. 1).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.material_fit import MaterialFit
from frametwin.printing.process.creep import PrintState

MOST_STEPS = 24
"""Into which the rest of a print is divided; batches further on are computed together."""

NEAR_STEPS = 6
"""Batches that are computed one by one all the same."""

ROUNDS = 6
"""Most forecasts for one aim; where the last aim was good, one does."""

CLOSE_ENOUGH = 0.1
"""Root of the mean square in mm of what an aim is off by the forecast: then it is left as it is."""

RELAXATION = 0.7
"""Share of what an aim is off that it is moved by in each round."""

STEP_SHARE, LIMIT_SHARE = 0.1, 0.15
"""Most by which a joint is moved in a round, as a share of the median strut, and in all, as a share of the extent."""

LARGEST_BOW = 0.15
"""Most by which the inner control points of a strut are moved, as a share of its length."""

PARTS = 3
"""Into which the next batch is divided where its own movement is wanted."""


def aimed(
    design: Wireframe,
    adapted: Wireframe,
    targets: np.ndarray,
    fit: MaterialFit,
    state: PrintState,
    batches: Sequence[np.ndarray],
    wanted: np.ndarray | None = None,
) -> Wireframe:
    """Aim what is still to be laid.

    Parameters
    ----------
    design
        Where the finished frame shall be.
    adapted
        The plan, ``printed`` marking what stands; that stays as it is, to the last bit.
    targets : (V, 3) array, mm
        Where joints that are not there yet were aimed before.
    fit
        What is known of the material; where its forecasts are not trusted, ``adapted`` is given back.
    state
        Of the print, as ``adapted`` has it.
    batches
        Struts of each batch still to come, in order.
    wanted : (E,) bool array, optional
        Struts that are aimed, all by default; the others are laid as they are planned.
    """
    wanted = np.ones(design.strut_count, dtype=bool) if wanted is None else wanted
    trust, free = fit.trust, ~state.there & design.replace(printed=wanted).printed_vertices()
    if trust == 0.0 or not len(batches):
        return adapted
    start = np.where(free[:, None], targets, state.points)
    goal, bows = _joint_aims(design, start, free, fit, state, batches)
    plan = adapted.moved_to(np.where(free[:, None], goal, adapted.vertices))
    most = LARGEST_BOW * design.lengths[:, None, None] / np.maximum(np.linalg.norm(bows, axis=2, keepdims=True), 1e-12)
    curves = np.array(design.moved_to(plan.vertices).control_points)
    curves[:, 1:3] -= np.where(wanted, trust, 0.0)[:, None, None] * np.minimum(1.0, most) * bows
    curves[:, 1:3] = _above_plate(curves[:, 1:3], design.control_points[:, 1:3], design)
    return plan.replace(control_points=np.where(plan.printed[:, None, None], plan.control_points, curves))


def expected_drift(plan: Wireframe, fit: MaterialFit, state: PrintState, struts: np.ndarray) -> np.ndarray:
    """Forecast how fast joints drift while a batch is laid, those included that come into being in it.

    Returns
    -------
    (V, 3) array, mm
        With each strut that is laid, from when a joint is there; see `frametwin.printing.adaptation.anticipation`.
    """
    state = _at(state, plan.vertices)
    after = fit.model.after(state, struts, fit.parameters, parts=PARTS)
    return drift_between(state, after, plan.edges[struts])


def drift_between(before: PrintState, after: PrintState, ends: np.ndarray) -> np.ndarray:
    """(V, 3) array, mm: drift with each strut of a batch, whose struts have the ends (N, 2); see `expected_drift`."""
    first = np.full(len(before.there), np.inf)
    np.minimum.at(first, ends.ravel(), np.repeat(np.arange(len(ends)) + 0.5, 2))
    since = np.where(before.there, 0.0, first)
    rest = np.maximum(len(ends) - since, 0.5)
    return np.where(after.there[:, None], (after.points - before.points) / rest[:, None], 0.0)


def remaining_movement(
    fit: MaterialFit, state: PrintState, batches: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Forecast how a print moves until it is finished.

    Returns
    -------
    joints, bows
        (V, 3) array, mm, each from when it is there; and (E, 2, 3) array, mm, of the struts' inner control points
        beyond what their ends do.
    """
    began, parameters, bows = state.points, fit.parameters, np.zeros((len(state.laid), 2, 3))
    for struts, pauses in _steps(batches):
        state = fit.model.after(state, struts, parameters, pauses=pauses, bows=bows)
    return state.points - began, bows


def _joint_aims(
    design: Wireframe,
    targets: np.ndarray,
    free: np.ndarray,
    fit: MaterialFit,
    state: PrintState,
    batches: Sequence[np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Where to aim the joints that are ``free``, the best of a few rounds, and the bows of the struts there."""
    trust = fit.trust
    cap, limit = STEP_SHARE * float(np.median(design.lengths)), LIMIT_SHARE * design.extent
    best, left, wanted, bowed = targets, np.inf, targets, np.zeros((design.strut_count, 2, 3))
    share, tried = RELAXATION, targets
    for _ in range(ROUNDS):
        moved, bows = remaining_movement(fit, _at(state, tried), batches)
        goal = design.vertices - trust * moved
        off = float(np.sqrt(np.mean(np.sum((goal - tried)[free] ** 2, axis=1)))) if free.any() else 0.0
        if off < left:
            best, left, wanted, bowed = tried, off, goal, bows
        else:
            share *= 0.5
        if left < CLOSE_ENOUGH:
            break
        tried = best + _no_longer_than(share * (wanted - best), cap)
        tried = design.vertices + _no_longer_than(tried - design.vertices, limit)
        tried = _above_plate(tried, design.vertices, design)
        tried = np.where(free[:, None], tried, targets)
    return best, bowed


def _above_plate(aims: np.ndarray, planned: np.ndarray, design: Wireframe) -> np.ndarray:
    """Aims (..., 3) none of which is below the plate, where no nozzle comes, unless it was planned there."""
    plate = float(design.vertices[design.grounded, 2].min()) if design.grounded.any() else -np.inf
    return np.concatenate([aims[..., :2], np.maximum(aims[..., 2:], np.minimum(plate, planned[..., 2:]))], axis=-1)


def _at(state: PrintState, points: np.ndarray) -> PrintState:
    return PrintState(points, state.there, state.laid, state.laid_at, state.clock)


def _steps(batches: Sequence[np.ndarray]) -> list[tuple[np.ndarray, int]]:
    """The batches, those further on put together, and how many there are in each step: so many pauses it has."""
    near, far = np.arange(min(NEAR_STEPS, len(batches))), np.arange(NEAR_STEPS, len(batches))
    groups = np.array_split(far, min(len(far), MOST_STEPS - NEAR_STEPS)) if len(far) else []
    return [(np.concatenate([batches[i] for i in group]), len(group)) for group in (*near[:, None], *groups)]


def _no_longer_than(vectors: np.ndarray, most: float) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    shorter: np.ndarray = vectors * np.minimum(1.0, most / np.maximum(length, 1e-12))
    return shorter
