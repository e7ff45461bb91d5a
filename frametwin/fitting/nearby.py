"""A few struts and those around them, fitted while the rest of the frame stays where it is.

What is tried at one end of one strut need not draw the whole frame. Joints that the rest holds are pinned.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from frametwin.fitting.fast_state import Problem, State, drawn
from frametwin.fitting.motion import Pose
from frametwin.fitting.window import Window
from frametwin.progress import Progress, ProgressCallback
from frametwin.raster.rods import Rods

RINGS = 2
"""Joints between the struts that are asked for and the first that is pinned."""

MOST, FEW = 0.5, 64
"""Share of the struts from which everything may move, and frames of so few in which it always does: less would hardly
be cheaper."""

MARGIN = 12.0
"""Radii around the struts that are looked at: nothing that is tried moves further."""

PIECES = 6
"""Straight pieces of struts that stay where they are."""


@dataclass(frozen=True, eq=False)
class Nearby:
    """Some struts of a problem.

    Attributes
    ----------
    whole : Problem
    part : Problem
        Of these struts; the whole itself where they are many.
    struts : (E',) array of int
        Of the whole.
    joints : (V',) array of int
        Likewise, of the part.
    """

    whole: Problem
    part: Problem
    struts: np.ndarray
    joints: np.ndarray

    @classmethod
    def of(cls, problem: Problem, state: State, struts: np.ndarray, rings: int = RINGS) -> Nearby:
        """Struts (N,) of a problem, and those around them; windows are cut about where the state has them."""
        chosen = _around(problem.frame.edges, struts, rings)
        if problem.window is not None or len(chosen) < FEW or chosen.sum() > MOST * len(chosen):
            return cls(problem, problem, np.arange(len(chosen)), np.arange(problem.frame.vertex_count))
        seen = drawn(problem, state, PIECES)
        held = np.ones(len(seen.joints)) if state.joint_size is None else state.joint_size.copy()
        held[problem.frame.edges[chosen]] = 0.0
        rest = Rods(
            seen.control_points[~chosen],
            seen.joints,
            seen.edges[~chosen],
            seen.radius[~chosen],
            seen.opacity[~chosen],
            held,
        )
        margin = MARGIN * float(state.pose.radius[chosen].max())
        window = Window(seen.control_points[chosen].reshape(-1, 3), margin, rest, state.cameras)
        return cls._cut(problem, state, chosen, window)

    def in_frame(self, problem: Problem, state: State) -> Nearby:
        """The same struts and windows, of a problem in which some of their ends have other vertices."""
        if self.part.window is None:
            return replace(self, whole=problem, part=problem, joints=np.arange(problem.frame.vertex_count))
        chosen = np.zeros(problem.frame.strut_count, dtype=bool)
        chosen[self.struts] = True
        return self._cut(problem, state, chosen, self.part.window)

    @classmethod
    def _cut(cls, problem: Problem, state: State, chosen: np.ndarray, window: Window) -> Nearby:
        frame, joints = problem.frame.subset(chosen)
        pinned = np.isin(joints, problem.frame.edges[~chosen])
        struts = np.flatnonzero(chosen)
        part = replace(
            problem,
            frame=frame,
            elastic=problem.elastic.part(frame, struts, pinned),
            callback=_told(problem, state),
            window=window,
            resting=problem.frame.vertex_count - len(joints),
        )
        return cls(problem, part, struts, joints)

    def taken(self, state: State) -> State:
        """Of a state of the whole, what the part has of it; cameras are where the windows have them."""
        if self.part is self.whole:
            return state

        def taken(pose: Pose) -> Pose:
            return Pose(*(one[rows] for one, rows in zip(_fields(pose), self._rows, strict=True)))

        sizes = None if state.joint_size is None else state.joint_size[self.joints]
        return replace(
            state, pose=taken(state.pose), anchor=taken(state.anchor), joint_size=sizes, terms=None, cameras=None
        )

    def after(self, state: State, change: Callable[[Problem, State], State]) -> State:
        """A state of the whole after a change of the part alone. Its steps are not noted as those of a fit are."""
        if self.part is self.whole:
            return change(self.whole, state)
        found = change(self.part, self.taken(state))
        pose, sizes = state.pose, state.joint_size
        count = found.pose.opacity.shape[1]
        if count != pose.opacity.shape[1]:
            kernel = ((np.arange(count) + 0.5) / count * pose.opacity.shape[1]).astype(int)
            pose = replace(pose, opacity=pose.opacity[:, kernel])
        moved = [one.copy() for one in _fields(pose)]
        for one, rows, new in zip(moved, self._rows, _fields(found.pose), strict=True):
            one[rows] = new
        if sizes is not None and found.joint_size is not None:
            sizes = sizes.copy()
            sizes[self.joints] = found.joint_size
        return replace(state, pose=Pose(*moved), joint_size=sizes, terms=None)

    @property
    def _rows(self) -> tuple[np.ndarray, ...]:
        return self.joints, self.struts, self.struts, self.struts


def _fields(pose: Pose) -> tuple[np.ndarray, ...]:
    return pose.joints, pose.inner, pose.radius, pose.opacity


def _around(edges: np.ndarray, struts: np.ndarray, rings: int) -> np.ndarray:
    """(E,) array of bool: struts (N,), and all that so many joints part from them."""
    chosen = np.zeros(len(edges), dtype=bool)
    chosen[struts] = True
    for _ in range(rings):
        touched = np.zeros(int(edges.max()) + 1, dtype=bool)
        touched[edges[chosen]] = True
        chosen = touched[edges].any(axis=1)
    return chosen


def _told(problem: Problem, state: State) -> ProgressCallback | None:
    """What tells of steps of a part: always the whole frame, and no step of the fit's own more."""
    callback = problem.callback
    if callback is None:
        return None
    curves, done = drawn(problem, state, 1).control_points, len(state.record.loss)

    def told(progress: Progress) -> bool | None:
        return callback(replace(progress, iteration=min(done, progress.total), control_points=curves))

    return told
