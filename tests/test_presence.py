"""What is really there, how thick it is, and how well the views tell where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rod_cases import camera_at, level_of, of_frame
from small_frames import tower

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.fitting.confidence import confidence, standard_deviation
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.joint_sizes import learn_joint_sizes
from frametwin.fitting.motion import as_rods, start_pose
from frametwin.fitting.presence import (
    THICKEST,
    THINNEST,
    learn_thickness,
    seen_opacity,
    shortest_gap,
    strut_whiteness,
    without_gaps,
)
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import gauss_newton
from frametwin.raster.silhouette import silhouettes

FRAME = tower()
CAMERAS = ring_rig(FRAME, 6, size=(240, 320))
PIECES = 20


def seen(frame: Wireframe, present: np.ndarray | None = None, cameras: tuple[Camera, ...] = CAMERAS) -> Level:
    masks = [p / np.float32(255) for p in silhouettes(frame, cameras, present=present, supersampling=2)]
    return Pyramid(cameras, masks).level(1.0, 0.7)


def interval(strut: int, start: float, end: float) -> np.ndarray:
    present = np.tile([0.0, 1.0], (FRAME.strut_count, 1))
    present[strut] = [start, end]
    return present


@pytest.mark.parametrize("strut", [2, 13, 16])
def test_a_half_erased_strut_is_half_there(strut: int) -> None:
    drawn = of_frame(FRAME, PIECES)
    opacity, weight = seen_opacity(drawn, seen(FRAME, interval(strut, 0.0, 0.5)))
    assert opacity.shape == weight.shape == (FRAME.strut_count, PIECES)
    assert opacity[strut, 2:9].min() > 0.8
    assert opacity[strut, 12:18].max() < 0.2  # the end is rounded, and the joint's disc hides the last piece
    assert opacity[strut].mean() == pytest.approx(0.5, abs=0.1)
    others = np.delete(opacity.mean(axis=1), strut)
    assert others.min() > 0.85


def test_white_is_what_is_there() -> None:
    drawn = of_frame(FRAME, 6)
    whole = strut_whiteness(drawn, seen(FRAME))
    assert whole.min() > 0.9
    missing = strut_whiteness(drawn, seen(FRAME, interval(16, 0.0, 0.0)))
    assert missing[16] < 0.1
    assert np.delete(missing, 16).min() > 0.85
    half = strut_whiteness(drawn, seen(FRAME, interval(16, 0.0, 0.5)))
    assert half[16] == pytest.approx(0.5, abs=0.1)


def test_what_no_view_shows_is_believed() -> None:
    nowhere = Wireframe.create([[500.0, 0.0, 0.0], [500.0, 20.0, 0.0]], [[0, 1]], radius=1.0)
    level = level_of([camera_at([0.0, -100.0, 0.0], (40, 60), 100.0)])
    opacity, weight = seen_opacity(of_frame(nowhere, 5), level)
    assert not weight.any()
    assert (opacity == 1.0).all()
    assert strut_whiteness(of_frame(nowhere, 5), level) == [1.0]


def test_an_unseen_piece_takes_the_judgement_of_its_strut() -> None:
    """Three quarters of the strut are outside of the picture, which is black."""
    long = Wireframe.create([[0.0, 0.0, 0.0], [400.0, 0.0, 0.0]], [[0, 1]], radius=1.0)
    camera = camera_at([0.0, -100.0, 0.0], (40, 200), 100.0)
    black = level_of([camera])
    opacity, weight = seen_opacity(of_frame(long, 8), black)
    assert (weight[0, 3:] == 0.0).all()
    assert opacity.max() < 0.05
    white = replace(black, target=np.ones_like(black.target))
    assert seen_opacity(of_frame(long, 8), white)[0].min() > 0.95


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_a_common_factor_of_the_radius_is_found(factor: float) -> None:
    elastic, pose = ElasticFrame(FRAME), start_pose(ElasticFrame(FRAME))
    level = seen(FRAME.replace(radius=factor * FRAME.radius))
    for _ in range(6):
        terms = gauss_newton(as_rods(elastic, pose, 6), level)
        pose = learn_thickness(pose, FRAME.radius, terms.widths)
    np.testing.assert_allclose(pose.radius, factor * FRAME.radius, rtol=0.02)


def test_a_strut_of_another_radius_is_told_from_the_rest() -> None:
    elastic, pose = ElasticFrame(FRAME), start_pose(ElasticFrame(FRAME))
    radius = FRAME.radius.copy()
    radius[16] *= 1.4
    level = seen(FRAME.replace(radius=radius))
    for _ in range(8):
        terms = gauss_newton(as_rods(elastic, pose, 6), level)
        pose = learn_thickness(pose, FRAME.radius, terms.widths)
    assert 1.25 < pose.radius[16] / FRAME.radius[16] < 1.45
    np.testing.assert_allclose(np.delete(pose.radius / FRAME.radius, 16), 1.0, atol=0.04)


def test_a_missing_strut_does_not_thin_the_others() -> None:
    elastic, pose = ElasticFrame(FRAME), start_pose(ElasticFrame(FRAME))
    level = seen(FRAME, interval(16, 0.0, 0.0))
    for _ in range(6):
        terms = gauss_newton(as_rods(elastic, pose, 6), level)
        pose = learn_thickness(pose, FRAME.radius, terms.widths)
    others = np.delete(pose.radius / FRAME.radius, 16)
    assert np.median(others) == pytest.approx(1.0, abs=0.01)
    assert np.abs(others - 1.0).max() < 0.05


def test_radii_stay_between_their_limits_and_without_evidence_as_they_are() -> None:
    pose = start_pose(ElasticFrame(FRAME))
    widths = np.zeros((FRAME.strut_count, 3, 2))
    np.testing.assert_array_equal(learn_thickness(pose, FRAME.radius, widths).radius, pose.radius)
    widths[..., 0], widths[..., 1] = 1.0, 50.0
    np.testing.assert_allclose(learn_thickness(pose, FRAME.radius, widths).radius, THINNEST * FRAME.radius)
    widths[..., 1] = -50.0
    np.testing.assert_allclose(learn_thickness(pose, FRAME.radius, widths).radius, THICKEST * FRAME.radius)


def certainty(frame: Wireframe, cameras: list[Camera]) -> np.ndarray:
    return confidence(ElasticFrame(frame), gauss_newton(of_frame(frame, 6), level_of(cameras)))


def around(degrees: list[float], distance: float = 150.0, focal: float = 600.0) -> list[Camera]:
    """Cameras about the x axis, by the angle from the y axis."""
    turn = np.radians(degrees)
    return [
        camera_at([5.0, -distance * c, distance * s], (240, 320), focal)
        for c, s in zip(np.cos(turn), np.sin(turn), strict=True)
    ]


def test_hidden_struts_are_less_certain() -> None:
    """Two thin struts; one lies between four thick ones, which hide it from all views but the slanting one."""
    lines = [(0.0, 0.0, 0.4), (12.0, 12.0, 0.4), (6.0, 0.0, 3.0), (-6.0, 0.0, 3.0), (0.0, 6.0, 3.0), (0.0, -6.0, 3.0)]
    vertices = [[x, y, z] for y, z, _ in lines for x in (-10.0, 10.0)]
    frame = Wireframe.create(vertices, [[2 * k, 2 * k + 1] for k in range(6)], radius=[r for *_, r in lines])
    found = certainty(frame, around([0.0, 90.0, 180.0, 270.0, 45.0]))
    assert found[1] > 2.0 * found[0]
    assert ((found >= 0.0) & (found <= 1.0)).all()


def test_motion_along_the_line_of_sight_is_uncertain() -> None:
    frame = Wireframe.create([[-10.0, 0.0, -3.0], [10.0, 0.0, 4.0]], [[0, 1]], radius=0.5)
    parallel, askew = certainty(frame, around([0.0, 2.0]))[0], certainty(frame, around([0.0, 90.0]))[0]
    assert certainty(frame, around([0.0]))[0] < 0.01
    assert parallel < 0.25 * askew
    assert askew > 0.5


def test_every_view_adds_to_the_confidence() -> None:
    found = np.array([certainty(FRAME, list(CAMERAS[: k + 1])) for k in range(6)])
    assert (np.diff(found, axis=0) >= -1e-9).all()
    assert found[0].max() < 0.05
    assert found[-1].min() > 0.3


def test_larger_pictures_tell_more() -> None:
    """Twice the pixels a millimetre: twice as steep edges and, at equal blur, twice as many pixels along them."""
    frame = Wireframe.create([[-10.0, 0.0, -3.0], [10.0, 0.0, 4.0]], [[0, 1]], radius=1.5)
    elastic = ElasticFrame(frame)
    small = around([0.0, 90.0])
    large = [camera.resized(2 * camera.width, 2 * camera.height) for camera in small]
    deviation = [
        standard_deviation(elastic, gauss_newton(of_frame(frame, 6), level_of(c, 1.0)))[0] for c in (small, large)
    ]
    assert deviation[1] == pytest.approx(deviation[0] * 2.0**-1.5, rel=0.05)


def test_single_dark_pieces_are_no_gaps() -> None:
    opacity = np.array([[0.1, 1, 1, 0.2, 1, 1], [1, 1, 0.1, 0.2, 1, 0.3], [0.0] * 6])
    expected = [[1, 1, 1, 1, 1, 1], [1, 1, 0, 0, 1, 1], [0] * 6]
    np.testing.assert_array_equal(without_gaps(opacity, 0.5), expected)
    np.testing.assert_array_equal(without_gaps(np.array([[0.4], [0.6]]), 0.5), [[0], [1]])


def test_gaps_of_stubs_are_as_long_as_those_of_slender_struts() -> None:
    """Six pieces of struts of 18, 6 and 2 radii: three radii are one piece (two are asked for), three, and nine."""
    shortest = shortest_gap(np.array([18.0, 6.0, 2.0]), np.ones(3), 6)
    assert shortest.tolist() == [2, 3, 9]
    dark = np.array([[1.0, 0.1, 0.1, 1.0, 1.0, 0.1]] * 3)
    kept = [[1, 0, 0, 1, 1, 1], [1, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 1]]
    np.testing.assert_array_equal(without_gaps(dark, 0.5, shortest), kept)
    np.testing.assert_array_equal(without_gaps(np.full((3, 6), 0.1), 0.5, shortest), np.zeros((3, 6)))  # missing


def test_radii_of_struts_one_behind_another_come_to_rest() -> None:
    """Both answer for the same pixels: by whole steps of each, radii would swing to and fro."""
    behind = Wireframe.create(
        [[-50.0, 0.0, 0.0], [50.0, 0.0, 0.0], [-50.0, 5.0, 0.0], [50.0, 5.0, 0.0]], [[0, 1], [2, 3]], radius=1.5
    )
    level = seen(behind, cameras=(camera_at([0.0, -2000.0, 0.0], (60, 400), 6000.0),))
    elastic = ElasticFrame(behind)
    poses = [replace(start_pose(elastic), radius=1.2 * behind.radius)]
    for _ in range(10):
        terms = gauss_newton(as_rods(elastic, poses[-1], 6), level)
        poses.append(learn_thickness(poses[-1], behind.radius, terms.widths))
    np.testing.assert_allclose(poses[-1].radius, poses[-2].radius, rtol=1e-3)


def test_a_joint_is_as_large_as_before_when_its_struts_become_thicker() -> None:
    sizes, discs = np.array([2.0, 1.0, 2.0]), np.array([4.0, 0.0, 6.0])
    content = np.array([[7.0, 0.0], [0.0, 0.0], [7.0, 0.0]])  # pictures ask for no other discs
    thicker = np.array([4.4, 0.0, 7.5])
    found = learn_joint_sizes(sizes, discs, thicker, content)
    np.testing.assert_allclose(found, [2.0 / 1.1, 1.0, 2.0 / 1.25])
