"""Which struts seem to be bent as no cubic can be.

By the Gauss-Newton terms of all struts in two halves one knows by how much the loss would fall were each free to bow
between clamped ends.
"""

from __future__ import annotations

import numpy as np

from frametwin.fitting import presence
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.fast_state import Problem, State, drawn, level_of
from frametwin.fitting.halves import Halves, cut
from frametwin.fitting.torn_ends import scale_of
from frametwin.geometry import bezier
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods

GAIN, UNUSUAL = 0.15, 6.0
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
"""Share of the struts that are halved at a time, at most, those first whose outlines are furthest off."""


def suspects(problem: Problem, state: State, stage: Stage, cubic: np.ndarray) -> np.ndarray:
    """Struts that would gain much by a bow that is clamped at both ends, or whose outlines are off: `MOST` of all.

    They are looked for in the pictures of a stage: the one that the state comes from, since others make it seem off.
    Struts ``cubic`` (K,) are known not to be bent, and are none of them.
    """
    frame = problem.frame
    whole, level = drawn(problem, state, stage.pieces), level_of(problem, state, stage)
    gain = _gain_of_bows(whole, level)
    least = max(GAIN * scale_of(problem, stage), UNUSUAL * float(np.median(gain)))
    off = presence.outline_misfit(whole, level)
    asks = (gain > least) | (off > max(BESIDE, APART * float(np.median(off))))
    asks &= frame.chord_lengths > SHORTEST * state.pose.radius
    asks &= state.pose.opacity.mean(axis=1) > THERE  # what is not there can be drawn anywhere
    asks[cubic] = False
    order = np.argsort(-off, kind="stable")
    return np.sort(order[asks[order]][: max(1, int(MOST * frame.strut_count))])


def _gain_of_bows(whole: Rods, level: Level) -> np.ndarray:
    """(E,) falls of the loss were each strut alone free to bow beyond what its cubic can, to second order."""
    struts, pieces = len(whole.edges), max(1, whole.pieces // 2)
    halves = Halves(np.arange(struts), struts, len(whole.joints))
    curves = cut(whole.control_points, halves)
    drawn_halves = Rods(
        control_points=curves,
        joints=np.concatenate([whole.joints, curves[halves.second, 0]]),
        edges=halves.edges(whole.edges),
        radius=halves.halved(whole.radius[:, :pieces]),
        opacity=np.concatenate([whole.opacity[:, :pieces], whole.opacity[:, -pieces:]]),
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
