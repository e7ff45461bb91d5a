"""Cameras as freedoms of the fit: their terms, the joint step, and what holds the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rod_cases import level_of, of_frame, views
from small_frames import tower

from frametwin.cameras import packed
from frametwin.cameras.rigs import ring_rig
from frametwin.fitting import camera_steps, gauge
from frametwin.fitting.camera_freedoms import (
    FOCAL,
    FREEDOMS,
    LENS,
    NOISE,
    CameraPrior,
    RigErrors,
    camera_terms,
    corrected,
    deviations_of,
    moved_cameras,
    pixel_noise,
    rig_covariances,
    view_motions,
    whitening,
    with_cameras,
)
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.motion import Pose, as_rods, start_pose
from frametwin.raster import rods
from frametwin.raster.rods import gauss_newton, gauss_newton_by_view

SCALES = np.ones(3)
UNITS = np.array([*3 * [1e-4], *3 * [1e-2], 1e-4, *2 * [1e-2], 1e-3])
"""Steps of the freedoms that move pixels by about a hundredth."""


def level(size: int = 3):
    return level_of(views()[:size], blur=0.8)


def believed(errors: RigErrors) -> np.ndarray:
    """(3, 10, 10) covariances of cameras that are known so well."""
    return np.tile(np.diag(errors.deviations() ** 2), (3, 1, 1))


def random_freedoms(seed: int, size: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(3, FREEDOMS)) * UNITS * 30.0 * size


def pixels(camera: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where a packed camera (17,) sees points (N, 3), by the formula of the pinhole with k1."""
    seen = points @ camera[:9].reshape(3, 3).T + camera[9:12]
    flat = seen[:, :2] / seen[:, 2:]
    flat = flat * (1.0 + camera[16] * np.square(flat).sum(axis=1, keepdims=True))
    return flat * camera[12:14] + camera[14:16]


def test_moved_cameras_are_those_of_the_camera_class() -> None:
    freedoms = random_freedoms(1)
    freedoms[:, LENS] = 0.0
    wanted = packed(corrected(views(), freedoms))
    np.testing.assert_allclose(moved_cameras(level().cameras, freedoms, SCALES)[:, :16], wanted, atol=1e-9)


@pytest.mark.parametrize("freedom", range(FREEDOMS))
def test_points_move_as_the_camera_would_have_them_seen(freedom: int) -> None:
    points = np.random.default_rng(freedom).uniform(-10.0, 10.0, (20, 3))
    for v, camera in enumerate(level().cameras):
        step = np.zeros((3, FREEDOMS))
        step[v, freedom] = UNITS[freedom]
        after = pixels(moved_cameras(level().cameras, step, SCALES)[v], points)
        shifted = points + view_motions(points, camera, 1.0)[..., freedom] * UNITS[freedom]
        change = after - pixels(camera, points)
        np.testing.assert_allclose(
            pixels(camera, shifted) - pixels(camera, points), change, atol=2e-2 * np.abs(change).max()
        )


