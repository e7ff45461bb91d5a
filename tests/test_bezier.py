"""Bezier algebra against closed forms and numpy's own least squares."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from frametwin.geometry import bezier

RNG_SEED = 20
DEGREES = [1, 2, 3, 4, 7]


def random_curves(*shape: int) -> np.ndarray:
    return np.random.default_rng(RNG_SEED).normal(scale=30.0, size=shape)


def as_polynomials(points: np.ndarray) -> list[Polynomial]:
    """Coordinates of one curve as polynomials, by interpolation of de Casteljau's points."""
    n = len(points) - 1
    u = np.linspace(0.0, 1.0, n + 1)
    values = np.array([bezier.split(points, x)[0][-1] for x in u])
    return [Polynomial.fit(u, values[:, i], n, domain=[0, 1], window=[0, 1]) for i in range(values.shape[1])]


@pytest.mark.parametrize("n", [0, *DEGREES])
def test_bernstein_is_a_partition_of_unity_with_linear_precision(n: int) -> None:
    u = np.linspace(-0.2, 1.2, 29)
    basis = bezier.bernstein(n, u)
    assert basis.shape == (29, n + 1)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=1e-13)
    if n:
        np.testing.assert_allclose(basis @ (np.arange(n + 1) / n), u, atol=1e-13)
    inside = bezier.bernstein(n, np.linspace(0.0, 1.0, 11))
    assert (inside >= 0.0).all()


@pytest.mark.parametrize("n", DEGREES)
def test_evaluate_and_derivative_agree_with_polynomials(n: int) -> None:
    points = random_curves(n + 1, 3)
    u = np.linspace(0.0, 1.0, 13)
    polynomials = as_polynomials(points)
    for order in range(n + 2):
        wanted = np.column_stack([(p.deriv(order) if order else p)(u) for p in polynomials])
        found = bezier.derivative(points, u, order)
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-7 * 10.0**order)
    np.testing.assert_array_equal(bezier.evaluate(points, u), bezier.derivative(points, u, 0))


def test_many_curves_at_once_equal_one_at_a_time() -> None:
    points = random_curves(5, 2, 4, 3)
    u = np.array([0.0, 0.3, 1.0])
    assert bezier.evaluate(points, u).shape == (5, 2, 3, 3)
    assert bezier.arc_length(points).shape == (5, 2)
    for index in np.ndindex(5, 2):
        np.testing.assert_allclose(bezier.evaluate(points, u)[index], bezier.evaluate(points[index], u))
        np.testing.assert_allclose(bezier.derivative(points, u)[index], bezier.derivative(points[index], u))
        np.testing.assert_allclose(bezier.arc_length(points)[index], bezier.arc_length(points[index]))


def test_ends_are_the_outer_control_points_to_the_last_bit() -> None:
    points = random_curves(50, 4, 3)
    ends = bezier.evaluate(points, [0.0, 1.0])
    np.testing.assert_array_equal(ends, points[:, [0, 3]])


@pytest.mark.parametrize("degree", [3, 4, 8])
def test_elevated_curves_are_the_same_curves(degree: int) -> None:
    points = random_curves(6, 4, 3)
    raised = bezier.elevate(points, degree)
    u = np.linspace(0.0, 1.0, 17)
    assert raised.shape == (6, degree + 1, 3)
    np.testing.assert_allclose(bezier.evaluate(raised, u), bezier.evaluate(points, u), rtol=0, atol=1e-12)


@pytest.mark.parametrize("cut", [0.0, 0.25, 0.8, 1.0])
def test_split_pieces_cover_the_curve(cut: float) -> None:
    points = random_curves(6, 4, 3)
    left, right = bezier.split(points, cut)
    u = np.linspace(0.0, 1.0, 9)
    np.testing.assert_allclose(bezier.evaluate(left, u), bezier.evaluate(points, u * cut), atol=1e-12)
    np.testing.assert_allclose(bezier.evaluate(right, u), bezier.evaluate(points, cut + u * (1.0 - cut)), atol=1e-12)


