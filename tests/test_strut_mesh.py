"""The mesh of a print against the swept spheres that it stands for."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from frametwin.cameras import Camera, look_at
from frametwin.capture.strut_mesh import (
    CHORD_ERROR,
    OUTLINE_ERROR,
    Resolution,
    StrutMesh,
    radii_at,
    resolution_for,
    strut_mesh,
    sub_curves,
)
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

FINE = Resolution(sides=32, chord=1e-3)
CURVE = [[-10.0, -3.0, -2.0], [-6.0, 0.0, 9.0], [2.0, 3.0, -9.0], [6.0, 5.0, 3.0]]


def strut(radius: float = 1.0, curve: list[list[float]] | None = None) -> Wireframe:
    points = [[-9.0, 2.0, 1.0], [7.0, -3.0, 5.0]] if curve is None else [curve[0], curve[3]]
    return Wireframe.create(points, [[0, 1]], radius=radius, control_points=None if curve is None else [curve])


def whole(frame: Wireframe, resolution: Resolution = FINE, thickness: np.ndarray | None = None) -> StrutMesh:
    radii = np.repeat(frame.radius[:, None], 2, axis=1) if thickness is None else thickness
    return strut_mesh(frame, np.tile([0.0, 1.0], (frame.strut_count, 1)), radii, resolution)


def corners(mesh: StrutMesh) -> np.ndarray:
    """(F, 3) vertex indices of all triangles, quads cut in two."""
    return np.concatenate([mesh.quads[:, :3], mesh.quads[:, [0, 2, 3]], mesh.triangles])


def volume(mesh: StrutMesh) -> float:
    a, b, c = mesh.vertices.astype(np.float64)[corners(mesh).T]
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def beyond(mesh: StrutMesh, frame: Wireframe, samples: int = 4001) -> np.ndarray:
    """(P,) distance of every vertex from the nearest of the struts' centrelines."""
    curve = bezier.evaluate(frame.control_points, np.linspace(0.0, 1.0, samples)).reshape(-1, 3)
    return np.array([np.linalg.norm(curve - vertex, axis=1).min() for vertex in mesh.vertices])


def test_a_single_strut_is_a_closed_cylinder_with_round_ends() -> None:
    frame = strut(radius=1.5)
    mesh = whole(frame, Resolution(64, 1e-3))
    # A mesh is closed when every edge is run through once in each direction.
    points = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)[1].reshape(-1)
    faces = points[corners(mesh)]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).all()
    np.testing.assert_array_equal(there, np.unique(edges[:, ::-1], axis=0))
    exact = pi * 1.5**2 * frame.lengths[0] + 4.0 / 3.0 * pi * 1.5**3
    assert volume(mesh) == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize("curve", [None, CURVE])
def test_vertices_stand_around_the_curve_and_normals_away_from_it(curve: list[list[float]] | None) -> None:
    frame = strut(0.8, curve)
    mesh = whole(frame)
    distance = beyond(mesh, frame)
    wider = (pi / 32) / np.sin(pi / 32)
    np.testing.assert_allclose(distance, 0.8 * wider, atol=5e-4)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
    inside = replace(mesh, vertices=mesh.vertices - 0.8 * wider * mesh.normals)
    assert beyond(inside, frame).max() < 5e-3
    # Faces look to where the normals of their corners point.
    a, b, c = mesh.vertices.astype(np.float64)[corners(mesh).T]
    facing = np.sum(np.cross(b - a, c - a) * mesh.normals[corners(mesh)].sum(axis=1), axis=1)
    assert facing.min() > 0.0


def test_the_outline_is_as_wide_as_the_strut_on_average() -> None:
    frame = strut(2.0)
    axis = np.diff(frame.vertices, axis=0)[0]
    axis /= np.linalg.norm(axis)
    mesh = whole(frame, Resolution(12, 1e-3))
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, axis)
    angle = np.linspace(0.0, 2.0 * pi, 720, endpoint=False)
    across = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
    width = ((mesh.vertices - frame.vertices[0]) @ across.T).max(axis=0)
    assert width.mean() == pytest.approx(2.0, abs=2e-4)
    assert width.min() > 2.0 - 2.0 * (pi / 12) ** 2 / 3.0 * 1.05
    assert width.max() < 2.0 + 2.0 * (pi / 12) ** 2 / 6.0 * 1.05