def test_views_by_themselves_sum_to_all_but_for_what_thickness_tells() -> None:
    drawn, pictures = of_frame(tower(1), 4), level()
    by_view, both = gauss_newton_by_view(drawn, pictures), gauss_newton(drawn, pictures)
    summed = by_view.summed()
    assert summed.loss == pytest.approx(both.loss, rel=1e-5)
    np.testing.assert_allclose(summed.hessian, both.hessian, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(summed.joint_gradient, both.joint_gradient, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(summed.widths, both.widths)


@pytest.mark.parametrize("freedom", [0, 1, 2, 3, 4, 5, 7, 8])
def test_the_cameras_gradient_is_that_of_finite_differences(freedom: int) -> None:
    frame = tower(1)
    drawn, pictures = of_frame(frame, 4), level()
    moved = replace(drawn, control_points=drawn.control_points + 0.3, joints=drawn.joints + 0.3)
    pictures = replace(pictures, target=np.float32(1.0) - rods.transmittance(moved, pictures))
    terms = camera_terms(drawn, gauss_newton_by_view(drawn, pictures), pictures.cameras, SCALES)
    for v in range(3):
        losses = []
        for sign in (1.0, -1.0):
            step = np.zeros((3, FREEDOMS))
            step[v, freedom] = 20.0 * sign * UNITS[freedom]
            losses.append(rods.squared_loss(drawn, with_cameras(pictures, step, SCALES)))
        slope = (losses[0] - losses[1]) / (40.0 * UNITS[freedom])
        # Struts that share pixels at joints are taken one by one, and thickness tells nothing of the distance.
        scale = np.sqrt(terms.matrix[v, freedom, freedom] * 2.0 * losses[0])
        assert terms.gradient[v, freedom] == pytest.approx(slope, abs=0.1 * scale)


def test_the_joint_step_solves_the_whole_system() -> None:
    """Eliminating struts and joints gives what the dense system gives."""
    frame = tower(1)
    elastic, pictures = ElasticFrame(frame), level()
    pose = start_pose(elastic)
    drawn = as_rods(elastic, pose, 4)
    terms = gauss_newton_by_view(drawn, pictures)
    cameras = camera_terms(drawn, terms, pictures.cameras, SCALES)
    prior = CameraPrior.of(believed(RigErrors()))
    freedoms = random_freedoms(3, 0.1)
    system = camera_steps.reduced_system(elastic, terms.summed(), cameras, (pose, pose), (freedoms, prior), (0.05, 0.1))
    joints, inner, moved = camera_steps.whole_step(elastic, system)
    # With the cameras held where they are told to go, the frame's own best step is the same one.
    fixed = replace(cameras, gradient=np.zeros_like(cameras.gradient))
    summed = terms.summed()
    pulled = replace(
        summed,
        gradient=summed.gradient + np.einsum("eavf,vf->ea", fixed.struts, moved),
        joint_gradient=summed.joint_gradient + np.einsum("javf,vf->ja", fixed.joints, moved),
    )
    from frametwin.fitting.motion import free_step

    own_joints, own_inner = free_step(elastic, pulled, pose, pose, 0.05, 0.1)
    np.testing.assert_allclose(joints, own_joints, atol=1e-6 * np.abs(joints).max())
    np.testing.assert_allclose(inner, own_inner, atol=1e-6 * np.abs(inner).max())
    gradient = cameras.gradient + prior.pull(freedoms)
    gradient = gradient + np.einsum("vfg,vg->vf", cameras.matrix, moved) + prior.pull(moved)
    control = np.einsum("eij,ej->ei", elastic.follow, joints.ravel()[elastic.freedoms])
    control[:, 3:9] += inner
    gradient += np.einsum("eavf,ea->vf", cameras.struts, control)
    gradient += np.einsum("javf,ja->vf", cameras.joints, joints[:, :3])
    assert np.abs(gradient).max() < 1e-6 * np.abs(cameras.gradient).max()


# --- what holds the world


def moved_by(scale: float, turn: np.ndarray, shift: np.ndarray) -> gauge.Similarity:
    from scipy.spatial.transform import Rotation

    return gauge.Similarity(scale, Rotation.from_rotvec(turn).as_matrix(), shift)


def test_a_similarity_of_print_and_cameras_changes_no_pixel() -> None:
    elastic, pictures = ElasticFrame(tower(1)), level()
    pose = start_pose(elastic)
    motion = moved_by(1.01, np.array([0.02, -0.01, 0.03]), np.array([1.0, -2.0, 0.5]))
    freedoms = random_freedoms(5)
    before = rods.transmittance(as_rods(elastic, pose, 4), with_cameras(pictures, freedoms, SCALES))
    print_after = gauge.moved_pose(elastic, pose, motion)
    rig_after = gauge.moved_rig(pictures.cameras, freedoms, motion)
    after = rods.transmittance(as_rods(elastic, print_after, 4), with_cameras(pictures, rig_after, SCALES))
    assert np.abs(after - before).max() < 2e-3
    assert before.min() < 0.5


def test_the_world_comes_back_to_its_feet() -> None:
    elastic, pictures = ElasticFrame(tower(2)), level()
    plan = start_pose(elastic)
    motion = moved_by(1.004, np.array([0.003, 0.002, -0.004]), np.array([0.7, -0.4, 0.3]))
    away, rig = gauge.moved_pose(elastic, plan, motion), gauge.moved_rig(pictures.cameras, np.zeros((3, 10)), motion)
    back = gauge.held_world(elastic, away, pictures.cameras, rig, believed(RigErrors()))
    home = gauge.moved_pose(elastic, away, back)
    feet = home.joints[elastic.frame.grounded, :3]
    assert np.abs(feet).max() < 0.01
    assert np.abs(home.joints[:, :3]).max() < 0.05
    assert np.abs(gauge.moved_rig(pictures.cameras, rig, back)[:, :FOCAL]).max() < 0.02


def test_one_foot_that_came_off_carries_nothing_along() -> None:
    elastic, pictures = ElasticFrame(tower(2)), level()
    pose = start_pose(elastic)
    joints = pose.joints.copy()
    joints[np.flatnonzero(elastic.frame.grounded)[0], :3] = [0.0, 4.0, 3.0]
    loose = Pose(joints, pose.inner, pose.radius, pose.opacity)
    motion = gauge.held_world(elastic, loose, pictures.cameras, np.zeros((3, 10)), believed(RigErrors(shift=0.5)))
    others = np.flatnonzero(elastic.frame.grounded)[1:]
    assert np.linalg.norm(motion(elastic.frame.vertices[others]) - elastic.frame.vertices[others], axis=1).max() < 1.0


def test_a_print_that_is_squashed_is_not_taken_for_one_that_is_small() -> None:
    """All struts of it are shorter than planned, while its feet are where they were."""
    elastic, pictures = ElasticFrame(tower(2)), level()
    pose = start_pose(elastic)
    joints = pose.joints.copy()
    joints[:, 2] -= 0.03 * elastic.frame.vertices[:, 2]
    squashed = Pose(joints, pose.inner, pose.radius, pose.opacity)
    motion = gauge.held_world(elastic, squashed, pictures.cameras, np.zeros((3, 10)), believed(RigErrors()))
    shown = elastic.frame.vertices + joints[:, :3]
    assert np.linalg.norm(motion(shown) - shown, axis=1).max() < 3.0 * gauge.FEET


def some_covariance(seed: int) -> np.ndarray:
    """(10, 10) of freedoms that are known together as well as alone."""
    mixed = np.random.default_rng(seed).normal(size=(FREEDOMS, FREEDOMS)) * UNITS[:, None]
    return mixed @ mixed.T


def test_cameras_are_held_by_their_own_calibration_or_by_the_usual_errors() -> None:
    known = some_covariance(1)
    some, other = ring_rig(np.array([[-50.0, -50.0, 0.0], [50.0, 50.0, 80.0]]), 2, size=(80, 60))
    errors = RigErrors(turn=1.0)
    own, usual = rig_covariances([replace(some, covariance=known), other], errors)
    np.testing.assert_array_equal(own, known)
    np.testing.assert_allclose(deviations_of(usual), errors.deviations())


def test_what_is_known_of_several_freedoms_together_is_kept() -> None:
    """White freedoms have the identity as covariance, and the prior's loss is their squared length."""
    covariances = np.stack([some_covariance(seed) for seed in range(3)])
    white = whitening(covariances)
    spread = np.matmul(np.matmul(white, covariances), white.transpose(0, 2, 1))
    np.testing.assert_allclose(spread, np.tile(np.eye(FREEDOMS), (3, 1, 1)), atol=1e-6)
    freedoms = random_freedoms(4)
    prior = CameraPrior.of(covariances)
    lengths = sum(own @ np.linalg.solve(known, own) for own, known in zip(freedoms, covariances, strict=True))
    assert prior.loss(freedoms) == pytest.approx(0.5 * NOISE**2 * lengths, rel=1e-6)
    for freedom, unit in enumerate(UNITS):
        step = np.zeros((3, FREEDOMS))
        step[1, freedom] = unit
        slope = (prior.loss(freedoms + step) - prior.loss(freedoms - step)) / (2.0 * unit)
        assert prior.pull(freedoms)[1, freedom] == pytest.approx(slope, rel=1e-5)


def test_outlines_that_err_alike_weigh_as_few_pixels() -> None:
    assert pixel_noise(0.0) == NOISE
    assert pixel_noise(0.2) ** 2 == pytest.approx(NOISE**2 + 50.0 * 0.2**2)


def test_what_photographs_do_to_all_feet_does_not_become_less_by_their_number() -> None:
    """The mean of n feet that share an error keeps it; their own errors become less by the root of n."""
    for stories in (1, 3):
        frame = tower(stories)
        count = frame.grounded.sum()
        assert gauge.foot_deviation(frame, 0.0) == gauge.FEET
        common = gauge.foot_deviation(frame, 0.13) / np.sqrt(count)
        assert common**2 == pytest.approx(0.13**2 + gauge.FEET**2 / count)


def test_the_world_is_held_by_cameras_and_feet_together() -> None:
    """Cameras that may only be shifted, each by itself, hold the world by their mean; feet do so with them."""
    elastic, pictures = ElasticFrame(tower(1)), level()
    pose, still = start_pose(elastic), RigErrors(turn=1e-5, shift=0.2)
    at = {
        what: gauge.world_deviation(elastic, pose, pictures.cameras, believed(still), what, foot=0.2)
        for what in ("rig", "cameras", "feet")
    }
    assert not at["rig"].any()
    assert at["cameras"].min() == pytest.approx(0.2 / np.sqrt(3), rel=0.02)
    both = 1.0 / np.hypot(np.sqrt(3) / 0.2, np.sqrt(elastic.frame.grounded.sum()) / 0.2)
    assert at["feet"].min() == pytest.approx(both, rel=0.02)
