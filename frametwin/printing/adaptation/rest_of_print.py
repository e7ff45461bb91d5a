"""The rest of a print in as few steps as tell how it moves: next batches one by one, those further on put together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from frametwin.printing.adaptation.material_fit import MaterialFit
from frametwin.printing.process.creep import PrintState

MOST_STEPS = 24
"""Into which the rest of a print is divided."""

NEAR_STEPS = 6
"""Batches that are computed one by one all the same."""

NEAR_PARTS, FAR_PARTS = 3, 2
"""Into which each of these batches, and each step further on, is divided; the print settles after each part. All that a
part lays bears and holds all the while, from before it is laid: in one part, where the joints that come next end was
told wrong by 0.7 to 2.1 mm (root mean square of four frames, against 13 parts of every batch), so divided by 0.3 to
1.0."""


@dataclass(frozen=True, eq=False)
class PrintStep:
    """What is laid in one step of a forecast.

    Attributes
    ----------
    struts : (N,) int64 array
        In their order.
    batches
        How many these are: so many pauses it has.
    parts
        After each of so many parts of the struts the print settles.
    """

    struts: np.ndarray
    batches: int
    parts: int = NEAR_PARTS


@dataclass(frozen=True, eq=False)
class Movement:
    """How a print is forecast to move until it is finished.

    Attributes
    ----------
    began : (V, 3) array, mm
        Where its joints are, and those that are still to come shall be laid.
    joints : (V, 3) array, mm
        How they move, each from when it is there.
    bows : (E, 2, 3) array, mm
        How the struts' inner control points move beyond what their ends do.
    """

    began: np.ndarray
    joints: np.ndarray
    bows: np.ndarray


def steps_of(batches: Sequence[np.ndarray]) -> list[PrintStep]:
    """The batches, those further on put together."""
    near, far = np.arange(min(NEAR_STEPS, len(batches))), np.arange(NEAR_STEPS, len(batches))
    groups = np.array_split(far, min(len(far), MOST_STEPS - NEAR_STEPS)) if len(far) else []
    one_by_one = [PrintStep(batches[i], 1) for i in near]
    return one_by_one + [PrintStep(np.concatenate([batches[i] for i in k]), len(k), FAR_PARTS) for k in groups]


def resized_steps(
    fit: MaterialFit,
    state: PrintState,
    steps: Sequence[PrintStep],
    size_in: Callable[[PrintStep, np.ndarray], int],
) -> tuple[list[PrintStep], Movement]:
    """The steps with as many batches in each as there will be once their sizes suit how the print moves, and this.

    Each batch ends with a pause, and a print that takes longer sags further.

    Parameters
    ----------
    fit, state
        What is known of the material, and the print before the first step.
    steps
        See `steps_of`.
    size_in
        How many struts a batch of a step shall have, where joints drift (V, 3) mm with each strut that is laid.
    """
    edges, result, waiting = fit.model.design.edges, [], list(steps)
    began, bows = state.points, np.zeros((len(state.laid), 2, 3))
    while waiting:
        step, bowed = waiting.pop(0), bows.copy()
        then = _after(fit, state, step, bowed)
        size = size_in(step, drift_between(state, then, edges[step.struts]))
        resized = replace(step, batches=-(-len(step.struts) // size))
        if step.batches == 1 and resized.batches > 1:  # what is too much for it makes the next one
            resized = replace(step, struts=step.struts[:size])
            waiting.insert(0, replace(step, struts=step.struts[size:]))
        if resized.batches == step.batches and len(resized.struts) == len(step.struts):
            state, bows = then, bowed
        else:
            state = _after(fit, state, resized, bows)
        result.append(resized)
    return result, Movement(began, state.points - began, bows)


def remaining_movement(fit: MaterialFit, state: PrintState, steps: Sequence[PrintStep]) -> Movement:
    """Forecast how a print moves until it is finished."""
    began, bows = state.points, np.zeros((len(state.laid), 2, 3))
    for step in steps:
        state = _after(fit, state, step, bows)
    return Movement(began, state.points - began, bows)


def drift_between(before: PrintState, after: PrintState, ends: np.ndarray) -> np.ndarray:
    """(V, 3) array, mm: drift with each of the struts that are laid between two moments, from when a joint is there.

    Parameters
    ----------
    before, after
        The print.
    ends : (N, 2) int64 array
        Joints of the struts, in their order.
    """
    first = np.full(len(before.there), np.inf)
    np.minimum.at(first, ends.ravel(), np.repeat(np.arange(len(ends)) + 0.5, 2))
    since = np.where(before.there, 0.0, first)
    rest = np.maximum(len(ends) - since, 0.5)
    return np.where(after.there[:, None], (after.points - before.points) / rest[:, None], 0.0)


def _after(fit: MaterialFit, state: PrintState, step: PrintStep, bows: np.ndarray | None = None) -> PrintState:
    parts = min(step.parts, len(step.struts))
    return fit.model.after(state, step.struts, fit.parameters, parts=parts, pauses=step.batches, bows=bows)
