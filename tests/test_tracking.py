"""A twin that follows a stream: it stays with a known motion, through arms, falls and bumped cameras."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
import pytest
from stream_cases import STEP, MovingPrint, with_arm

import frametwin
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.tracking.events import Event
from frametwin.tracking.evidence import Evidence
from frametwin.tracking.watches import JointWatch, Lasting, StrutWatch, Switch

RIM = 20
"""A joint of the bowl's rim."""


class Run:
    """A tracker and the truth beside it."""

    def __init__(self, moving: MovingPrint, **options: object) -> None:
        self.moving, self.time = moving, 0.0
        self.tracker = frametwin.Tracker(moving.plan, moving.cameras, **options)  # type: ignore[arg-type]
        self.events: list[Event] = []
        self.by: Sequence[float] = (0.0, 0.0, 0.0)

    def show(
        self,
        *leans: Sequence[float],
        without: Collection[int] = (),
        edit: Callable[[list[np.ndarray]], None] = lambda pictures: None,
    ) -> list[Event]:
        """One moment for each lean of the rim; what was told meanwhile."""
        told: list[Event] = []
        for by in leans:
            pictures = self.moving.pictures(by, without)
            edit(pictures)
            found = self.tracker.follow(pictures, self.time)
            self.time += STEP
            self.by = by
            told += found.events
        self.events += told
        return told

    def error(self, without: Collection[int] = ()) -> float:
        """Largest distance in radii at equal parameters from the struts that are really there."""
        real = self.moving.at(self.by, without)
        u = np.linspace(0.0, 1.0, 9)
        off = bezier.evaluate(self.tracker.control_points, u) - bezier.evaluate(real.control_points, u)
        return float(np.linalg.norm(off, axis=2)[real.printed].max() / real.radius[0])


def line(start: float, end: float, moments: int) -> list[tuple[float, float, float]]:
    return [(x, 0.3 * x, -0.1 * x) for x in np.linspace(start, end, moments)]


def kinds(events: Sequence[Event]) -> set[str]:
    return {event.kind for event in events}


@pytest.fixture(scope="module")
def moving() -> MovingPrint:
    return MovingPrint()


def test_it_stays_with_a_print_that_leans_and_tells_of_every_millimetre(moving: MovingPrint) -> None:
    run = Run(moving)
    told = run.show(*line(0.0, 4.0, 11), (4.0, 1.2, -0.4), (4.0, 1.2, -0.4))
    assert run.error() < 0.2
    assert kinds(told) == {"moved", "clear"}
    moved = [event for event in told if event.kind == "moved"]
    rim = [
        far
        for event in moved
        for joint, far in zip(event.facts["joints"], event.facts["distances"], strict=True)
        if joint == RIM
    ]
    # The rim has gone by 4.2 mm: it is told each time that it has gone by more than one more, soon after.
    assert 2 <= len(rim) <= 4 and all(1.0 < far < 2.4 for far in rim)
    assert not any(set(event.facts["joints"]) & set(np.flatnonzero(moving.plan.grounded)) for event in moved)
    (clear,) = (event for event in told if event.kind == "clear")
    assert clear.facts == {"answerable": True, "awaited": []} and clear.time <= 1.0
    assert run.tracker.answerable


def test_a_print_that_stands_still_is_left_alone(moving: MovingPrint) -> None:
    run = Run(moving)
    assert kinds(run.show(*[(0.0, 0.0, 0.0)] * 6)) == {"clear"}
    assert run.error() < 0.2


@pytest.mark.parametrize("colour", [0, 255])
def test_an_arm_over_half_a_view_is_told_and_does_not_pull_the_twin(moving: MovingPrint, colour: int) -> None:
    run = Run(moving)
    run.show(*line(0.0, 0.8, 5))

    def arm(pictures: list[np.ndarray]) -> None:
        for view in (1, 2):
            pictures[view] = with_arm(pictures[view], colour)

    told = run.show(*line(1.0, 2.0, 6), edit=arm)
    assert run.error() < 0.2
    (seen,) = (event for event in told if event.kind == "arm")
    names = [moving.cameras[view].name for view in (1, 2)]
    assert set(seen.facts["views"]) == set(names) and not run.tracker.answerable
    assert kinds(told) <= {"arm", "moved"}
    gone = run.time
    told = run.show(*[(2.0, 0.6, -0.2)] * 6)
    (clear,) = (event for event in told if event.kind == "clear")
    assert clear.facts["answerable"] and clear.time - gone <= 1.0
    assert "fallen" not in kinds(run.events) and run.error() < 0.2


