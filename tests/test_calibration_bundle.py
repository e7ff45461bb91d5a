"""Bundle adjustment: its derivatives, what it recovers, and covariances that are what repeated noise does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from board_pictures import ring

from frametwin.calibration import bundle_terms as module
from frametwin.calibration.boards import corner_points, parse_board
from frametwin.calibration.bundle import Body, Bundle, Eye, Link, Solution, solve
from frametwin.cameras.lens_models import project
from frametwin.dataset.calibration_shots import random_pose

LENSES = {
    "OPENCV": np.array([950.0, 955.0, 480.0, 355.0, -0.2, 0.08, 0.0005, -0.0004, -0.01]),
    "OPENCV_FISHEYE": np.array([450.0, 452.0, 480.0, 355.0, 0.03, -0.01, 0.004, -0.002]),
}


def problem(model: str = "OPENCV", cameras: int = 3, moments: int = 6, noise: float = 0.0, seed: int = 0) -> Bundle:
    """Cameras around boards, everything at its true place, corners with noise."""
    rng = np.random.default_rng(17)
    board = corner_points(parse_board("charuco:7x5:25"))
    rigged = ring(cameras, 500.0, LENSES[model], (960, 720), height=2.0)
    eyes = tuple(
        Eye(model, camera.lens, np.ones(len(camera.lens), dtype=bool), camera.camera_to_world, fixed=i == 0)
        for i, camera in enumerate(rigged)
    )
    poses = [random_pose(rng, rng.uniform(-40.0, 40.0, size=3), [0.0, 0.0, 1.0], 35.0) for _ in range(moments)]
    noisy = np.random.default_rng(seed)
    links = []
    for i, eye in enumerate(eyes):
        for j, pose in enumerate(poses):
            world = board @ pose[:3, :3].T + pose[:3, 3]
            local = (world - eye.camera_to_world[:3, 3]) @ eye.camera_to_world[:3, :3]
            pixels = project(model, eye.lens, local)[0]
            links.append(Link(i, j, board, pixels + noise * noisy.normal(size=pixels.shape)))
    return Bundle(eyes, tuple(Body(pose) for pose in poses), tuple(links))


def shaken(bundle: Bundle, size: float, seed: int = 3) -> tuple[Bundle, np.ndarray, module.Layout]:
    rng = np.random.default_rng(seed)
    layout = module.Layout(bundle)
    x = np.zeros(layout.count)
    for eye, columns in zip(bundle.eyes, layout.eyes, strict=True):
        scale = np.concatenate(
            [[5.0, 5.0, 3.0, 3.0], np.full(len(eye.lens) - 4, 0.002), np.full(3, 0.02), np.full(3, 5.0)]
        )
        x[columns[columns >= 0]] = (rng.normal(size=len(columns)) * scale)[columns >= 0]
    for columns in layout.bodies:
        x[columns] = rng.normal(size=6) * np.array([0.05] * 3 + [5.0] * 3)
    return bundle, size * x, layout


@pytest.mark.parametrize("model", list(LENSES))
def test_derivatives_are_those_of_finite_differences(model: str) -> None:
    bundle, x, layout = shaken(problem(model, 2, 2), 1.0)
    bundle = module.moved(bundle, x, layout)
    batches = module.batches_of(bundle)
    for batch in batches:
        by_eye, by_body = module.jacobian_of(bundle, batch)
        for number, begin, end in batch.spans:
            body = layout.bodies[bundle.links[number].body]
            for matrix, columns in ((by_eye, layout.eyes[batch.eye]), (by_body, body)):
                for i in np.flatnonzero(columns >= 0):
                    step = np.eye(layout.count)[columns[i]] * 1e-6
                    ahead, behind = (
                        module.residuals_of(module.moved(bundle, s * step, layout), batch)[begin:end] for s in (1, -1)
                    )
                    slope = -(ahead - behind).ravel() / 2e-6
                    np.testing.assert_allclose(matrix[2 * begin : 2 * end, i], slope, rtol=1e-4, atol=2e-2)


def errors(found: Solution, wanted: Bundle) -> tuple[float, float]:
    """Largest error of a camera's centre in mm and of its focal length in px."""
    pairs = list(zip(found.bundle.eyes, wanted.eyes, strict=True))
    centre = max(float(np.linalg.norm(a.camera_to_world[:3, 3] - b.camera_to_world[:3, 3])) for a, b in pairs)
    return centre, max(abs(float(a.lens[0] - b.lens[0])) for a, b in pairs)


