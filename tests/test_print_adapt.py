"""Plans moved to meet the print: the paper's three cases in closed form, batch after batch, and doubtful twins."""

from __future__ import annotations

import numpy as np
import pytest
from print_physics import Formula, twin_at

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.adapt import AdaptSettings, adapt, lost_struts
from frametwin.printing.adaptation.plate import feet_on_plate
from frametwin.twin.twin import Twin

U = np.linspace(0.0, 1.0, 13)
LEFT, RIGHT, BRIDGING, ENDING, FAR = 0, 1, 2, 3, 4
"""Two printed struts, one between their tops, one from a free joint to the left top, and one beyond."""


def plan(bend: float = 1.5) -> Wireframe:
    vertices = [[0, 0, 0], [40, 0, 0], [3, 5, 30], [38, 4, 32], [20, 30, 55], [60, 40, 60]]
    frame = Wireframe.create(
        np.array(vertices, dtype=float),
        [[0, 2], [1, 3], [2, 3], [4, 2], [4, 5]],
        radius=1.0,
        printed=[True, True, False, False, False],
    )
    curves = frame.control_points.copy()
    curves[:, 1:3] += bend * np.random.default_rng(1).normal(size=(5, 2, 3))
    return frame.replace(control_points=curves)


def moved(frame: Wireframe, field: Formula, **doubts: np.ndarray) -> Twin:
    """The right twin of a print that moved with an affine field."""
    curves = frame.control_points + field.evaluate(frame.control_points.reshape(-1, 3)).reshape(-1, 4, 3)
    return twin_at(frame.vertices + field.evaluate(frame.vertices), curves, **doubts)


def affine(matrix: np.ndarray, shift: np.ndarray) -> Formula:
    return Formula(lambda points: points @ matrix.T + shift)


SHIFT = affine(np.zeros((3, 3)), np.array([1.2, -0.7, -2.5]))
TURN = affine(rotation_matrices(np.array([0.05, -0.1, 0.2])) - np.eye(3), np.array([0.3, 0.0, -1.0]))
LINEAR = affine(np.random.default_rng(2).normal(scale=0.03, size=(3, 3)), np.zeros(3))


def test_where_nothing_moved_the_plan_is_the_same_bits() -> None:
    frame = plan()
    nothing = Formula(np.zeros_like)
    again = adapt(frame, twin_at(frame.vertices, frame.control_points), nothing)
    np.testing.assert_array_equal(again.vertices, frame.vertices)
    np.testing.assert_array_equal(again.control_points, frame.control_points)
    np.testing.assert_array_equal(again.printed, frame.printed)


@pytest.mark.parametrize("field", [SHIFT, TURN, LINEAR])
def test_each_case_of_the_paper(field: Formula) -> None:
    frame = plan()
    found = bezier.evaluate(adapt(frame, moved(frame, field), field).control_points, U)
    points = bezier.evaluate(frame.control_points, U)
    carried = points + field.evaluate(points.reshape(-1, 3)).reshape(points.shape)
    np.testing.assert_allclose(found[[LEFT, RIGHT, BRIDGING]], carried[[LEFT, RIGHT, BRIDGING]], atol=1e-9)
    np.testing.assert_array_equal(found[FAR], points[FAR])
    blended = (1.0 - U[:, None]) * points[ENDING] + U[:, None] * carried[ENDING]
    # A strut that bends and turns at once is of a degree above three; a shift is met to the last digits.
    np.testing.assert_allclose(found[ENDING], blended, atol=1e-9 if field is SHIFT else 0.1)
    np.testing.assert_allclose(found[ENDING][[0, -1]], blended[[0, -1]], atol=1e-9)


def test_a_rigid_motion_leaves_the_shape_of_struts_between_printed_joints() -> None:
    frame = plan()
    after = adapt(frame, moved(frame, TURN), TURN)
    struts = [LEFT, RIGHT, BRIDGING]
    np.testing.assert_allclose(after.lengths[struts], frame.lengths[struts], rtol=1e-9)


def test_batches_in_a_row_are_as_good_as_one() -> None:
    frame = plan()
    one, other = SHIFT, affine(np.zeros((3, 3)), np.array([-0.4, 2.0, -0.9]))
    first = adapt(frame, moved(frame, one), one)
    second = adapt(first, moved(first, other), other)
    both = Formula(lambda points: one.evaluate(points) + other.evaluate(points))
    at_once = adapt(frame, moved(frame, both), both)
    np.testing.assert_allclose(second.control_points, at_once.control_points, atol=1e-9)


