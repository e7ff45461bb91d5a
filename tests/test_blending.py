"""Unprinted struts against the formulas of the paper's three cases (section III.B)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.blending import blend

PRINTED = np.array([True, True, True, False, False, False, False, False])
BRIDGING, ENDING, STARTING, FAR = 3, 4, 5, (6, 7)
"""Struts between two printed joints, from a free joint to a printed one, the other way round, and beyond."""

U = np.linspace(0.0, 1.0, 21)
Displacement = Callable[[np.ndarray], np.ndarray]


def plan(bend: float = 0.0) -> Wireframe:
    vertices = [[0, 0, 0], [30, 2, 1], [3, 28, 2], [5, 6, 25], [31, 4, 27], [2, 30, 29], [33, 33, 31]]
    edges = [[0, 1], [0, 2], [0, 3], [1, 2], [4, 1], [3, 5], [5, 6], [6, 4]]
    frame = Wireframe.create(np.array(vertices, dtype=float), edges, radius=0.8, printed=PRINTED)
    curves = frame.control_points.copy()
    curves[:, 1:3] += bend * np.random.default_rng(0).normal(size=(len(edges), 2, 3))
    return frame.replace(control_points=curves)


def affine(points: np.ndarray) -> np.ndarray:
    matrix = np.array([[0.02, -0.05, 0.01], [0.03, -0.01, 0.04], [-0.02, 0.01, -0.06]])
    return points @ matrix + [1.0, -2.0, 0.5]


def constant(points: np.ndarray) -> np.ndarray:
    return np.tile([1.3, -0.4, 2.1], (len(points), 1))


def nothing(points: np.ndarray) -> np.ndarray:
    return np.zeros_like(points)


def twin_of(frame: Wireframe, displacement: Displacement) -> tuple[np.ndarray, np.ndarray]:
    """What the twin knows: the printed struts, moved, and nothing of the others."""
    vertices = np.full(frame.vertices.shape, np.nan)
    joints = frame.printed_vertices()
    vertices[joints] = frame.vertices[joints] + displacement(frame.vertices[joints])
    curves = np.full(frame.control_points.shape, np.nan)
    for k in np.flatnonzero(frame.printed):
        curves[k] = frame.control_points[k] + displacement(frame.control_points[k])
    return vertices, curves


def blended(
    frame: Wireframe, displacement: Displacement, field: Displacement | None = None
) -> tuple[np.ndarray, np.ndarray]:
    return blend(frame, *twin_of(frame, displacement), field or displacement)


@pytest.mark.parametrize(("field", "bend"), [(affine, 0.0), (constant, 0.0), (constant, 2.0), (affine, 2.0)])
def test_between_printed_joints_a_strut_moves_with_the_field(field: Displacement, bend: float) -> None:
    frame = plan(bend)
    curve = bezier.evaluate(blended(frame, field)[1][BRIDGING], U)
    points = bezier.evaluate(frame.control_points[BRIDGING], U)
    np.testing.assert_allclose(curve, points + field(points), atol=1e-9)


@pytest.mark.parametrize(("field", "bend"), [(affine, 0.0), (constant, 0.0), (constant, 2.0)])
def test_a_strut_with_a_free_end_takes_the_growing_share_of_the_field(field: Displacement, bend: float) -> None:
    frame = plan(bend)
    curves = blended(frame, field)[1]
    for strut, share in ((ENDING, U), (STARTING, 1.0 - U)):  # u runs from the free end to the printed one
        points = bezier.evaluate(frame.control_points[strut], U)
        found = bezier.evaluate(curves[strut], U)
        np.testing.assert_allclose(found, points + share[:, None] * field(points), atol=1e-9)


def test_a_curved_field_is_followed_as_nearly_as_a_cubic_can() -> None:
    frame = plan()

    def waves(points: np.ndarray) -> np.ndarray:
        return 0.8 * np.sin(points / 12.0 + [0.0, 1.0, 2.0])

    curves = blended(frame, waves)[1]
    for strut, share in ((BRIDGING, np.ones(21)), (ENDING, U), (STARTING, 1.0 - U)):
        points = bezier.evaluate(frame.control_points[strut], U)
        wanted = points + share[:, None] * waves(points)
        np.testing.assert_allclose(bezier.evaluate(curves[strut], U), wanted, atol=0.05)


@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_struts_far_from_the_print_are_the_same_bits(bend: float) -> None:
    frame = plan(bend)
    vertices, curves = blended(frame, affine)
    np.testing.assert_array_equal(curves[list(FAR)], frame.control_points[list(FAR)])
    free = ~frame.printed_vertices()
    assert free.sum() == 3
    np.testing.assert_array_equal(vertices[free], frame.vertices[free])


@pytest.mark.parametrize("field", [affine, nothing])
def test_printed_struts_are_the_twins_and_every_joint_closes(field: Displacement) -> None:
    frame = plan(2.0)
    twin_vertices, twin_curves = twin_of(frame, affine)
    vertices, curves = blend(frame, twin_vertices, twin_curves, field)
    joints = frame.printed_vertices()
    np.testing.assert_array_equal(vertices[joints], twin_vertices[joints])
    np.testing.assert_array_equal(curves[PRINTED, 1:3], twin_curves[PRINTED, 1:3])
    assert np.isfinite(curves).all()
    for side, corner in ((0, 0), (1, 3)):
        np.testing.assert_array_equal(curves[:, corner], vertices[frame.edges[:, side]])


@pytest.mark.parametrize("bend", [0.0, 2.0])
def test_what_the_field_misses_at_a_joint_is_spread_along_the_strut(bend: float) -> None:
    """The field says nothing at all, so that all of the joints' motion is left over."""
    frame = plan(bend)
    vertices, curves = blended(frame, affine, nothing)
    shift = vertices - frame.vertices
    for strut in (BRIDGING, ENDING, STARTING):
        start, end = frame.edges[strut]
        points = bezier.evaluate(frame.control_points[strut], U)
        wanted = points + (1.0 - U[:, None]) * shift[start] + U[:, None] * shift[end]
        np.testing.assert_allclose(bezier.evaluate(curves[strut], U), wanted, atol=1e-9)
    assert np.abs(shift[frame.edges[BRIDGING]]).min(axis=1).max() > 0.1


