"""Bezier algebra for any curves: what cutting, refitting, raising and moving them must not change."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from strategies import SIDE, curves, parameters, rigid_motions

from frametwin.geometry import bezier

TINY = 1e-9 * SIDE
"""Rounding, in mm."""


def de_casteljau(points: np.ndarray, u: float) -> np.ndarray:
    """The point of a curve by repeated interpolation of its control points (n + 1, 3)."""
    while len(points) > 1:
        points = np.array([(1.0 - u) * a + u * b for a, b in zip(points[:-1], points[1:], strict=True)])
    return points[0]


def polyline_length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@given(curves(), parameters())
def test_a_point_is_that_of_de_casteljau(points: np.ndarray, u: float) -> None:
    np.testing.assert_allclose(bezier.evaluate(points, u)[0], de_casteljau(points, u), rtol=0, atol=TINY)


@given(curves(), parameters())
def test_a_curve_stays_inside_of_the_box_around_its_control_points(points: np.ndarray, u: float) -> None:
    (found,) = bezier.evaluate(points, u)
    assert (found >= points.min(axis=0) - TINY).all() and (found <= points.max(axis=0) + TINY).all()


@given(curves(), parameters())
def test_a_curve_backwards_is_the_same_curve(points: np.ndarray, u: float) -> None:
    there, back = bezier.evaluate(points, u), bezier.evaluate(points[::-1], 1.0 - u)
    np.testing.assert_allclose(there, back, rtol=0, atol=TINY)


@given(curves(), parameters(), parameters())
def test_the_two_parts_of_a_cut_curve_are_the_curve(points: np.ndarray, cut: float, u: float) -> None:
    left, right = bezier.split(points, cut)
    np.testing.assert_array_equal(left[0], points[0])
    np.testing.assert_array_equal(right[-1], points[-1])
    np.testing.assert_array_equal(left[-1], right[0])
    whole = bezier.evaluate(points, [u * cut, cut + u * (1.0 - cut)])
    parts = np.concatenate([bezier.evaluate(left, u), bezier.evaluate(right, u)])
    np.testing.assert_allclose(parts, whole, rtol=0, atol=TINY)


@given(curves(most=4), st.integers(0, 4), parameters())
def test_a_raised_curve_is_the_same_curve(points: np.ndarray, more: int, u: float) -> None:
    raised = bezier.elevate(points, len(points) - 1 + more)
    assert len(raised) == len(points) + more
    np.testing.assert_allclose(bezier.evaluate(raised, u), bezier.evaluate(points, u), rtol=0, atol=TINY)


@given(curves(), parameters())
def test_the_derivative_is_the_limit_of_differences(points: np.ndarray, u: float) -> None:
    # Central differences of step h miss by h^2 / 6 of the third derivative, which is n^3 third differences at most.
    h, third = 1e-4, (len(points) - 1) ** 3 * 8.0 * SIDE
    ahead, behind = bezier.evaluate(points, [u + h, u - h])
    (found,) = bezier.derivative(points, u)
    np.testing.assert_allclose((ahead - behind) / (2.0 * h), found, rtol=0, atol=h * h * third + 1e-12 * SIDE / h)


@given(curves(most=5), st.integers(0, 7))
def test_a_refit_gives_back_the_curve_that_was_sampled(points: np.ndarray, more: int) -> None:
    n = len(points) - 1
    m = n + more
    samples = bezier.evaluate(points, np.arange(m + 1) / m)
    np.testing.assert_allclose(bezier.refit_matrix(m, n) @ samples, points, rtol=0, atol=1e3 * TINY)


@given(curves(least=8, most=12), st.integers(0, 2))
def test_no_cubic_with_these_ends_is_nearer_to_the_samples_than_the_refit(samples: np.ndarray, axis: int) -> None:
    m = len(samples) - 1
    u = np.arange(m + 1) / m
    fit = bezier.refit_matrix(m) @ samples
    np.testing.assert_array_equal(fit[[0, 3]], samples[[0, m]])
    missed = np.square(bezier.evaluate(fit, u) - samples).sum()
    for inner in (1, 2):
        for step in (-1.0, 1.0):
            other = fit.copy()
            other[inner, axis] += step
            assert np.square(bezier.evaluate(other, u) - samples).sum() > missed


@given(curves(least=3, most=3))
def test_the_length_is_between_those_of_the_chords_and_of_the_control_polygon(points: np.ndarray) -> None:
    length = float(bezier.arc_length(points, panels=64))
    slack = 1e-4 * polyline_length(points) + TINY  # where the speed falls to zero the quadrature is less than exact
    assert polyline_length(bezier.evaluate(points, np.linspace(0.0, 1.0, 200))) <= length + slack
    assert length <= polyline_length(points) + slack


@given(curves(least=3, most=3), parameters())
def test_lengths_of_the_parts_add_up(points: np.ndarray, cut: float) -> None:
    parts = sum(float(bezier.arc_length(part, panels=64)) for part in bezier.split(points, cut))
    np.testing.assert_allclose(parts, bezier.arc_length(points, panels=64), rtol=0, atol=1e-4 * polyline_length(points))


@given(curves(), rigid_motions(), parameters())
def test_a_moved_curve_is_the_curve_of_moved_control_points(points: np.ndarray, motion: np.ndarray, u: float) -> None:
    moved = points @ motion[:3, :3].T + motion[:3, 3]
    wanted = bezier.evaluate(points, u) @ motion[:3, :3].T + motion[:3, 3]
    np.testing.assert_allclose(bezier.evaluate(moved, u), wanted, rtol=0, atol=10.0 * TINY)
    np.testing.assert_allclose(bezier.arc_length(moved), bezier.arc_length(points), rtol=1e-9, atol=10.0 * TINY)
