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
from frametwin.printing.adaptation.rest_of_print import Movement, PrintStep, drift_between, remaining_movement
from frametwin.printing.process.creep import PrintState

ROUNDS, LEAST_SHARE = 30, 0.2
"""Most forecasts for one aim, and the share of what it is off below which it is not moved: each round that is no better
than the best one halves it. Where the last aim was good, one round does; the first aim of a print that sags by several
struts' widths takes many."""

CLOSE_ENOUGH, NEARLY = 0.1, 0.5
"""Root of the mean square in mm of what an aim is off by the forecast, below which it is left as it is, and below which
it is moved a last time: forecasts change little with where joints are, and a round takes off four fifths or more."""

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
    steps: Sequence[PrintStep],
    wanted: np.ndarray | None = None,
    known: Movement | None = None,
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
    steps
        What is still to come, in order.
    wanted : (E,) bool array, optional
        Struts that are aimed, all by default; the others are laid as they are planned.
    known
        How the print moves in these steps from some aim, where that was found already; a matter of speed alone.
    """
    wanted = np.ones(design.strut_count, dtype=bool) if wanted is None else wanted
    trust, free = fit.trust, ~state.there & design.replace(printed=wanted).printed_vertices()
    if trust == 0.0 or not len(steps):
        return adapted
    start = np.where(free[:, None], targets, state.points)
    goal, bows = _joint_aims(design, start, free, fit, state, steps, known)
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


def _joint_aims(
    design: Wireframe,
    targets: np.ndarray,
    free: np.ndarray,
    fit: MaterialFit,
    state: PrintState,
    steps: Sequence[PrintStep],
    known: Movement | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Where to aim the joints that are ``free``, the best of a few rounds, and the bows of the struts there."""
    trust = fit.trust
    cap, limit = STEP_SHARE * float(np.median(design.lengths)), LIMIT_SHARE * design.extent
    best, left, wanted, bowed = targets, np.inf, targets, np.zeros((design.strut_count, 2, 3))
    share, tried = 1.0, targets
    for _ in range(ROUNDS):
        if known is None or not np.array_equal(known.began, tried):
            known = remaining_movement(fit, _at(state, tried), steps)
        goal = design.vertices - trust * known.joints
        off = float(np.sqrt(np.mean(np.sum((goal - tried)[free] ** 2, axis=1)))) if free.any() else 0.0
        if off < left:
            best, left, wanted, bowed = tried, off, goal, known.bows
        else:
            share *= 0.5
        if left < CLOSE_ENOUGH or share < LEAST_SHARE:
            break
        tried = best + _no_longer_than(share * (wanted - best), cap)
        tried = design.vertices + _no_longer_than(tried - design.vertices, limit)
        tried = _above_plate(tried, design.vertices, design)
        tried = np.where(free[:, None], tried, targets)
        if left < NEARLY:
            return tried, bowed
    return best, bowed


def _above_plate(aims: np.ndarray, planned: np.ndarray, design: Wireframe) -> np.ndarray:
    """Aims (..., 3) none of which is below the plate, where no nozzle comes, unless it was planned there."""
    plate = float(design.vertices[design.grounded, 2].min()) if design.grounded.any() else -np.inf
    return np.concatenate([aims[..., :2], np.maximum(aims[..., 2:], np.minimum(plate, planned[..., 2:]))], axis=-1)


def _at(state: PrintState, points: np.ndarray) -> PrintState:
    return PrintState(points, state.there, state.laid, state.laid_at, state.clock)


def _no_longer_than(vectors: np.ndarray, most: float) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    shorter: np.ndarray = vectors * np.minimum(1.0, most / np.maximum(length, 1e-12))
    return shorter
