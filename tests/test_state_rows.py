"""The Kalman filter on the rows of a state that take part in a batch, beside one on the whole state."""

from __future__ import annotations

import numpy as np

from frametwin.printing.adaptation.state_covariance import StateCovariance
from frametwin.printing.adaptation.state_rows import MOST_OFF, StateRows

VALUES, JOINTS = 400, 60
TOLD = np.arange(0, VALUES, 2)
THERE = np.arange(5, JOINTS, 2)


def some_covariance(size: int, rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(size, size)) / np.sqrt(size)
    return root @ root.T + 0.1 * np.eye(size)


def started(rng: np.random.Generator) -> StateCovariance:
    """Of a state some rows of which depend on each other."""
    size = VALUES + 3 + 3 * JOINTS
    rows = np.sort(rng.choice(size, size=120, replace=False))
    return StateCovariance(rows, some_covariance(len(rows), rng), rng.uniform(0.5, 2.0, size=size))


def whole(covariance: StateCovariance) -> np.ndarray:
    return covariance.of(np.arange(len(covariance)))


def test_rows_that_depend_on_no_other_have_their_own_variance() -> None:
    covariance = started(np.random.default_rng(0))
    matrix = whole(covariance)
    np.testing.assert_array_equal(np.diag(matrix), covariance.variance)
    np.testing.assert_array_equal(matrix[np.ix_(covariance.rows, covariance.rows)], covariance.among)
    others = np.setdiff1d(np.arange(len(covariance)), covariance.rows)
    assert np.count_nonzero(matrix[others]) == len(others)
    some = np.arange(3, len(covariance), 3)
    np.testing.assert_array_equal(covariance.of(some), matrix[np.ix_(some, some)])


def test_rows_can_be_made_independent() -> None:
    covariance = started(np.random.default_rng(1))
    rows = np.concatenate([covariance.rows[10:20], [0, 7]])
    changed, matrix = whole(covariance.with_independent(rows, 0.3)), whole(covariance)
    matrix[rows], matrix[:, rows] = 0.0, 0.0
    matrix[rows, rows] = 0.3
    np.testing.assert_array_equal(changed, matrix)


def test_a_batch_and_its_twin_are_those_of_the_filter_on_the_whole_state() -> None:
    rng = np.random.default_rng(2)
    covariance = started(rng)
    place = StateRows.of(covariance, TOLD, THERE, 3 * JOINTS)
    assert set(TOLD) | set(covariance.rows[covariance.rows < VALUES]) == set(place.values)
    slope, missed = rng.normal(size=(3 * len(THERE), len(place.values))), rng.uniform(0.1, 0.2, size=3 * len(THERE))
    seen = np.repeat(rng.uniform(size=len(THERE)) < 0.8, 3)
    left = rng.normal(size=int(seen.sum()))
    left[:3] = 50.0  # one joint is seen far off

    size, first = len(covariance), VALUES + 3
    joints = (first + 3 * THERE[:, None] + np.arange(3)).ravel()
    transition, gained = np.eye(size), np.zeros(size)
    transition[np.ix_(joints, place.values)] = slope
    gained[joints], gained[VALUES:first] = missed, 0.01
    carried = transition @ whole(covariance) @ transition.T + np.diag(gained)
    sees = np.zeros((len(left), size))
    sees[np.arange(len(left)), joints[seen]] = 1.0
    sees[np.arange(len(left)), VALUES + np.arange(len(left)) % 3] = 1.0
    inner = sees @ carried @ sees.T
    own = 0.05 + np.repeat(
        np.maximum(
            (left.reshape(-1, 3) ** 2).mean(axis=1) / MOST_OFF**2 - (np.diag(inner).reshape(-1, 3).mean(axis=1) + 0.05),
            0.0,
        ),
        3,
    )
    gain = carried @ sees.T @ np.linalg.inv(inner + np.diag(own))
    assert own[0] > 100.0

    before = covariance.of(place.active)
    found = place.carried(before, slope, 0.01, missed)
    twin = found.seen(seen, left, 0.05)
    np.testing.assert_allclose(twin.change, (gain @ left)[place.active], atol=1e-9)
    after = carried - gain @ sees @ carried
    corrected = twin.corrected(before, found)
    np.testing.assert_allclose(corrected, after[np.ix_(place.active, place.active)], atol=1e-9)
    np.testing.assert_array_equal(corrected, corrected.T)


def test_a_batch_that_nobody_saw_is_carried_alone() -> None:
    rng = np.random.default_rng(3)
    covariance = started(rng)
    place = StateRows.of(covariance, TOLD, THERE, 3 * JOINTS)
    before = covariance.of(place.active)
    nothing = place.carried(before, np.zeros((3 * len(THERE), len(place.values))), 0.0, np.zeros(3 * len(THERE)))
    twin = nothing.seen(np.zeros(3 * len(THERE), dtype=bool), np.zeros(0), 0.05)
    assert not twin.change.any()
    np.testing.assert_array_equal(twin.corrected(before.copy(), nothing), before)
