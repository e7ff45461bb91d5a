"""Printing against the sag to come: factors found again, noise told from sag, and a frame nearer to its design."""

from __future__ import annotations

import numpy as np
import pytest
from print_physics import lowest_first, print_with_right_twins, twin_at

from frametwin.errors import InputError
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.compensation import CANDIDATE_MATERIALS, LOAD_DIRECTIONS, SagForecast, compensate
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.process.calibration import linear_drift
from frametwin.printing.simulation.growth import GrowingPrint

BATCHES = 12
CANDIDATE = 3


@pytest.fixture(scope="module")
def bridge() -> Wireframe:
    return named_frame("bridge")


@pytest.fixture(scope="module")
def forecast(bridge: Wireframe) -> SagForecast:
    return SagForecast.build(bridge, lowest_first(bridge, BATCHES))


def seen(forecast: SagForecast, factors: np.ndarray, batches: int, noise: float, seed: int = 0) -> list[Observation]:
    """What twins see of a print that drifts just as forecast, and inaccurately."""
    rng = np.random.default_rng(seed)
    drifts = forecast.drift[:batches, CANDIDATE] @ factors
    known = [np.abs(drift).sum(axis=(1, 2)) > 0.0 for drift in forecast.drift[:batches, CANDIDATE]]
    return [Observation(k, drift + noise * rng.normal(size=drift.shape), known[k]) for k, drift in enumerate(drifts)]


def test_factors_are_found_again(forecast: SagForecast) -> None:
    factors = np.array([0.05, -0.08, 1.3])
    weights, found = forecast.fit(seen(forecast, factors, 8, noise=0.02))
    assert weights[CANDIDATE] > 0.9 and weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(found[CANDIDATE], factors, atol=0.03)


def test_noise_is_not_taken_for_sag(forecast: SagForecast) -> None:
    for seed in range(5):
        _, early = forecast.fit(seen(forecast, np.zeros(3), 1, noise=0.1, seed=seed))
        later = forecast.remaining_drift(seen(forecast, np.zeros(3), 6, noise=0.1, seed=seed), 6)
        np.testing.assert_array_equal(early, 0.0)
        assert np.linalg.norm(later, axis=1).max() < 1.0
    np.testing.assert_array_equal(forecast.remaining_drift([], 0), 0.0)


def test_what_is_to_come_is_the_rest_of_the_whole(bridge: Wireframe, forecast: SagForecast) -> None:
    observed = seen(forecast, np.array([0.0, 0.0, 1.0]), 5, noise=1e-3)
    factors = forecast.fit(observed)[1][CANDIDATE]
    assert factors[2] == pytest.approx(1.0, rel=0.03)
    whole = linear_drift(bridge, lowest_first(bridge, BATCHES), CANDIDATE_MATERIALS[CANDIDATE], LOAD_DIRECTIONS) @ [
        0.0,
        0.0,
        1.0,
    ]
    rest = whole[5:].sum(axis=0)
    np.testing.assert_allclose(forecast.remaining_drift(observed, 5), rest, atol=0.03 * np.abs(rest).max())
    assert rest[:, 2].min() < -0.5 and np.abs(whole[:, bridge.grounded]).max() == 0.0


def test_only_joints_that_are_still_to_be_laid_are_aimed_elsewhere(bridge: Wireframe) -> None:
    printed = lowest_first(bridge, BATCHES).laid_before(5, bridge.strut_count)
    rng = np.random.default_rng(0)
    vertices = bridge.vertices + rng.normal(size=bridge.vertices.shape)
    plan = Wireframe.create(vertices, bridge.edges, radius=bridge.radius, printed=printed, grounded=bridge.grounded)
    remaining = rng.normal(size=vertices.shape)
    after = compensate(plan, bridge, remaining)
    free = ~plan.printed_vertices() & ~bridge.grounded
    assert 5 < free.sum() < len(free) - 5
    np.testing.assert_array_equal(after.vertices[~free], plan.vertices[~free])
    np.testing.assert_allclose(after.vertices[free], (bridge.vertices - remaining)[free])
    np.testing.assert_array_equal(after.control_points[printed], plan.control_points[printed])
    assert after.is_straight  # straight struts between moved ends stay straight
    np.testing.assert_allclose(compensate(after, bridge, remaining).control_points, after.control_points, atol=1e-9)


def test_a_twin_is_seen_where_it_is_sure(bridge: Wireframe) -> None:
    printed = lowest_first(bridge, BATCHES).laid_before(4, bridge.strut_count)
    plan = bridge.replace(printed=printed)
    shift = np.where(bridge.grounded[:, None], 0.0, [0.0, 0.0, -1.0])
    moved = Wireframe.create(bridge.vertices + shift, bridge.edges)
    nobody = twin_at(moved.vertices, moved.control_points, confidence=np.zeros(bridge.strut_count))
    assert not Observation.of(3, plan, nobody).known.any()
    all_of_it = Observation.of(3, plan, twin_at(moved.vertices, moved.control_points))
    np.testing.assert_array_equal(all_of_it.known, plan.printed_vertices() & ~bridge.grounded)
    np.testing.assert_allclose(all_of_it.drift[all_of_it.known], [[0.0, 0.0, -1.0]] * all_of_it.known.sum())


@pytest.mark.parametrize("seed", [0, 1])
def test_a_compensated_print_is_nearer_to_the_design(bridge: Wireframe, forecast: SagForecast, seed: int) -> None:
    sequence = lowest_first(bridge, BATCHES)
    adapted, compensated = (GrowingPrint(bridge, sequence, seed=seed) for _ in range(2))
    print_with_right_twins(adapted)
    print_with_right_twins(compensated, forecast)
    assert compensated.report().completed
    assert compensated.report().mean_deviation < 0.5 * adapted.report().mean_deviation


def test_batches_of_another_print_are_refused(forecast: SagForecast) -> None:
    none = np.zeros(forecast.design.vertex_count, dtype=bool)
    with pytest.raises(InputError, match="batch"):
        forecast.fit([Observation(BATCHES, np.zeros(forecast.design.vertices.shape), none)])