@pytest.mark.parametrize("model", list(LENSES))
def test_exact_corners_give_back_the_cameras(model: str) -> None:
    wanted = problem(model)
    bundle, x, layout = shaken(wanted, 1.0)
    found = solve(module.moved(bundle, x, layout))
    centre, focal = errors(found, wanted)
    assert centre < 1e-3 and focal < 1e-3 and found.sigma < 1e-4


def test_gross_errors_hardly_matter_to_the_robust_way() -> None:
    wanted = problem(noise=0.1)
    pixels = wanted.links[4].pixels.copy()
    pixels[:3] += 40.0
    spoilt = replace(wanted, links=(*wanted.links[:4], replace(wanted.links[4], pixels=pixels), *wanted.links[5:]))
    plain, robust, ideal = solve(spoilt), solve(spoilt, robust_px=0.3), solve(wanted)
    assert errors(robust, ideal.bundle)[0] < 0.1 * errors(plain, ideal.bundle)[0]


def test_covariances_are_what_repeated_noise_does() -> None:
    ideal = problem(noise=0.0)
    first = solve(problem(noise=0.2, seed=100), covariance=True)
    assert first.sigma == pytest.approx(0.2, rel=0.1)
    covariance = first.eye_covariance(1)
    distances = []
    for seed in range(16):
        found = solve(problem(noise=0.2, seed=seed)).bundle.eyes[1]
        wanted = ideal.eyes[1]
        back = wanted.camera_to_world[:3, :3].T @ found.camera_to_world[:3, :3]
        turn = module.Rotation.from_matrix(back).as_rotvec()
        place = found.camera_to_world[:3, 3] - wanted.camera_to_world[:3, 3]
        error = np.concatenate([found.lens - wanted.lens, turn, place])
        distances.append(error @ np.linalg.solve(covariance, error))
    # Mahalanobis distances are chi-square with 15 degrees of freedom: their mean 15, of 16 of them +- 1.4.
    assert 10.0 < np.mean(distances) < 20.0


def test_a_prior_holds_the_lens_as_firmly_as_it_says() -> None:
    bundle = problem(noise=0.1)
    firm = np.diag(np.full(9, 1e8))
    off = LENSES["OPENCV"] + np.array([10.0, 10.0, 0, 0, 0, 0, 0, 0, 0])
    held = replace(bundle, eyes=tuple(replace(eye, prior=firm, prior_mean=off) for eye in bundle.eyes))
    assert np.abs(solve(held).bundle.eyes[1].lens - off).max() < 0.05
    loose = replace(bundle, eyes=tuple(replace(eye, prior=firm * 1e-20, prior_mean=off) for eye in bundle.eyes))
    np.testing.assert_allclose(solve(loose).bundle.eyes[1].lens, solve(bundle).bundle.eyes[1].lens, rtol=1e-3)


def test_what_is_held_stays_and_has_no_covariance() -> None:
    bundle = problem(noise=0.1)
    free = np.array([True] * 4 + [False] * 5)
    bundle = replace(bundle, eyes=tuple(replace(eye, free=free) for eye in bundle.eyes))
    found = solve(bundle, covariance=True)
    np.testing.assert_array_equal(found.bundle.eyes[0].camera_to_world, bundle.eyes[0].camera_to_world)
    assert not found.eye_covariance(0)[4:].any() and found.eye_covariance(1)[9:, 9:].any()
    np.testing.assert_array_equal(found.bundle.eyes[1].lens[4:], bundle.eyes[1].lens[4:])