def test_a_sudden_jump_of_several_radii_is_followed_and_told_within_a_second(moving: MovingPrint) -> None:
    run = Run(moving)
    run.show(*[(0.0, 0.0, 0.0)] * 4)
    then = run.time
    told = run.show(*[(7.0, -3.0, 0.0)] * 5)
    assert run.error() < 0.2
    moved = [event for event in told if event.kind == "moved"]
    assert moved[0].time - then <= 1.0
    where = dict(zip(moved[0].facts["joints"], moved[0].facts["positions"], strict=True))
    assert np.linalg.norm(np.array(where[RIM]) - moving.at((7.0, -3.0, 0.0)).vertices[RIM]) < 0.6
    assert not kinds(told) & {"fallen", "view-lost"}


def test_a_fallen_strut_is_told_within_a_second_and_so_is_its_return(moving: MovingPrint) -> None:
    run, strut = Run(moving), 30
    run.show(*[(0.0, 0.0, 0.0)] * 4)
    then = run.time
    (fallen,) = (event for event in run.show(*[(0.0, 0.0, 0.0)] * 5, without=[strut]) if event.kind == "fallen")
    assert fallen.facts["struts"] == [strut] and fallen.time - then <= 1.0
    twin = run.tracker.result().twin
    assert frametwin.missing_struts(twin, moving.plan.printed).tolist() == [strut]
    assert run.error([strut]) < 0.2
    told = run.show(*[(0.0, 0.0, 0.0)] * 5)
    assert [event.facts["struts"] for event in told if event.kind == "returned"] == [[strut]]
    assert not kinds(run.events) & {"arm", "moved"}


def test_a_strut_behind_an_arm_has_not_fallen(moving: MovingPrint) -> None:
    """An arm that hides a strut from half of the views is no evidence against it."""
    run = Run(moving)
    run.show(*[(0.0, 0.0, 0.0)] * 3)

    def arm(pictures: list[np.ndarray]) -> None:
        for view in (0, 1, 2):
            pictures[view] = with_arm(pictures[view], 0)

    assert "fallen" not in kinds(run.show(*[(0.0, 0.0, 0.0)] * 5, edit=arm))
    assert run.error() < 0.5  # half of the frame is seen from one side alone


def test_struts_of_the_batch_are_awaited_and_told_when_they_are_laid(moving: MovingPrint) -> None:
    new = [36, 37]
    awaited = np.zeros(moving.plan.strut_count, dtype=bool)
    awaited[new] = True
    run = Run(moving, awaited=awaited, batch=3)
    told = run.show(*[(0.0, 0.0, 0.0)] * 5, without=new)
    (clear,) = (event for event in told if event.kind == "clear")
    assert clear.facts == {"answerable": False, "awaited": new, "batch": 3} and "fallen" not in kinds(told)
    assert not run.tracker.standing[new].any()
    told = run.show(*[(0.0, 0.0, 0.0)] * 5, without=[37])
    assert [event.facts["struts"] for event in told if event.kind == "laid"] == [[36]]
    told = run.show(*[(0.0, 0.0, 0.0)] * 5)
    assert [event.facts["struts"] for event in told if event.kind == "laid"] == [[37]]
    last = [event for event in told if event.kind == "clear"][-1]
    assert last.facts["answerable"] and "batch 3 can be answered" in str(last)