def test_turns_in_a_row_are_their_product() -> None:
    frame = plan()
    first = adapt(frame, moved(frame, TURN), TURN)
    second = adapt(first, moved(first, LINEAR), LINEAR)
    both = Formula(lambda p: TURN.evaluate(p) + LINEAR.evaluate(p + TURN.evaluate(p)))
    at_once = adapt(frame, moved(frame, both), both)
    np.testing.assert_allclose(second.control_points[BRIDGING], at_once.control_points[BRIDGING], atol=1e-9)


def test_twenty_batches_without_motion_do_not_drift() -> None:
    frame = adapt(plan(), moved(plan(), TURN), TURN)
    again = frame
    for _ in range(20):
        again = adapt(again, twin_at(again.vertices, again.control_points), Formula(np.zeros_like))
    np.testing.assert_array_equal(again.control_points, frame.control_points)


def test_joints_close_to_the_last_bit() -> None:
    after = adapt(plan(), moved(plan(), LINEAR), TURN)
    for side, corner in ((0, 0), (1, 3)):
        np.testing.assert_array_equal(after.control_points[:, corner], after.vertices[after.edges[:, side]])


def test_a_lost_strut_holds_nothing() -> None:
    frame = plan()
    twin = moved(frame, SHIFT, completeness=np.array([0.1, 1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(lost_struts(frame, twin), [LEFT])
    after = adapt(frame, twin, SHIFT)
    np.testing.assert_array_equal(after.printed, [False, True, False, False, False])
    np.testing.assert_array_equal(after.vertices[2], frame.vertices[2])
    np.testing.assert_array_equal(after.control_points[ENDING], frame.control_points[ENDING])
    found = bezier.evaluate(after.control_points[BRIDGING], U)  # held at one end only now
    wanted = bezier.evaluate(frame.control_points[BRIDGING], U) + U[:, None] * SHIFT.evaluate(np.zeros((1, 3)))
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_a_lost_strut_at_a_joint_that_stands_moves_with_it() -> None:
    frame = plan().replace(printed=[True, True, True, False, False])
    after = adapt(frame, moved(frame, SHIFT, completeness=np.array([1.0, 1.0, 0.2, 0.0, 0.0])), SHIFT)
    assert not after.printed[BRIDGING]
    np.testing.assert_allclose(after.vertices[[2, 3]], frame.vertices[[2, 3]] + SHIFT.evaluate(np.zeros((1, 3))))


def test_a_twin_in_doubt_does_not_poison_its_joint() -> None:
    frame = plan()
    right = moved(frame, SHIFT)
    curves, vertices = np.array(right.control_points), np.array(right.vertices)
    vertices[2] += [50.0, 80.0, -90.0]  # nonsense about the left strut, which the views do not show
    curves[LEFT, 1:] += [50.0, 80.0, -90.0]
    curves[[BRIDGING, ENDING], [0, 3]] = vertices[2]
    doubt = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
    after = adapt(frame, twin_at(vertices, curves, confidence=doubt), SHIFT)
    wanted = adapt(frame, right, SHIFT)
    np.testing.assert_allclose(after.control_points, wanted.control_points, atol=1e-9)
    np.testing.assert_array_equal(after.printed, frame.printed)


def test_nothing_that_stands_leaves_the_plan_alone() -> None:
    frame = plan()
    after = adapt(frame, moved(frame, SHIFT, completeness=np.zeros(5)), SHIFT)
    assert not after.printed.any()
    np.testing.assert_array_equal(after.control_points, frame.control_points)


def test_twins_of_other_frames_are_refused() -> None:
    frame = plan()
    with pytest.raises(InputError, match="5 struts and 6 vertices"):
        adapt(frame, twin_at(frame.vertices[:4], frame.control_points[:3]), SHIFT)
    with pytest.raises(InputError, match="completeness"):
        AdaptSettings(completeness=1.5)


def test_feet_are_where_the_plate_has_them() -> None:
    """What fits are off at feet does not add up from batch to batch."""
    design = plan()
    off = moved(design, SHIFT)
    frame = design.replace(vertices=off.vertices, control_points=off.control_points)
    back = feet_on_plate(frame, design, design.printed_vertices())
    feet = design.grounded
    assert feet.any() and not feet.all()
    np.testing.assert_array_equal(back.vertices[feet], design.vertices[feet])
    np.testing.assert_array_equal(back.vertices[~feet], frame.vertices[~feet])
    # A strut keeps its shape but for what its foot moves, in proportion.
    np.testing.assert_allclose(
        bezier.evaluate(back.control_points[LEFT], U) - bezier.evaluate(frame.control_points[LEFT], U),
        np.outer(1.0 - U, design.vertices[0] - frame.vertices[0]),
        atol=1e-9,
    )
    np.testing.assert_array_equal(back.control_points[BRIDGING], frame.control_points[BRIDGING])
    assert feet_on_plate(design, design, feet) is design
    nobody = np.zeros(design.vertex_count, dtype=bool)
    assert feet_on_plate(frame, design, nobody) is frame
