"""Print and cameras of a fit, brought to where the world is held."""

from __future__ import annotations

from dataclasses import replace

from frametwin.fitting import gauge
from frametwin.fitting.fast_state import Problem, State


def held_by(problem: Problem, state: State, what: str) -> State:
    """Print and cameras moved together to where feet or cameras hold them; see `frametwin.fitting.gauge`."""
    rig = problem.level(problem.settings.refine[-1]).cameras
    feet = problem.foot_deviation if what == "feet" else None
    motion = gauge.held_world(problem.elastic, state.pose, rig, state.freedoms, problem.covariances, feet)
    return replace(
        state,
        pose=gauge.moved_pose(problem.elastic, state.pose, motion),
        cameras=gauge.moved_rig(rig, state.freedoms, motion),
    )
