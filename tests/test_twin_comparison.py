"""Twins compared: closed forms for shifts, slides, turns and bows."""

from __future__ import annotations

import numpy as np
import pytest
from small_frames import tower

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.nearest import distances_to_curves
from frametwin.twin.comparison import check_comparable, compare_struts

U = np.linspace(0.0, 1.0, 17)


def straight(count: int = 1) -> np.ndarray:
    """(E, 4, 3) struts of 80 mm along x, 50 mm apart."""
    starts = np.column_stack([np.zeros(count), 50.0 * np.arange(count), np.zeros(count)])
    return bezier.straight(starts, starts + np.array([80.0, 0.0, 0.0]))


def test_a_shift_across_the_struts_is_the_distance_everywhere() -> None:
    found = compare_struts(straight(3), straight(3) + np.array([0.0, 3.0, 4.0]))
    np.testing.assert_allclose(found.distance, 5.0, rtol=1e-12)
    assert found.mean == pytest.approx(5.0) and found.largest == pytest.approx(5.0)


def test_a_slide_along_a_strut_shows_at_its_end_alone() -> None:
    found = compare_struts(straight(), straight() + np.array([8.0, 0.0, 0.0]))
    np.testing.assert_allclose(found.distance[0], np.maximum(80.0 * U + 8.0 - 80.0, 0.0), atol=1e-9)
    assert found.largest == pytest.approx(8.0)


def test_a_turn_about_an_end_grows_with_the_distance_from_it() -> None:
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    found = compare_struts(straight(), straight() @ turn.T)
    np.testing.assert_allclose(found.distance[0], 80.0 * U * np.sin(angle), atol=1e-9)
    assert found.mean == pytest.approx(40.0 * np.sin(angle))


def test_a_bow_is_as_far_as_it_is_deep() -> None:
    bowed = straight()
    bowed[0, 1:3, 2] -= 4.0  # 3/4 of which is the depth of the curve, -12 u (1 - u)
    found = compare_struts(straight(), bowed)
    np.testing.assert_allclose(found.distance[0], 12.0 * U * (1.0 - U), atol=1e-9)
    assert found.largest == pytest.approx(3.0)


def test_struts_that_are_not_on_both_sides_are_left_out() -> None:
    moved = straight(4) + np.array([1.0, 7.0, 3.0, 5.0])[:, None, None] * [0.0, 0.0, 1.0]
    found = compare_struts(straight(4), moved, np.array([True, False, True, True]))
    assert found.compared.tolist() == [True, False, True, True] and np.isnan(found.of_strut[1])
    assert found.moved_most(2).tolist() == [3, 2] and found.moved_most(9).tolist() == [3, 2, 0]
    assert found.mean == pytest.approx(3.0) and found.largest == pytest.approx(5.0)
    nothing = compare_struts(straight(4), moved, np.zeros(4, dtype=bool))
    assert np.isnan(nothing.mean) and np.isnan(nothing.largest) and not len(nothing.moved_most(3))


def test_the_distance_from_a_bent_curve_is_that_of_a_fine_polyline() -> None:
    rng = np.random.default_rng(4)
    curves = straight(40) + rng.normal(scale=15.0, size=(40, 4, 3))
    points = bezier.evaluate(curves, np.array([0.5]))[:, 0] + rng.normal(scale=20.0, size=(40, 3))
    fine = bezier.evaluate(curves, np.linspace(0.0, 1.0, 20001))
    wanted = np.linalg.norm(fine - points[:, None], axis=-1).min(axis=1)
    np.testing.assert_allclose(distances_to_curves(points, curves), wanted, atol=1e-4)


def test_other_struts_are_refused() -> None:
    frame = tower()
    check_comparable(frame, frame.replace(radius=2.0 * frame.radius), "A")
    other, _ = frame.subset(np.arange(frame.strut_count) > 0)
    with pytest.raises(InputError, match="A: struts: has .* choose another twin of the same plan"):
        check_comparable(other, frame, "A")
