"""A few struts of a frame by themselves: what they show is what they show in the whole, and all else stays."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from frametwin.fitting.fast_settings import FastSettings, Stage
from frametwin.fitting.fast_stages import free_stage, loss_of
from frametwin.fitting.fast_state import Problem, Record, State, terms_of
from frametwin.fitting.nearby import Nearby
from frametwin.formats import find_frame
from frametwin.progress import Progress
from frametwin.simulation.simulate import SimulationSettings, simulate

MADE = simulate(find_frame("half_bowl"), SimulationSettings(size=(300, 400), seed=5))
MASKS = [image / np.float32(255) for image in MADE.images]
STAGE = Stage(detail=2.0, blur=0.7, iterations=3, pieces=6, pull=0.04, drag=0.12)


@pytest.fixture(scope="module")
def fitted() -> tuple[Problem, State]:
    problem = Problem.of(MADE.frame, MADE.cameras, MASKS, FastSettings(refine=(STAGE, STAGE)), None)
    return problem, free_stage(problem, State.planned(problem, Record()), STAGE)


def middle_strut() -> int:
    middle = MADE.frame.control_points.mean(axis=1)
    return int(np.linalg.norm(middle - middle.mean(axis=0) - [0.0, 20.0, 0.0], axis=1).argmin())


def bowed(problem: Problem, state: State, strut: int, radii: float) -> State:
    """The state with one strut bowed by so many radii."""
    inner = state.pose.inner.copy()
    inner[strut] += radii * problem.frame.radius[strut]
    return replace(state, pose=replace(state.pose, inner=inner))


def test_terms_of_struts_are_those_that_they_have_in_the_whole(fitted):
    problem, state = fitted
    near = Nearby.of(problem, state, np.array([middle_strut()]))
    assert 1 < len(near.struts) < 0.5 * problem.frame.strut_count
    whole, part = terms_of(problem, state, STAGE), terms_of(near.part, near.taken(state), STAGE)
    inside = np.searchsorted(near.struts, middle_strut())
    scale = np.abs(whole.gradient).max()
    np.testing.assert_allclose(part.gradient[inside], whole.gradient[middle_strut()], atol=1e-3 * scale)
    stiffest = np.abs(whole.hessian[middle_strut()]).max()
    np.testing.assert_allclose(part.hessian[inside], whole.hessian[middle_strut()], atol=1e-3 * stiffest)
    assert part.loss < whole.loss


def test_losses_of_a_part_differ_as_those_of_the_whole(fitted):
    problem, state = fitted
    strut = middle_strut()
    near = Nearby.of(problem, state, np.array([strut]))
    off = bowed(problem, state, strut, 3.0)
    change = loss_of(problem, off) - loss_of(problem, state)
    assert change > 1.0
    found = loss_of(near.part, near.taken(off)) - loss_of(near.part, near.taken(state))
    assert found == pytest.approx(change, rel=5e-3)


def test_only_struts_of_the_part_move_and_go_back_to_where_the_whole_has_them(fitted):
    problem, state = fitted
    strut = middle_strut()
    near = Nearby.of(problem, state, np.array([strut]))
    off = bowed(problem, state, strut, 2.0)
    after = near.after(off, partial(free_stage, stage=STAGE))
    others = np.setdiff1d(np.arange(problem.frame.strut_count), near.struts)
    np.testing.assert_array_equal(after.pose.inner[others], state.pose.inner[others])
    held = np.unique(problem.frame.edges[others])
    np.testing.assert_allclose(after.pose.joints[held], state.pose.joints[held], atol=1e-6)
    assert after.record is state.record
    right, wrong, back = (loss_of(problem, one) for one in (state, off, after))
    assert back - right < 0.2 * (wrong - right)


def test_what_is_told_of_a_part_is_the_whole_frame() -> None:
    told: list[Progress] = []
    problem = Problem.of(MADE.frame, MADE.cameras, MASKS, FastSettings(refine=(STAGE, STAGE)), told.append)
    state = State.planned(problem, Record())
    Nearby.of(problem, state, np.array([middle_strut()])).after(state, partial(free_stage, stage=STAGE))
    assert len(told) == STAGE.iterations
    for progress in told:
        assert progress.control_points is not None
        assert progress.control_points.shape == (problem.frame.strut_count, 4, 3)
        assert progress.iteration == 0


def test_most_of_a_frame_is_the_whole(fitted):
    problem, state = fitted
    near = Nearby.of(problem, state, np.arange(0, problem.frame.strut_count, 3))
    assert near.part is problem