def test_the_direction_of_a_strut_does_not_matter() -> None:
    frame = plan(2.0)
    back = frame.replace(edges=frame.edges[:, ::-1], control_points=frame.control_points[:, ::-1])
    np.testing.assert_allclose(blended(back, affine)[1][:, ::-1], blended(frame, affine)[1], atol=1e-9)


def test_a_finished_print_asks_nothing_of_the_field() -> None:
    frame = plan(2.0).replace(printed=np.ones(8, dtype=bool))

    def forbidden(points: np.ndarray) -> np.ndarray:
        raise AssertionError("there is no strut to move")

    vertices, curves = blended(frame, affine, forbidden)
    np.testing.assert_allclose(vertices, frame.vertices + affine(frame.vertices))
    np.testing.assert_allclose(
        curves, frame.control_points + affine(frame.control_points.reshape(-1, 3)).reshape(8, 4, 3), atol=1e-12
    )


def test_inputs_stay_as_they_are() -> None:
    frame = plan(2.0)
    twin_vertices, twin_curves = twin_of(frame, affine)
    copies = twin_vertices.copy(), twin_curves.copy()
    vertices, curves = blend(frame, twin_vertices, twin_curves, affine)
    vertices[:], curves[:] = 0.0, 0.0
    np.testing.assert_array_equal(twin_vertices, copies[0])
    np.testing.assert_array_equal(twin_curves, copies[1])
    assert frame.control_points.any()
