"""Gauss-Newton terms of the rods, the evidence of presence, and the pictures they are compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rod_cases import FAR_JOINTS, camera_at, level_of, lone_rod, random_scene, shifted, squared_loss, views

from frametwin.geometry import bezier
from frametwin.raster import rods
from frametwin.raster.pyramid import PIXEL_VARIANCE, Level, Pyramid
from frametwin.raster.rods import Rods, gauss_newton

STEP = 5e-3
"""mm: small enough for the curvature of the pictures, large enough for their float32."""


def with_target(drawn: Rods, cameras: list, blur: float) -> Level:
    """A level whose target is another scene."""
    level = level_of(cameras, blur)
    return replace(level, target=np.float32(1.0) - rods.transmittance(drawn, level))


def crossing(opacity: float = 0.9) -> tuple[Rods, Level]:
    """One curved strut that leads through the pictures of two far cameras, its ends outside of both, and a target
    beside it."""
    cameras = [camera_at([300.0, 10.0, 20.0], (40, 50), 900.0), camera_at([-40.0, 12.0, 300.0], (44, 44), 900.0)]
    ends = np.array([[1.0, -30.0, 3.0], [-2.0, 30.0, -4.0]])
    curves = bezier.straight(ends[:1], ends[1:])
    curves[0, 1:3] += [[1.0, 2.0, 2.0], [0.5, -1.0, -1.5]]
    drawn = Rods(curves, FAR_JOINTS, np.array([[0, 1]]), np.full((1, 6), 1.3), np.full((1, 6), opacity))
    other = shifted(drawn, np.array([0.3, 0.0, 0.4]))
    return drawn, with_target(replace(other, radius=1.1 * other.radius), cameras, 0.7)


def jacobian(draw: Callable[[np.ndarray], Rods], size: int, level: Level, step: float = STEP) -> np.ndarray:
    """(pixels, size) derivatives of the pictures by central differences."""
    columns = []
    for unit in np.eye(size):
        ahead, behind = (rods.transmittance(draw(h * unit), level).astype(np.float64) for h in (step, -step))
        columns.append((behind - ahead) / (2.0 * step))
    return np.column_stack(columns)


def test_the_hessian_is_that_of_finite_differences() -> None:
    drawn, level = crossing()
    terms = gauss_newton(drawn, level)
    slopes = jacobian(lambda x: shifted(drawn, x.reshape(1, 4, 3)), 12, level)
    wanted = slopes.T @ slopes
    np.testing.assert_allclose(terms.hessian[0], wanted, atol=1e-2 * np.abs(wanted).max())
    residual = 1.0 - rods.transmittance(drawn, level) - level.target
    np.testing.assert_allclose(terms.gradient[0], slopes.T @ residual, atol=1e-2 * np.abs(terms.gradient).max())
    assert terms.loss == pytest.approx(0.5 * np.square(residual.astype(np.float64)).sum(), rel=1e-5)


def test_the_radius_has_the_curvature_and_slope_of_finite_differences() -> None:
    drawn, level = crossing()
    terms = gauss_newton(drawn, level)
    slopes = jacobian(lambda x: replace(drawn, radius=drawn.radius + x), 6, level)
    residual = 1.0 - rods.transmittance(drawn, level) - level.target
    curvature = np.square(slopes).sum(axis=0)
    np.testing.assert_allclose(terms.widths[0, :, 0], curvature, atol=1e-2 * curvature.max())
    np.testing.assert_allclose(
        terms.widths[0, :, 1], slopes.T @ residual, atol=5e-3 * np.abs(terms.widths[0, :, 1]).max()
    )


def test_the_joints_have_the_curvature_and_slope_of_finite_differences() -> None:
    cameras = [camera_at([300.0, 10.0, 20.0], (60, 60), 900.0), camera_at([-40.0, 12.0, 300.0], (44, 64), 900.0)]
    drawn = lone_rod([1.0, -5.0, 1.0], [0.0, 6.0, -2.0], 1.3, pieces=2)
    moved = replace(drawn, joints=drawn.joints + np.array([0.2, 0.3, -0.2]))
    level = with_target(moved, cameras, 0.7)
    terms = gauss_newton(drawn, level)
    slopes = jacobian(lambda x: replace(drawn, joints=drawn.joints + x.reshape(2, 3)), 6, level)
    wanted = slopes.T @ slopes
    residual = 1.0 - rods.transmittance(drawn, level) - level.target
    for k in (0, 1):
        own = slice(3 * k, 3 * k + 3)
        np.testing.assert_allclose(terms.joint_hessian[k], wanted[own, own], atol=0.02 * wanted.max())
        np.testing.assert_allclose(
            terms.joint_gradient[k], slopes[:, own].T @ residual, atol=0.02 * np.abs(terms.joint_gradient).max()
        )


@pytest.mark.parametrize("seed", range(3))
def test_hessians_are_symmetric_and_never_negative(seed: int) -> None:
    cameras = views()
    terms = gauss_newton(random_scene(seed), with_target(random_scene(seed + 10), cameras, 0.5))
    for blocks in (terms.hessian, terms.joint_hessian):
        scale = np.abs(blocks).max()
        np.testing.assert_allclose(blocks, blocks.transpose(0, 2, 1), atol=1e-9 * scale)
        assert np.linalg.eigvalsh(blocks).min() > -1e-9 * scale
    assert (terms.widths[..., 0] >= 0.0).all()


def test_at_the_truth_nothing_pulls() -> None:
    scene = random_scene(1)
    terms = gauss_newton(scene, with_target(scene, views(), 0.5))
    assert terms.loss == 0.0
    for slope in (terms.gradient, terms.joint_gradient, terms.widths[..., 1]):
        assert not slope.any()


def test_squared_loss_is_the_loss_of_the_terms() -> None:
    scene, level = random_scene(1), with_target(random_scene(2), views(), 0.5)
    assert gauss_newton(scene, level).loss == pytest.approx(squared_loss(scene, level), rel=1e-6)  # summed in float32


def test_gauss_newton_steps_find_a_strut_again() -> None:
    truth, level = crossing()
    level = replace(level, target=np.float32(1.0) - rods.transmittance(truth, level))
    drawn = shifted(truth, np.random.default_rng(1).normal(scale=0.2, size=(1, 4, 3)))
    start = squared_loss(drawn, level)
    for _ in range(6):
        terms = gauss_newton(drawn, level)
        step = np.linalg.lstsq(terms.hessian[0], -terms.gradient[0], rcond=1e-6)[0]
        drawn = shifted(drawn, step.reshape(1, 4, 3))
    assert squared_loss(drawn, level) < 1e-4 * start


@pytest.mark.parametrize("there", [0.0, 0.35, 0.9])
@pytest.mark.parametrize("guess", [0.0, 0.5, 0.95])
def test_evidence_of_a_lone_strut_gives_its_opacity_at_once(there: float, guess: float) -> None:
    drawn, level = crossing(guess)
    truth = replace(drawn, opacity=np.full((1, 6), there))
    level = replace(level, target=np.float32(1.0) - rods.transmittance(truth, level))
    through = rods.transmittance(drawn, level)
    terms = rods.opacity_terms(drawn, level, through, np.float32(1.0) - through - level.target)
    weight, slope = terms[..., 0], terms[..., 1]
    seen = weight > 1.0  # the first and last piece are outside of the pictures
    assert seen.sum() >= 2
    np.testing.assert_allclose((drawn.opacity - slope / np.maximum(weight, 1e-9))[seen], there, atol=2e-3)


def test_the_weight_of_evidence_is_the_area_in_plain_view() -> None:
    cameras = [camera_at([0.0, -400.0, 0.0], (80, 80), 2000.0)]
    near = lone_rod([-5.0, -3.0, 0.0], [5.0, -3.0, 0.0], 1.0, 2, joints=False)
    far = lone_rod([-5.0, 3.0, 0.2], [5.0, 3.0, 0.2], 0.5, 2, joints=False)
    both = Rods(
        np.concatenate([near.control_points, far.control_points]),
        near.joints,
        np.repeat(near.edges, 2, axis=0),
        np.concatenate([near.radius, far.radius]),
        np.concatenate([near.opacity, far.opacity]),
    )
    level = level_of(cameras, 0.5)

    def weight(drawn: Rods) -> np.ndarray:
        through = rods.transmittance(drawn, level)
        return rods.opacity_terms(drawn, level, through, np.zeros_like(through))[..., 0].sum(axis=1)

    scale = 2000.0 / 397.0  # pixels a millimetre
    soft = 0.564 * level.spread * 10.0 * scale  # what the square of a blurred edge holds less than its area
    assert weight(near)[0] == pytest.approx(10.0 * 2.0 * scale**2 - 2.0 * soft, rel=0.01)
    assert weight(both)[1] < 1e-4 * weight(far)[0]  # wholly behind the other
    seen_beside = 10.0 * (2.0 - 1.0) * scale**2
    assert weight(both)[0] == pytest.approx(seen_beside - 4.0 * soft, abs=4.0 * soft)


def test_levels_are_reduced_and_blurred() -> None:
    cameras = [camera_at([60.0, 5.0, 20.0], (48, 64), 90.0), camera_at([0.0, 50.0, 20.0], (24, 36), 40.0)]
    masks = [
        np.random.default_rng(k).uniform(size=(c.height, c.width)).astype(np.float32) for k, c in enumerate(cameras)
    ]
    half = Pyramid(cameras, masks).level(0.5, 0.0)
    assert half.shapes.tolist() == [[24, 32], [12, 18]]
    assert half.target.dtype == np.float32
    assert half.spread == pytest.approx(np.sqrt(PIXEL_VARIANCE))
    for picture, mask, camera, row in zip(half.pictures(half.target), masks, cameras, half.cameras, strict=True):
        height, width = picture.shape
        np.testing.assert_allclose(picture, mask.reshape(height, 2, width, 2).mean(axis=(1, 3)), atol=1e-6)
        np.testing.assert_allclose(row[12:16] * 2.0, [camera.fl_x, camera.fl_y, camera.cx, camera.cy])
        assert row[16] == 0.0  # the pictures are undistorted
    dot = np.zeros((41, 41), dtype=np.float32)
    dot[20, 20] = 1.0
    wide = Pyramid([camera_at([60.0, 5.0, 20.0], (41, 41), 90.0)], [dot]).level(1.0, 1.5)
    spot = wide.pictures(wide.target)[0]
    assert spot.sum() == pytest.approx(1.0, abs=1e-5)
    assert (spot.sum(axis=0) * (np.arange(41) - 20) ** 2).sum() == pytest.approx(1.5**2, rel=0.01)
    assert wide.spread == pytest.approx(np.sqrt(PIXEL_VARIANCE + 1.5**2))


def test_pixels_per_mm_is_focal_length_over_distance() -> None:
    cameras = [camera_at([50.0, 0.0, 0.0], (40, 40), 100.0), camera_at([0.0, 0.0, 200.0], (40, 40), 100.0, stretch=2.0)]
    pyramid = Pyramid(cameras, [np.zeros((40, 40))] * 2)
    assert pyramid.pixels_per_mm(np.zeros(3)) == pytest.approx((100.0 / 50.0 + 75.0 / 200.0) / 2.0)
    assert pyramid.pixels_per_mm(np.zeros(3), 0.25) == pytest.approx(pyramid.pixels_per_mm(np.zeros(3)) / 4.0)


def test_pictures_that_are_reduced_at_once_are_those_of_their_size() -> None:
    cameras = [camera_at([60.0, 5.0, 20.0], (48, 64), 90.0), camera_at([0.0, 50.0, 20.0], (24, 36), 40.0)]
    rng = np.random.default_rng(3)
    masks = [(rng.random((c.height, c.width)) < 0.5).astype(np.float32) for c in cameras]
    whole, reduced = Pyramid(cameras, masks), Pyramid(cameras, masks, largest=0.5)
    assert [mask.shape for mask in reduced.masks] == [(24, 32), (12, 18)]
    for scale in (0.5, 0.25):
        one, other = whole.level(scale, 0.6), reduced.level(scale, 0.6)
        np.testing.assert_allclose(other.target, one.target, atol=1e-6)
        np.testing.assert_array_equal(other.cameras, one.cameras)
    both, second = reduced.level(0.5, 0.0), reduced.of_views(np.array([1])).level(0.5, 0.0)
    np.testing.assert_array_equal(second.target, both.target[both.offsets[1] :])


def test_black_and_white_is_told_from_grey_and_from_blur() -> None:
    cameras = [camera_at([60.0, 5.0, 20.0], (48, 64), 90.0)]
    disc = cv2.circle(np.zeros((48, 64), dtype=np.float32), (30, 20), 13, 1.0, -1)
    soft = cv2.GaussianBlur(disc, (0, 0), 0.8)
    assert Pyramid(cameras, [disc]).black_and_white
    assert Pyramid(cameras, [disc], largest=0.3).black_and_white  # as they were taken
    assert not Pyramid(cameras, [soft]).black_and_white
    assert not Pyramid(cameras, [disc], [1.5]).black_and_white