def test_the_radius_follows_the_thickness() -> None:
    frame = strut(1.0, CURVE)
    thickness = np.array([[1.0, 0.6, 1.3, 0.9]])
    mesh = whole(frame, FINE, thickness)
    u = np.linspace(0.0, 1.0, 6001)
    curve = bezier.evaluate(frame.control_points[0], u)
    radius = np.interp(u, np.linspace(0.0, 1.0, 4), thickness[0])
    wider = (pi / 32) / np.sin(pi / 32)
    for vertex in mesh.vertices:
        distance = np.linalg.norm(curve - vertex, axis=1)
        nearest = distance.argmin()
        assert distance[nearest] == pytest.approx(wider * radius[nearest], abs=2e-3)


def test_normals_lean_where_the_strut_tapers() -> None:
    frame = strut(1.0)
    mesh = whole(frame, FINE, np.array([[1.0, 0.2]]))
    tube = np.unique(mesh.quads[mesh.strut[: len(mesh.quads)] == 0][:32])
    axis = np.diff(frame.vertices, axis=0)[0] / frame.lengths[0]
    slope = -0.8 / frame.lengths[0]
    np.testing.assert_allclose(mesh.normals[tube] @ axis, -slope / np.hypot(1.0, slope), atol=1e-6)


def test_a_part_of_a_strut_is_the_strut_that_was_cut_there() -> None:
    frame = strut(0.7, CURVE)
    found = strut_mesh(frame, np.array([[0.2, 0.65]]), np.array([[0.5, 1.0]]), FINE)
    kept = bezier.split(bezier.split(frame.control_points, 0.65)[0], 0.2 / 0.65)[1]
    part = strut(0.7, kept[0].tolist())
    wanted = whole(part, FINE, np.array([[0.6, 0.825]]))
    np.testing.assert_allclose(found.vertices, wanted.vertices, atol=1e-5)
    np.testing.assert_array_equal(found.quads, wanted.quads)


def test_parts_of_curves_by_blossoming() -> None:
    curves = np.random.default_rng(0).normal(size=(5, 4, 3))
    interval = np.array([[0.0, 1.0], [0.0, 0.4], [0.3, 1.0], [0.2, 0.7], [0.5, 0.5]])
    u = np.linspace(0.0, 1.0, 7)
    parts = bezier.evaluate(sub_curves(curves, interval), u)
    for curve, part, (low, high) in zip(curves, parts, interval, strict=True):
        np.testing.assert_allclose(part, bezier.evaluate(curve, low + u * (high - low)), atol=1e-12)


def star(radii: list[float]) -> Wireframe:
    """Struts of these radii that meet in the origin."""
    ends = np.random.default_rng(2).normal(size=(len(radii), 3))
    ends *= 10.0 / np.linalg.norm(ends, axis=1, keepdims=True)
    edges = [[0, i + 1] if i % 2 else [i + 1, 0] for i in range(len(radii))]
    return Wireframe.create([[0.0, 0.0, 0.0], *ends.tolist()], edges, radius=radii)


def test_a_joint_has_one_ball_of_the_thickest_strut() -> None:
    frame = star([1.0, 0.8, 1.2, 0.9])
    mesh = whole(frame)
    caps = mesh.strut[len(mesh.quads) :]
    near = np.linalg.norm(mesh.vertices[mesh.triangles].mean(axis=1), axis=1) < 2.0
    assert set(caps[near]) == {2}
    assert sorted(set(caps[~near])) == [0, 1, 2, 3]  # the free ends
    np.testing.assert_allclose(np.bincount(caps), [32, 32, 64, 32])
    # Nothing stands out of the balls and tubes, and the open ends are inside of the ball.
    t = np.clip(mesh.vertices @ (unit := frame.vertices[1:] / 10.0).T, 0.0, 10.0)
    distance = np.linalg.norm(mesh.vertices[:, None] - t[..., None] * unit, axis=-1) / frame.radius
    assert distance.min(axis=1).max() < 1.01


