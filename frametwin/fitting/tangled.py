"""Halved struts of one joint that are each drawn along the other's middle.

Two that bow towards each other may have changed places there, which the pictures hardly show.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from frametwin.fitting.fast_stages import loss_of
from frametwin.fitting.fast_state import Problem, State, drawn
from frametwin.fitting.halves import Halves, laid_along
from frametwin.fitting.misplaced import settled
from frametwin.fitting.nearby import Nearby
from frametwin.geometry import bezier

AROUND_BENT = 3
"""Rings of struts around bent ones that may move along while these are tried (see `Nearby`): joints that have left
their place have taken others with them."""

NEAR, PAIRS = 8.0, 6
"""Radii between the middles of two struts of one joint that may have changed places, and how many are tried."""


def untangled(problem: Problem, state: State, halves: Halves) -> State:
    """The state with halved struts of one joint in each other's place, or straight, where that explains more."""
    pairs = _near_pairs(problem, state, halves)
    if not pairs:
        return state
    for pair in pairs:
        both = list(pair)
        near = Nearby.of(problem, state, np.concatenate([halves.struts[both], halves.second[both]]), AROUND_BENT)
        state = near.after(state, settled)  # as all that is tried will be
        least = loss_of(problem, state)
        (one, other), (straight, straight_too), start = *_places(problem, state, halves, pair), state
        starts = [
            _with_middles_at(problem, start, halves, pair, np.stack(places))
            for places in ((other, one), (straight, straight_too), (straight, one), (other, straight_too))
        ]
        for begun in (*starts, _with_ends_exchanged(problem, start, halves, pair)):
            tried = near.after(begun, settled)
            state = replace(state, record=tried.record)
            if (loss := loss_of(problem, tried)) < least:
                state, least = tried, loss
    return state


def _places(problem: Problem, state: State, halves: Halves, pair: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(2, 3) each: where the middles of two halved struts are, and where they would be were both straight."""
    now, both = drawn(problem, state, 1), list(pair)
    first, second = halves.struts[both], halves.second[both]
    straight = 0.5 * (now.control_points[first, 0] + now.control_points[second, 3])
    return now.joints[halves.planned_vertices + np.array(pair)], straight


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


def _with_middles_at(
    problem: Problem, state: State, halves: Halves, which: tuple[int, ...], places: np.ndarray
) -> State:
    """The state with the middles of some halved struts at places (N, 3), and the struts in one bow through them."""
    curves = drawn(problem, state, 1).control_points
    middles = halves.planned_vertices + np.array(which)
    own = np.array([[halves.struts[i], halves.second[i]] for i in which])
    for (first, second), place in zip(own, places, strict=True):
        chord = bezier.straight(curves[[first], 0], curves[[second], 3])
        chord[0, 1:3] += 4.0 / 3.0 * (place - 0.5 * (chord[0, 0] + chord[0, 3]))
        curves[first], curves[second] = (half[0] for half in bezier.split(chord, 0.5))
    return _laid(problem, state, curves, middles, own.ravel())


def _with_ends_exchanged(problem: Problem, state: State, halves: Halves, pair: tuple[int, int]) -> State:
    """The state with two halved struts that go on beyond their middles along each other's way to the joint they share.

    Where they cross about their middles, it is there that they were taken for each other.
    """
    now, edges = drawn(problem, state, 1), problem.frame.edges
    curves, both = now.control_points, list(pair)
    sides = np.stack([halves.struts[both], halves.second[both]], axis=1)  # (2, 2) halves by strut and side
    ends = np.stack([edges[sides[:, 0], 0], edges[sides[:, 1], 1]], axis=1)
    shared = np.intersect1d(ends[0], ends[1])[0]
    chosen = [int(np.flatnonzero(own == shared)[0]) for own in ends]
    own = np.array([sides[i, side] for i, side in enumerate(chosen)])
    # From the middle to the joint.
    ways = [curves[half] if side else curves[half][::-1] for half, side in zip(own, chosen, strict=True)]
    for half, side, way, other in zip(own, chosen, ways, ways[::-1], strict=True):
        moved = other + np.linspace(1.0, 0.0, 4)[:, None] * (way[0] - other[0])
        curves[half] = moved if side else moved[::-1]
    return _laid(problem, state, curves, halves.planned_vertices + np.array(pair), own)


def _laid(problem: Problem, state: State, curves: np.ndarray, middles: np.ndarray, own: np.ndarray) -> State:
    """The state with curves (E, 4, 3), held from there on where the ``middles`` and struts ``own`` are now."""
    joints, inner = laid_along(problem, state.pose.joints, curves, middles)
    pose, anchor = replace(state.pose, joints=joints, inner=inner), state.anchor
    from_here = replace(anchor, joints=anchor.joints.copy(), inner=anchor.inner.copy())
    from_here.joints[middles], from_here.inner[own] = joints[middles], inner[own]
    return replace(state, pose=pose, anchor=from_here, terms=None)
