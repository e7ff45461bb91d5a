"""Rotation-minimising frames against closed forms: planar curves, torsion, a fine integration."""

from __future__ import annotations

import numpy as np
import pytest

from frametwin.geometry import bezier
from frametwin.geometry.rotation_frames import rotation_minimising_frames, tangents

TWISTED = np.array([[0.0, 0.0, 0.0], [12.0, 9.0, 2.0], [20.0, -8.0, 14.0], [35.0, 5.0, 30.0]])
U = (np.arange(20) + 0.5) / 20


def random_struts(count: int) -> np.ndarray:
    return np.random.default_rng(4).normal(scale=20.0, size=(count, 4, 3))


def assert_orthonormal(frames) -> None:
    matrix = np.stack(frames, axis=-1)  # columns t, n, b
    product = np.swapaxes(matrix, -1, -2) @ matrix
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(matrix), 1.0, atol=1e-12)


def angle_about_tangent(normal: np.ndarray, reference: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Signed angle from the reference to the normal about the tangent."""
    return np.arctan2(np.sum(tangent * np.cross(reference, normal), axis=-1), np.sum(reference * normal, axis=-1))


def frenet_normals(points: np.ndarray, u: np.ndarray) -> np.ndarray:
    first, second = bezier.derivative(points, u, 1), bezier.derivative(points, u, 2)
    across = np.cross(np.cross(first, second), first)
    return across / np.linalg.norm(across, axis=-1, keepdims=True)


def turned_by_torsion(points: np.ndarray, u: float) -> float:
    """Minus the integral of torsion times speed: how far the frame turns against the Frenet frame."""
    x, w = np.polynomial.legendre.leggauss(60)
    x, w = 0.5 * u * (x + 1.0), 0.5 * u * w
    first, second, third = (bezier.derivative(points, x, order) for order in (1, 2, 3))
    cross = np.cross(first, second)
    torsion = np.sum(cross * third, axis=1) / np.sum(cross * cross, axis=1)
    return -float(np.sum(w * torsion * np.linalg.norm(first, axis=1)))


def test_frames_turn_against_the_frenet_frame_by_the_integral_of_torsion() -> None:
    start = frenet_normals(TWISTED, np.zeros(1))[0]
    u = np.linspace(0.05, 1.0, 8)
    frames = rotation_minimising_frames(TWISTED, u, start_normal=start)
    found = angle_about_tangent(frames.normal, frenet_normals(TWISTED, u), frames.tangent)
    wanted = np.array([turned_by_torsion(TWISTED, x) for x in u])
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * wanted), atol=1e-6)
    assert_orthonormal(frames)


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    start = frenet_normals(TWISTED, np.zeros(1))[0]
    end, reference = np.ones(1), frenet_normals(TWISTED, np.ones(1))
    wanted = turned_by_torsion(TWISTED, 1.0)
    errors = []
    for steps in (16, 32, 64):
        frames = rotation_minimising_frames(TWISTED, end, start_normal=start, steps=steps)
        found = angle_about_tangent(frames.normal, reference, frames.tangent)[0]
        errors.append(abs(np.angle(np.exp(1j * (found - wanted)))))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.5).all(), (errors, orders)


def test_normals_have_no_rate_about_the_tangent() -> None:
    struts = random_struts(30)
    u = np.linspace(0.1, 0.9, 5)
    h = 1e-4
    grid = np.concatenate([u - h, u, u + h])
    frames = rotation_minimising_frames(struts, grid, steps=400)
    rate = (frames.normal[:, 10:] - frames.normal[:, :5]) / (2.0 * h)
    turn = np.linalg.norm(frames.tangent[:, 10:] - frames.tangent[:, :5], axis=-1) / (2.0 * h)
    twist = np.abs(np.sum(rate * frames.binormal[:, 5:10], axis=-1))
    assert (twist <= 1e-3 * (1.0 + turn)).all()


def test_frames_of_a_fine_integration_agree() -> None:
    struts = random_struts(40)
    coarse = rotation_minimising_frames(struts, U)
    fine = rotation_minimising_frames(struts, U, steps=4000)
    gentle = np.linalg.norm(bezier.derivative(struts, np.linspace(0, 1, 400)), axis=-1).min(axis=1) > 10.0
    assert gentle.sum() > 10
    assert np.abs(coarse.normal - fine.normal)[gentle].max() < 1e-4
    assert_orthonormal(coarse)


def test_planar_curves_keep_their_plane() -> None:
    # The second one is inflected: the Frenet normal jumps there, this one does not.
    arch = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 20.0], [30.0, 0.0, 20.0], [40.0, 0.0, 0.0]])
    wave = np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 25.0], [20.0, 0.0, -25.0], [40.0, 0.0, 0.0]])
    frames = rotation_minimising_frames(np.stack([arch, wave]), U)
    np.testing.assert_allclose(np.abs(frames.binormal[..., 1]), 1.0, atol=1e-12)
    assert (np.sum(frames.normal[:, 1:] * frames.normal[:, :-1], axis=-1) > 0.8).all()
    assert_orthonormal(frames)


def test_straight_struts_have_one_frame_with_its_normal_upwards() -> None:
    ends = np.array([[30.0, 4.0, 7.0], [0.0, 0.0, 25.0], [0.0, 0.0, -25.0], [0.0, 18.0, 0.0]])
    frames = rotation_minimising_frames(bezier.straight(np.zeros(3), ends), U)
    assert_orthonormal(frames)
    np.testing.assert_allclose(frames.tangent, np.repeat((ends.T / np.linalg.norm(ends, axis=1)).T[:, None], 20, 1))
    np.testing.assert_allclose(frames.normal, np.broadcast_to(frames.normal[:, :1], frames.normal.shape), atol=1e-12)
    assert (frames.normal[[0, 3], :, 2] > 0.9).all()
    np.testing.assert_allclose(frames.normal[1:3, :, 0], 1.0, atol=1e-12)


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0], [0, 0, 0], [10, 5, 0], [30, 5, 9]],
        [[0, 0, 0], [10, 5, 0], [30, 5, 9], [30, 5, 9]],
        [[0, 0, 0], [0, 0, 0], [30, 5, 9], [30, 5, 9]],
        [[0, 0, 0], [0, 0, 0], [0, 0, 0], [30, 5, 9]],
        [[0, 0, 0], [30, 5, 9], [30, 5, 9], [30, 5, 9]],
    ],
    ids=["start", "end", "both", "triple start", "triple end"],
)
def test_tangents_where_the_derivative_vanishes_are_the_limits(points) -> None:
    points = np.array(points, dtype=float)
    found = tangents(points, [0.0, 1.0])
    limits = tangents(points, [1e-6, 1.0 - 1e-6])
    np.testing.assert_allclose(found, limits, atol=1e-5)
    frames = rotation_minimising_frames(points, np.linspace(0.0, 1.0, 11))
    assert_orthonormal(frames)
    np.testing.assert_allclose(frames.tangent[[0, -1]], found)


def test_a_cusp_gives_frames_on_both_sides() -> None:
    cusp = np.array([[0.0, 0.0, 0.0], [20.0, 20.0, 0.0], [0.0, 20.0, 0.0], [20.0, 0.0, 0.0]])
    assert np.linalg.norm(bezier.derivative(cusp, 0.5)) < 1e-12
    frames = rotation_minimising_frames(cusp, np.linspace(0.0, 1.0, 21))
    assert_orthonormal(frames)


def test_frames_do_not_depend_on_where_they_are_asked_for() -> None:
    all_frames = rotation_minimising_frames(TWISTED, [0.9, 0.2, 0.5])
    for index, u in enumerate((0.9, 0.2, 0.5)):
        alone = rotation_minimising_frames(TWISTED, [u])
        np.testing.assert_allclose(all_frames.normal[index], alone.normal[0], atol=1e-6)


def test_frames_turn_with_the_curve() -> None:
    rotation, _ = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    start = np.array([0.3, -1.0, 0.4])
    frames = rotation_minimising_frames(TWISTED, U, start_normal=start)
    turned = rotation_minimising_frames(TWISTED @ rotation.T, U, start_normal=rotation @ start)
    for a, b in zip(frames, turned, strict=True):
        np.testing.assert_allclose(b, a @ rotation.T, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "u", "start"),
    [
        (np.zeros((4, 3)), [0.5], None),
        (TWISTED, [1.5], None),
        (TWISTED, [[0.5]], None),
        (TWISTED, [0.5], TWISTED[1] - TWISTED[0]),
        (TWISTED, [0.5], np.zeros(3)),
    ],
)
def test_what_has_no_frame_is_refused(points, u, start) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        rotation_minimising_frames(points, u, start_normal=start)