def test_arc_length_of_a_parabola_is_the_closed_form() -> None:
    # y = a x^2 over 0..w as a quadratic, and the same curve written as a cubic.
    a, w = 0.02, 40.0
    quadratic = np.array([[0.0, 0.0, 0.0], [w / 2.0, 0.0, 0.0], [w, a * w * w, 0.0]])
    s = 2.0 * a * w
    wanted = (s * np.sqrt(1.0 + s * s) + np.arcsinh(s)) / (4.0 * a)
    np.testing.assert_allclose(bezier.arc_length(quadratic), wanted, rtol=1e-12)
    np.testing.assert_allclose(bezier.arc_length(bezier.elevate(quadratic, 3)), wanted, rtol=1e-12)


def test_arc_length_of_straight_struts_is_their_chord_at_any_speed() -> None:
    a, b = random_curves(20, 3), random_curves(20, 3) + 100.0
    even = bezier.straight(a, b)
    chord = np.linalg.norm(b - a, axis=1)
    np.testing.assert_allclose(bezier.arc_length(even), chord, rtol=1e-14)
    uneven = a[:, None] + np.array([0.0, 0.1, 0.9, 1.0])[:, None] * (b - a)[:, None]
    np.testing.assert_allclose(bezier.arc_length(uneven), chord, rtol=1e-13)


def test_arc_length_does_not_change_under_rigid_motion() -> None:
    points = random_curves(10, 4, 3)
    rotation, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    moved = points @ rotation.T + (5.0, -8.0, 100.0)
    np.testing.assert_allclose(bezier.arc_length(moved), bezier.arc_length(points), rtol=1e-12)


@pytest.mark.parametrize(("m", "n"), [(8, 3), (10, 3), (50, 3), (3, 3), (12, 5), (4, 2)])
def test_refit_is_the_constrained_least_squares_solution(m: int, n: int) -> None:
    samples = random_curves(m + 1, 3)
    basis = bezier.bernstein(n, np.arange(m + 1) / m)
    rest = samples - basis[:, :1] * samples[0] - basis[:, n:] * samples[m]
    inner, *_ = np.linalg.lstsq(basis[:, 1:n], rest, rcond=None)
    wanted = np.vstack([samples[:1], inner, samples[m:]])
    np.testing.assert_allclose(bezier.refit_matrix(m, n) @ samples, wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("m", [3, 8, 50])
def test_refit_gives_back_the_cubic_that_was_sampled(m: int) -> None:
    points = random_curves(30, 4, 3)
    samples = bezier.evaluate(points, np.arange(m + 1) / m)
    refit = bezier.refit_matrix(m) @ samples
    np.testing.assert_allclose(refit, points, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(refit[:, [0, 3]], samples[:, [0, m]])  # joints stay closed exactly


def test_refit_of_a_rigid_motion_moves_the_control_points_rigidly() -> None:
    points = random_curves(4, 3)
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    samples = bezier.evaluate(points, np.arange(9) / 8)
    moved = bezier.refit_matrix(8) @ (samples @ rotation.T + (1.0, 2.0, 3.0))
    np.testing.assert_allclose(moved, points @ rotation.T + (1.0, 2.0, 3.0), atol=1e-10)


def test_straight_of_any_degree_has_constant_speed() -> None:
    a, b = np.array([0.1, 0.2, 0.3]), np.array([30.7, -4.0, 12.0])
    for n in DEGREES:
        points = bezier.straight(a, b, n)
        np.testing.assert_array_equal(points[[0, -1]], [a, b])
        speed = bezier.derivative(points, np.linspace(0.0, 1.0, 5))
        np.testing.assert_allclose(speed, np.broadcast_to(b - a, (5, 3)), rtol=1e-12)


@pytest.mark.parametrize(
    "call",
    [
        lambda: bezier.bernstein(-1, 0.5),
        lambda: bezier.evaluate(np.zeros(3), 0.5),
        lambda: bezier.derivative(np.zeros((4, 3)), 0.5, -1),
        lambda: bezier.elevate(np.zeros((4, 3)), 2),
        lambda: bezier.refit_matrix(2, 3),
        lambda: bezier.refit_matrix(5, 0),
        lambda: bezier.straight(np.zeros(3), np.ones(3), 0),
    ],
)
def test_wrong_arguments_are_refused(call) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        call()