def test_struts_that_are_not_there_leave_nothing_and_their_joint_a_ball() -> None:
    frame = star([1.0, 0.8, 1.2, 0.9])
    frame = frame.replace(printed=np.array([True, True, False, True]))
    present = np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    mesh = strut_mesh(frame, present, np.repeat(frame.radius[:, None], 2, axis=1), FINE)
    assert set(mesh.strut) == {0, 1}
    np.testing.assert_allclose(np.bincount(mesh.strut[len(mesh.quads) :]), [64, 32])
    nothing = strut_mesh(frame, np.zeros((4, 2)), np.ones((4, 2)), FINE)
    assert nothing.vertices.shape == nothing.normals.shape == (0, 3)
    assert nothing.quads.shape == (0, 4)
    assert nothing.triangles.shape == (0, 3)
    assert nothing.strut.shape == (0,)


def test_a_strut_broken_at_a_joint_has_a_round_end_of_its_own() -> None:
    frame = star([1.0, 0.8])
    present = np.array([[0.0, 0.5], [0.5, 1.0]])  # both are there at their free ends only: strut 0 ends in the joint
    mesh = strut_mesh(frame, present, np.repeat(frame.radius[:, None], 2, axis=1), FINE)
    np.testing.assert_allclose(np.bincount(mesh.strut[len(mesh.quads) :]), [64, 64])


def test_a_strut_shorter_than_thick_does_not_take_the_ball_of_its_joint() -> None:
    """Its tube would not reach far enough to cover the other half."""
    points = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, -7.0, 6.0]]
    frame = Wireframe.create(points, [[0, 1], [0, 2], [3, 0]], radius=[2.0, 1.0, 0.9])
    mesh = whole(frame)
    caps = np.bincount(mesh.strut[len(mesh.quads) :])
    np.testing.assert_array_equal(caps, [64, 64, 32])


def test_the_resolution_keeps_to_its_errors_in_pixels() -> None:
    frame = strut(2.0, CURVE)
    pose = look_at([60.0, 10.0, 20.0], [0.0, 0.0, 0.0])
    camera = Camera("view", 800, 600, 900.0, 900.0, 400.0, 300.0, pose)
    thickness = np.array([[2.0, 2.0]])
    found = resolution_for(frame, thickness, [camera])
    pixel = (camera.project(frame.control_points)[1].min() - 2.0) / 900.0
    assert found.sides % 4 == 0
    assert 2.0 / pixel * (pi / found.sides) ** 2 / 3.0 <= OUTLINE_ERROR
    assert 2.0 / pixel * (pi / (found.sides - 4)) ** 2 / 3.0 > OUTLINE_ERROR
    assert found.chord == pytest.approx(CHORD_ERROR * pixel)
    near = resolution_for(frame, thickness, [camera, camera.resized(1600, 1200)])
    assert near.sides > found.sides
    assert resolution_for(frame, thickness, [camera], least_sides=60).sides == 60
    behind = replace(camera, camera_to_world=look_at([60.0, 10.0, 20.0], [120.0, 20.0, 40.0]))
    assert resolution_for(frame, thickness, [behind]).sides >= 12


def test_the_axis_of_a_tube_keeps_to_the_chord_error() -> None:
    frame = strut(0.5, CURVE)
    for chord in (0.3, 0.05, 0.01):
        mesh = whole(frame, Resolution(12, chord))
        rings = np.unique(mesh.quads[: mesh.quads.shape[0] - 2 * 12 * 2])
        centres = mesh.vertices[rings][: len(rings) // 12 * 12].reshape(-1, 12, 3).mean(axis=1)
        between = 0.5 * (centres[1:] + centres[:-1])
        dense = bezier.evaluate(frame.control_points[0], np.linspace(0.0, 1.0, 5001))
        off = np.linalg.norm(between[:, None] - dense, axis=-1).min(axis=1)
        assert off.max() <= chord


def test_radii_between_the_given_ones() -> None:
    thickness = np.array([[1.0, 3.0, 2.0]])
    np.testing.assert_allclose(
        radii_at(thickness, np.array([[0.0, 0.25, 0.5, 0.75, 1.0]])), [[1.0, 2.0, 3.0, 2.5, 2.0]]
    )


def test_a_real_frame_keeps_all_its_struts(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeLounge_wireframe.txt")
    mesh = whole(frame, Resolution(12, 0.01))
    np.testing.assert_array_equal(np.unique(mesh.strut), np.arange(4164))
    assert np.isfinite(mesh.vertices).all()
    assert mesh.quads.max() < len(mesh.vertices)
