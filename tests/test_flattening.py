"""How far chords leave curves, and whether curves are straight, against closed forms and dense sampling."""

from __future__ import annotations

import numpy as np
import pytest

from frametwin.geometry import bezier
from frametwin.geometry.flattening import chord_error, chords_needed, is_straight, second_derivative_bound

PARABOLA = np.array([[0.0, 0.0, 0.0], [10.0, 8.0, 0.0], [20.0, 0.0, 0.0]])
"""y = 16 u (1 - u), x = 20 u: its second derivative is 32 everywhere, its sagitta 4."""


def deviation(curve: np.ndarray, chords: int) -> float:
    """Largest distance of a densely sampled curve from the chord below it, at equal parameters."""
    worst = 0.0
    for k in range(chords):
        u = np.linspace(k / chords, (k + 1) / chords, 201)
        points = bezier.evaluate(curve, u)
        chord = np.linspace(points[0], points[-1], 201)
        worst = max(worst, float(np.linalg.norm(points - chord, axis=1).max()))
    return worst


def test_a_parabola_leaves_its_chords_by_the_bound() -> None:
    assert second_derivative_bound(PARABOLA) == pytest.approx(32.0)
    for chords in (1, 2, 5):
        assert chord_error(PARABOLA, chords) == pytest.approx(4.0 / chords**2)
        assert deviation(PARABOLA, chords) == pytest.approx(4.0 / chords**2)
    assert chords_needed(PARABOLA, 0.04) == pytest.approx(10.0)
    assert chord_error(bezier.elevate(PARABOLA, 3), 2) == pytest.approx(1.0)


def test_cubics_never_leave_their_chords_by_more_than_asked() -> None:
    curves = np.random.default_rng(4).normal(scale=20.0, size=(30, 4, 3))
    tolerance = np.linspace(0.05, 2.0, 30)
    counts = np.ceil(chords_needed(curves, tolerance)).astype(int)
    for curve, count, allowed in zip(curves, counts, tolerance, strict=True):
        assert deviation(curve, count) <= allowed
    np.testing.assert_allclose(chord_error(curves, chords_needed(curves, tolerance)), tolerance)


def test_straight_curves_need_no_chords() -> None:
    curve = bezier.straight([0.0, 0.0, 0.0], [3.0, 0.0, 6.0])
    assert second_derivative_bound(curve) == 0.0 and chords_needed(curve, 0.1) == 0.0
    assert second_derivative_bound(curve[[0, 3]]) == 0.0  # a line of degree 1
    assert second_derivative_bound(np.zeros((0, 4, 3))).shape == (0,)


@pytest.mark.parametrize(
    ("inner", "straight", "even"),
    [
        ([[3.0, 0.0, 0.0], [6.0, 0.0, 0.0]], True, True),
        ([[1.0, 0.0, 0.0], [8.0, 0.0, 0.0]], True, False),  # runs at an uneven pace
        ([[3.0, 0.02, 0.0], [6.0, 0.0, 0.0]], False, False),
        ([[3.0, 0.009, 0.0], [6.0, 0.0, -0.009]], True, True),
        ([[-1.0, 0.0, 0.0], [6.0, 0.0, 0.0]], False, False),  # runs back at its beginning
        ([[3.0, 0.0, 0.0], [9.02, 0.0, 0.0]], False, False),  # goes beyond its end
    ],
)
def test_what_counts_as_straight(inner: list[list[float]], straight: bool, even: bool) -> None:
    curve = np.array([[0.0, 0.0, 0.0], *inner, [9.0, 0.0, 0.0]])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for points in (curve, curve @ turn + 7.0):
        assert bool(is_straight(points, 0.01)) is straight
    assert bool(is_straight(curve, 0.01, even=True)) is even


def test_straightness_of_many_curves_and_of_points() -> None:
    curves = np.stack([bezier.straight([0.0, 0.0, 0.0], [9.0, 0.0, 0.0])] * 3)
    curves[1, 1, 1], curves[2] = 0.5, 4.0  # a bent one, and one that is a point
    assert is_straight(curves, np.array([0.1, 0.1, 0.0])).tolist() == [True, False, True]
    assert is_straight(curves, np.array([0.1, 0.6, 0.0]), even=True).tolist() == [True, True, True]
    assert is_straight(curves[:0], 0.1).shape == (0,)