def test_a_bumped_camera_is_left_out_and_named(moving: MovingPrint) -> None:
    run = Run(moving)
    run.show(*[(1.0, 0.3, 0.0)] * 4)

    def bump(pictures: list[np.ndarray]) -> None:
        pictures[4] = np.roll(pictures[4], 28, axis=1)

    told = run.show(*line(1.0, 2.0, 13), edit=bump)
    assert run.error() < 0.2
    assert [event.facts["views"] for event in told if event.kind == "view-lost"] == [[moving.cameras[4].name]]
    told = run.show(*[(2.0, 0.6, -0.2)] * 4)
    assert [event.facts["views"] for event in told if event.kind == "view-back"] == [[moving.cameras[4].name]]


def test_cameras_that_give_no_pictures_are_done_without(moving: MovingPrint) -> None:
    run = Run(moving)

    def none(pictures: list[np.ndarray | None]) -> None:
        pictures[0] = None

    run.show(*line(0.0, 1.0, 5), edit=none)  # type: ignore[arg-type]
    assert run.error() < 0.2
    assert run.tracker.follow([None] * 6, 9.0).views == ()


def test_dark_pictures_move_nothing_and_a_camera_that_stays_dark_is_told(moving: MovingPrint) -> None:
    run = Run(moving)

    def all_dark(pictures: list[np.ndarray]) -> None:
        noise = np.random.default_rng(5)
        pictures[:] = [noise.integers(0, 4, picture.shape, dtype=np.uint8) for picture in pictures]

    def one_dark(pictures: list[np.ndarray]) -> None:
        pictures[2] = np.zeros_like(pictures[2])

    told = run.show(*[(0.0, 0.0, 0.0)] * 9, edit=all_dark)
    np.testing.assert_array_equal(run.tracker.vertices, moving.plan.vertices)
    assert not kinds(told) and not run.tracker.has_followed
    told = run.show(*[(0.0, 0.0, 0.0)] * 16, edit=one_dark)
    assert run.error() < 0.2 and run.tracker.standing.all() and kinds(told) == {"view-lost", "clear"}
    assert [event.facts["views"] for event in told if event.kind == "view-lost"] == [[moving.cameras[2].name]]
    assert told[-1].kind == "clear" and run.tracker.answerable


def test_a_rig_of_four_goes_on_without_one_of_them() -> None:
    run, strut = Run(MovingPrint(views=4)), 10

    def none(pictures: list[np.ndarray | None]) -> None:
        pictures[3] = None

    run.show(*[(0.0, 0.0, 0.0)] * 4)
    told = run.show(*[(0.0, 0.0, 0.0)] * 13, without=[strut], edit=none)  # type: ignore[arg-type]
    assert [event.facts["struts"] for event in told if event.kind == "fallen"] == [[strut]]
    assert [event.facts["views"] for event in told if event.kind == "view-lost"] == [[run.moving.cameras[3].name]]


def test_photographs_are_compared_with_the_views_before_printing(moving: MovingPrint) -> None:
    rng = np.random.default_rng(4)
    before = [rng.integers(30, 70, (*moving.size, 3), dtype=np.uint8) for _ in moving.cameras]
    run = Run(moving, backgrounds=before)

    def paint(pictures: list[np.ndarray]) -> None:
        for view, mask in enumerate(pictures):
            pictures[view] = np.where(mask[..., None] > 0, np.uint8(215), before[view])

    told = run.show(*line(0.0, 3.0, 9), (3.0, 0.9, -0.3), edit=paint)
    assert run.error() < 0.3 and kinds(told) == {"moved", "clear"}  # outlines to half a reduced pixel


def test_the_result_is_a_run_that_is_read_like_any_other(moving: MovingPrint) -> None:
    run = Run(moving)
    run.show(*line(0.0, 2.0, 6), (2.0, 0.6, -0.2))
    result = run.tracker.result()
    np.testing.assert_array_equal(result.twin.vertices, run.tracker.vertices)
    assert result.twin.verdict.status == "good" and result.twin.completeness.min() == 1.0
    real = moving.at(run.by)
    moved = moving.plan.vertices + result.field.evaluate(moving.plan.vertices)
    assert np.linalg.norm(moved - real.vertices, axis=1).mean() < 0.3
    again = Run(moving, twin=result.twin)
    again.show((2.0, 0.6, -0.2))
    assert again.error() < 0.2


