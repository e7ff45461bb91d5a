"""The drift of a print is carried on, so that struts are laid where their joints will be."""

from __future__ import annotations

import numpy as np
import pytest
from print_physics import lowest_first, print_with_right_twins

from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.anticipation import Anticipation, drift_rate
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.simulation.growth import GrowingPrint

STRUTS = 8
BATCHES = 10
OLD, YOUNG, NEW = slice(0, 20), slice(20, 30), slice(30, 40)


def drifting(shares: list[float], struts: list[int], seed: int = 0) -> list[Observation]:
    """Batches in which each joint moves on by a share of what it moved in the batch before, for each strut laid."""
    drift = np.random.default_rng(seed).normal(size=(20, 3))
    seen = []
    for k, count in enumerate(struts):
        drift = drift if k == 0 else shares[k - 1] * drift
        seen.append(Observation(k, drift * count, np.ones(20, dtype=bool), count))
    return seen


@pytest.mark.parametrize("share", [1.0, 0.6, 0.1])
def test_what_moves_steadily_is_expected_to_go_on(share: float) -> None:
    seen = drifting([share] * 3, [8, 8, 4, 12])
    rate = drift_rate(seen)
    assert rate is not None
    np.testing.assert_allclose(rate, share * seen[-1].drift / 12, rtol=1e-9)


def test_new_joints_and_old_ones_have_each_their_own_share() -> None:
    """New joints come to rest by 0.3, older ones by 0.8 from batch to batch."""
    rng, seen = np.random.default_rng(1), []
    known, fresh, drift = np.zeros(40, dtype=bool), np.zeros(40, dtype=bool), np.zeros((40, 3))
    for k, part in enumerate((OLD, YOUNG, NEW)):
        drift = np.where(fresh, 0.3, 0.8)[:, None] * drift
        fresh = np.zeros(40, dtype=bool)
        fresh[part] = True
        drift[part] = rng.normal(size=drift[part].shape)
        known = known | fresh
        seen.append(Observation(k, drift * STRUTS, known, STRUTS))
    rate = drift_rate(seen)
    assert rate is not None
    np.testing.assert_allclose(rate[OLD], 0.8 * drift[OLD], rtol=1e-9)
    np.testing.assert_allclose(rate[NEW], 0.3 * drift[NEW], rtol=1e-9)


def test_what_gathers_speed_is_not_expected_to_run_away() -> None:
    seen = drifting([3.0, 3.0], [8, 8, 8])
    rate = drift_rate(seen)
    assert rate is not None
    np.testing.assert_allclose(rate, seen[-1].drift / 8)


def test_nothing_is_expected_of_what_stands_still_or_of_noise() -> None:
    assert drift_rate([]) is None and drift_rate(drifting([], [8])) is None
    assert drift_rate(drifting([0.0, 0.0], [8, 8, 8])) is None
    rng = np.random.default_rng(0)
    noise = [Observation(k, rng.normal(size=(50, 3)), np.ones(50, dtype=bool), 8) for k in range(4)]
    assert drift_rate(noise) is None
    unseen = [Observation(k, np.ones((5, 3)), np.zeros(5, dtype=bool), 8) for k in range(4)]
    assert drift_rate(unseen) is None


@pytest.fixture
def fork() -> tuple[Wireframe, PrintSequence]:
    """A post that stands; two arms from its top to new joints, and a strut between those."""
    vertices = [[0, 0, 0], [0, 0, 10], [10, 0, 10], [0, 10, 10]]
    frame = Wireframe.create(vertices, [[0, 1], [1, 2], [3, 1], [2, 3]], printed=[True, False, False, False])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    return frame, PrintSequence(np.array([1, 2, 3]), np.array([1, 1, 2]), up, np.zeros(3, dtype=int))


def test_struts_are_laid_where_their_joints_will_be(fork: tuple[Wireframe, PrintSequence]) -> None:
    frame, laying = fork
    rate = np.zeros((4, 3))
    rate[1] = [0.2, 0.0, -0.1]
    ahead = Anticipation.of(frame, laying, rate)
    ends = ahead.curves()[:, [0, 3]]
    np.testing.assert_allclose(ends[0], [[0.1, 0, 9.95], [10, 0, 10]])  # laid after half a strut's time, at a new joint
    np.testing.assert_allclose(ends[1], [[0.3, 0, 9.85], [0, 10, 10]])
    # Both new joints hang on the post's top and go with it: one for two struts' time, the other for one.
    np.testing.assert_allclose(ends[2], [[10.4, 0, 9.8], [0.2, 10, 9.9]])
    after = ahead.frame(3.0)
    np.testing.assert_allclose(after.vertices - frame.vertices, np.array([[0.0], [3], [2.5], [1.5]]) * rate[1])
    assert np.array_equal(after.control_points[:, 0], after.vertices[after.edges[:, 0]])
    assert after.is_straight


def test_a_print_that_stands_still_is_followed_to_the_last_bit(fork: tuple[Wireframe, PrintSequence]) -> None:
    frame, laying = fork
    for rate in (None, np.zeros((4, 3))):
        ahead = Anticipation.of(frame, laying, rate)
        assert ahead.frame(3.0) is frame
        assert np.array_equal(ahead.curves(), laying.directed_curves(frame))


class MeasuredPrint(GrowingPrint):
    """Notes how far from its joint each bead was set."""

    def __init__(self, *arguments: object, **options: object) -> None:
        super().__init__(*arguments, **options)  # type: ignore[arg-type]
        self.gaps: list[float] = []

    def _sticks(self, joint: int, point: np.ndarray, bead: float) -> bool:
        if self._born[joint] and not self.design.grounded[joint]:
            self.gaps.append(float(np.linalg.norm(point - self._points[joint])) / bead)
        return super()._sticks(joint, point, bead)


@pytest.mark.parametrize("seed", [0, 1])
def test_struts_of_a_simulated_print_are_laid_nearer_to_their_joints(seed: int) -> None:
    frame = named_frame("bridge")
    sequence = lowest_first(frame, BATCHES)
    exact = PrintSettings(placement=0.0)
    still, ahead = (MeasuredPrint(frame, sequence, exact, seed) for _ in range(2))
    print_with_right_twins(still)
    print_with_right_twins(ahead, anticipates=True)
    assert np.mean(ahead.gaps) < 0.8 * np.mean(still.gaps)
    assert np.linalg.norm(ahead.gaps) < 0.8 * np.linalg.norm(still.gaps)  # no few that are missed the more