def test_what_cannot_be_followed_is_refused(moving: MovingPrint) -> None:
    cameras = moving.cameras
    with pytest.raises(InputError, match="two or more"):
        frametwin.Tracker(moving.plan, cameras[:1])
    nothing = moving.plan.replace(printed=np.zeros(moving.plan.strut_count, dtype=bool))
    with pytest.raises(InputError, match="marks no strut"):
        frametwin.Tracker(nothing, cameras)
    tracker = frametwin.Tracker(moving.plan, cameras)
    with pytest.raises(InputError, match="5 pictures for 6 cameras"):
        tracker.follow(moving.pictures((0.0, 0.0, 0.0))[:5])
    with pytest.raises(InputError, match=f"{cameras[0].name}: size: is 40 x 30 pixels"):
        tracker.follow([np.zeros((30, 40), dtype=np.uint8)] * 6)
    with pytest.raises(InputError, match="threshold"):
        frametwin.TrackSettings(threshold=0.0)
    with pytest.raises(ValueError, match="no pictures"):
        tracker.result()


# --- what has to last


def test_a_condition_counts_once_it_has_held_without_a_break() -> None:
    lasting = Lasting(2, least=0.4)
    seen = [(0.0, [1, 1]), (0.2, [1, 0]), (0.4, [1, 1]), (0.6, [1, 1]), (0.8, [0, 1])]
    held = [lasting.hold(np.array(on, dtype=bool), time).tolist() for time, on in seen]
    assert held == [[False, False], [False, False], [True, False], [True, False], [False, True]]
    assert not Lasting(1, least=0.0).hold(np.array([True]), 5.0).any()  # a single look proves nothing


def test_a_switch_goes_on_and_off_after_its_own_time() -> None:
    switch = Switch(1, on_after=0.1, off_after=0.5)
    told = []
    for time, on in [(0.0, 1), (0.2, 1), (0.4, 0), (0.6, 0), (0.8, 1), (1.0, 0), (1.2, 0), (1.4, 0), (1.6, 0)]:
        rise, fall = switch.look(np.array([bool(on)]), time)
        told.append((len(rise), len(fall)))
    assert told.index((1, 0)) == 1 and told.index((0, 1)) == 8 and sum(map(sum, told)) == 2


def test_struts_and_joints_are_told_once() -> None:
    struts = StrutWatch(np.array([False, True]), patience=0.2)
    looks = [struts.look(np.array([1.0, 1.0]), np.array([0.0, 0.0]), t) for t in (0.0, 0.2, 0.4, 0.6)]
    assert [list(look) for look in looks] == [[], ["fallen"], [], []] and struts.awaited.tolist() == [False, True]
    joints = JointWatch(np.zeros((2, 3)), threshold=1.0, patience=0.2)
    there = np.array([[1.5, 0.0, 0.0], [5.0, 0.0, 0.0]])
    told = [joints.look(there, np.array([True, False]), t) for t in (0.0, 0.2, 0.4, 0.6)]
    assert [moved.tolist() for moved, _ in told] == [[], [0], [], []] and told[1][1].tolist() == [1.5]


def test_views_vote_on_pieces_that_they_have_in_plain_view() -> None:
    """Of four views one sees nothing of the piece; two of the other three show it."""
    weight = np.array([10.0, 10.0, 10.0, 0.1]).reshape(4, 1, 1)
    evidence = Evidence(weight, np.array([1.0, 0.9, 0.0, 0.0]).reshape(4, 1, 1))
    assert evidence.there.tolist() == [1.0] and evidence.gone.tolist() == [0.0]
    assert evidence.hidden.ravel().tolist() == [False, False, True, False]
    dark = Evidence(weight, np.array([0.1, 0.0, 0.0, 1.0]).reshape(4, 1, 1))
    assert dark.gone.tolist() == [1.0] and not dark.hidden.any()
    lonely = dark.of_views(np.array([True, False, False, True]))
    assert lonely.gone.tolist() == [0.0]  # one view alone is not believed
