"""Anchored kernels in space and their projection into pictures."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from torch import Tensor

from frametwin.cameras import Camera, look_at
from frametwin.geometry import bezier
from frametwin.geometry.rotation_frames import rotation_minimising_frames
from frametwin.raster.kernels import (
    KernelLayout,
    adaptive_counts,
    anchored_kernels,
    anisotropic_covariance,
    effective_radius,
    isotropic_covariance,
    kernel_frames,
)
from frametwin.raster.projection import (
    PIXEL_VARIANCE,
    Views,
    low_pass,
    project_anchored,
    project_covariances,
)


def curves(count: int = 5, seed: int = 0) -> Tensor:
    """Bent curves of some 30 mm around the origin."""
    rng = np.random.default_rng(seed)
    start, end = rng.normal(scale=12.0, size=(2, count, 3))
    bent = bezier.straight(start, end)
    bent[:, 1:3] += rng.normal(scale=2.0, size=(count, 2, 3))
    return torch.from_numpy(bent).requires_grad_()


def cameras() -> list[Camera]:
    poses = [look_at([120.0, 20.0, 40.0], [0.0, 0.0, 0.0]), look_at([-60.0, 90.0, -10.0], [2.0, 0.0, 1.0])]
    return [
        Camera("a", 160, 120, 210.0, 205.0, 81.0, 58.0, poses[0]),
        Camera("b", 100, 140, 130.0, 131.0, 48.5, 71.0, poses[1]),
    ]


class TestLayout:
    def test_parameters_are_those_of_equation_2(self) -> None:
        layout = KernelLayout.even(3, 20)
        expected = [(j + 0.5) / 20 for j in range(20)]
        np.testing.assert_allclose(layout.parameter.reshape(3, 20), [expected] * 3, rtol=1e-15)
        np.testing.assert_array_equal(layout.strut_of_kernel, np.repeat([0, 1, 2], 20))
        assert layout.even_count == 20

    def test_ragged(self) -> None:
        layout = KernelLayout(np.array([2, 1, 4]))
        assert layout.size == 7 and layout.even_count is None
        np.testing.assert_array_equal(layout.strut_of_kernel, [0, 0, 1, 2, 2, 2, 2])
        np.testing.assert_allclose(layout.parameter, [0.25, 0.75, 0.5, 0.125, 0.375, 0.625, 0.875])
        np.testing.assert_allclose(layout.half_step, [0.25, 0.25, 0.5, 0.125, 0.125, 0.125, 0.125])

    @pytest.mark.parametrize("counts", [[], [3, 0], [[1, 2]]])
    def test_refuses_struts_without_kernels(self, counts: list) -> None:
        with pytest.raises(ValueError, match="count"):
            KernelLayout(np.array(counts))


class TestAnchors:
    def test_straight_strut_in_closed_form(self) -> None:
        line = torch.from_numpy(bezier.straight([[1.0, 2.0, 3.0]], [[1.0, 2.0, 43.0]]))
        kernels = anchored_kernels(line, KernelLayout.even(1, 8), spread=0.5)
        np.testing.assert_allclose(kernels.means[:, 2], 3.0 + 40.0 * (np.arange(8) + 0.5) / 8, rtol=1e-14)
        np.testing.assert_allclose(kernels.means[:, :2], [[1.0, 2.0]] * 8, rtol=1e-14)
        np.testing.assert_allclose(kernels.tangents, [[0.0, 0.0, 1.0]] * 8, atol=1e-14)
        np.testing.assert_allclose(kernels.along, 0.5 * 40.0 / 8, rtol=1e-14)
        covariance = isotropic_covariance(kernels, torch.full((8,), 0.7, dtype=torch.float64))
        np.testing.assert_allclose(covariance, [np.diag([0.49, 0.49, 6.25])] * 8, atol=1e-13)

    def test_bent_struts_agree_with_the_curve(self) -> None:
        points, layout = curves(), KernelLayout.even(5, 6)
        kernels = anchored_kernels(points, layout)
        u = (np.arange(6) + 0.5) / 6
        plain = points.detach().numpy()
        slope = bezier.derivative(plain, u)
        chord = bezier.evaluate(plain, u + 1.0 / 12.0) - bezier.evaluate(plain, u - 1.0 / 12.0)
        np.testing.assert_allclose(kernels.means.detach().view(5, 6, 3), bezier.evaluate(plain, u), atol=1e-12)
        unit = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
        np.testing.assert_allclose(kernels.tangents.detach().view(5, 6, 3), unit, atol=1e-12)
        np.testing.assert_allclose(kernels.along.detach().view(5, 6), np.linalg.norm(chord, axis=-1), rtol=1e-12)

    def test_ragged_struts_equal_even_ones(self) -> None:
        points = curves()
        ragged = anchored_kernels(points, KernelLayout(np.array([3, 5, 4, 5, 2])), spread=1.5)
        owner = KernelLayout(np.array([3, 5, 4, 5, 2])).strut_of_kernel
        even = anchored_kernels(points, KernelLayout.even(5, 5), spread=1.5)
        for strut in (1, 3):
            for name in ("means", "tangents", "along"):
                mine = getattr(ragged, name)[torch.from_numpy(owner == strut)]
                torch.testing.assert_close(mine, getattr(even, name)[5 * strut : 5 * strut + 5], rtol=0, atol=1e-12)

    def test_gradients(self) -> None:
        layout = KernelLayout(np.array([2, 3]))

        def everything(points: Tensor) -> tuple[Tensor, ...]:
            kernels = anchored_kernels(points, layout)
            return kernels.means, kernels.tangents, kernels.along

        assert torch.autograd.gradcheck(everything, (curves(2),))

    def test_a_collapsed_strut_has_finite_gradients(self) -> None:
        points = torch.zeros(1, 4, 3, dtype=torch.float64, requires_grad=True)
        kernels = anchored_kernels(points, KernelLayout.even(1, 3))
        (grad,) = torch.autograd.grad(kernels.means.sum() + kernels.tangents.sum() + kernels.along.sum(), points)
        assert torch.isfinite(grad).all()

    def test_refuses_another_number_of_struts(self) -> None:
        with pytest.raises(ValueError, match="4 struts"):
            anchored_kernels(curves(5), KernelLayout.even(4, 2))


class TestFrames:
    layout = KernelLayout(np.array([4, 3, 4, 6, 2]))

    def test_orthonormal_and_rotation_minimising(self) -> None:
        points = curves()
        frames = kernel_frames(points, self.layout, anchored_kernels(points, self.layout)).detach()
        eye = torch.eye(3, dtype=torch.float64).expand(self.layout.size, 3, 3)
        torch.testing.assert_close(frames.transpose(1, 2) @ frames, eye, rtol=0.0, atol=1e-12)
        assert torch.linalg.det(frames).min() > 0.99
        for strut, count in enumerate(self.layout.counts):
            u = (np.arange(count) + 0.5) / count
            expected = rotation_minimising_frames(points[strut].detach().numpy(), u)
            mine = frames[torch.from_numpy(self.layout.strut_of_kernel == strut)]
            np.testing.assert_allclose(mine[..., 1], expected.normal, atol=1e-9)
            np.testing.assert_allclose(mine[..., 2], expected.binormal, atol=1e-9)

    def test_equal_spread_across_hides_the_frame(self) -> None:
        points = curves()
        kernels = anchored_kernels(points, self.layout)
        frames = kernel_frames(points, self.layout, kernels)
        tau = torch.linspace(0.3, 1.2, self.layout.size, dtype=torch.float64)
        general = anisotropic_covariance(frames, torch.stack([kernels.along, tau, tau], dim=-1))
        torch.testing.assert_close(general, isotropic_covariance(kernels, tau), rtol=1e-10, atol=1e-10)

    def test_unequal_spread_has_the_wanted_axes(self) -> None:
        points = curves()
        frames = kernel_frames(points, self.layout, anchored_kernels(points, self.layout))
        scales = torch.tensor([4.0, 2.0, 0.5]).double().expand(self.layout.size, 3)
        covariance = anisotropic_covariance(frames, scales)
        for axis, value in enumerate((16.0, 4.0, 0.25)):
            direction = frames[:, :, axis : axis + 1]
            torch.testing.assert_close(covariance @ direction, value * direction, rtol=0.0, atol=1e-10)


class TestAdaptiveCounts:
    def straight(self, length: float) -> np.ndarray:
        return bezier.straight([[0.0, -length / 2, 0.0]], [[0.0, length / 2, 0.0]])

    def camera(self, distance: float) -> Camera:
        return Camera("c", 400, 300, 500.0, 500.0, 200.0, 150.0, look_at([distance, 0.0, 0.0], [0.0] * 3))

    def test_neighbours_are_a_radius_apart(self) -> None:
        counts = adaptive_counts(self.straight(30.0), [2.0], [self.camera(200.0)])
        assert counts.tolist() == [15]
        assert adaptive_counts(self.straight(30.0), [1.0], [self.camera(200.0)]).tolist() == [30]

    def test_pixels_bound_the_density(self) -> None:
        # 500 px at 1000 mm: 30 mm are 15 px, and kernels a pixel apart are enough however thin the strut is.
        assert adaptive_counts(self.straight(30.0), [0.01], [self.camera(1000.0)]).tolist() == [15]

    def test_bounds(self) -> None:
        assert adaptive_counts(self.straight(0.1), [2.0], [self.camera(200.0)], minimum=3).tolist() == [3]
        assert adaptive_counts(self.straight(90.0), [0.1], [self.camera(200.0)], maximum=25).tolist() == [25]

    def test_the_view_that_sees_most_decides(self) -> None:
        along = Camera("d", 400, 300, 500.0, 500.0, 200.0, 150.0, look_at([0.0, 200.0, 0.0], [0.0] * 3))
        both = adaptive_counts(self.straight(30.0), [2.0], [along, self.camera(200.0)])
        assert both.tolist() == [15]
        assert adaptive_counts(self.straight(30.0), [2.0], [along]).tolist() == [4]

    def test_a_strut_behind_the_camera_takes_the_least(self) -> None:
        away = Camera("e", 400, 300, 500.0, 500.0, 200.0, 150.0, look_at([200.0, 0.0, 0.0], [400.0, 0.0, 0.0]))
        assert adaptive_counts(self.straight(30.0), [2.0], [away]).tolist() == [4]


@pytest.mark.parametrize("spread", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 0.99])
def test_effective_radius_is_where_coverage_halves(alpha: float, spread: float) -> None:
    tau = 0.8

    def coverage(across: float) -> float:
        steps = np.arange(-60, 61)  # spacing 1, sigma_t = spread, seen at a kernel's mean
        values = np.exp(-0.5 * (across / tau) ** 2 - 0.5 * (steps / spread) ** 2)
        return float(1.0 - np.prod(1.0 - alpha * values))

    radius = float(effective_radius(tau, alpha, spread=spread))
    assert coverage(radius) == pytest.approx(0.5 * coverage(0.0), rel=1e-3)


class TestProjection:
    def kernels(self) -> tuple:
        kernels = anchored_kernels(curves(), KernelLayout.even(5, 4))
        tau = torch.linspace(0.3, 1.5, 20, dtype=torch.float64)
        return kernels, tau

    def test_means_are_the_cameras_pixels(self) -> None:
        kernels, tau = self.kernels()
        projected = project_anchored(kernels, tau, Views.of(cameras()))
        for v, camera in enumerate(cameras()):
            pixels, depth = camera.project(kernels.means.detach().numpy())
            seen = projected.visible[v].numpy()
            assert seen.any()
            np.testing.assert_allclose(projected.means[v].detach()[seen], pixels[seen], atol=1e-9)
            np.testing.assert_allclose(projected.depth[v].detach(), depth, atol=1e-9)

    def test_covariances_are_those_of_the_linearised_camera(self) -> None:
        kernels, tau = self.kernels()
        projected = project_anchored(kernels, tau, Views.of(cameras()))
        covariance = isotropic_covariance(kernels, tau).detach().numpy()
        means, step = kernels.means.detach().numpy(), 1e-4
        for v, camera in enumerate(cameras()):
            ahead = [camera.project(means + step * e)[0] - camera.project(means - step * e)[0] for e in np.eye(3)]
            jacobian = np.stack(ahead, axis=-1) / (2.0 * step)  # (N, 2, 3)
            flat = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
            seen = projected.visible[v].numpy()
            expected = np.stack([flat[:, 0, 0], flat[:, 0, 1], flat[:, 1, 1]], axis=-1)[seen]
            np.testing.assert_allclose(projected.covariances[v].detach()[seen], expected, rtol=1e-5, atol=1e-6)

    def test_short_cut_equals_general_projection(self) -> None:
        kernels, tau = self.kernels()
        views = Views.of(cameras())
        short = project_anchored(kernels, tau, views)
        general = project_covariances(kernels.means, isotropic_covariance(kernels, tau), views)
        for name in ("means", "covariances", "depth"):
            torch.testing.assert_close(getattr(short, name), getattr(general, name), rtol=1e-10, atol=1e-10)
        assert torch.equal(short.visible, general.visible)

    def test_behind_and_far_beside_is_not_seen(self) -> None:
        camera = Camera("c", 100, 80, 100.0, 100.0, 50.0, 40.0, np.eye(4))
        points = torch.tensor(
            [[0.0, 0.0, 50.0], [0.0, 0.0, -50.0], [0.0, 0.0, 0.0], [500.0, 0.0, 50.0], [0.0, 0.0, 0.5]]
        ).double()
        eye = torch.eye(3, dtype=torch.float64).expand(5, 3, 3)
        projected = project_covariances(points.requires_grad_(), eye, Views.of([camera]))
        assert projected.visible.tolist() == [[True, False, False, False, False]]
        opacity = torch.full((5,), 0.5, dtype=torch.float64)
        means, conics, faded = low_pass(projected, opacity)
        assert not conics[0, 1:].any()
        (grad,) = torch.autograd.grad(means.sum() + conics.sum() + faded.sum(), points)
        assert torch.isfinite(grad).all()

    def test_low_pass_widens_and_keeps_the_integral(self) -> None:
        kernels, tau = self.kernels()
        projected = project_anchored(kernels, 0.2 * tau, Views.of(cameras()))
        opacity = torch.linspace(0.1, 0.9, 20, dtype=torch.float64)
        _, conics, faded = low_pass(projected, opacity)
        xx, xy, yy = projected.covariances.unbind(-1)
        a, b, c = conics.unbind(-1)
        seen = projected.visible
        inverse = torch.linalg.inv(torch.stack([a, b, b, c], -1).view(2, 20, 2, 2)[seen])
        torch.testing.assert_close(inverse[:, 0, 0], xx[seen] + PIXEL_VARIANCE, rtol=1e-8, atol=1e-8)
        torch.testing.assert_close(inverse[:, 0, 1], xy[seen], rtol=1e-8, atol=1e-8)
        torch.testing.assert_close(inverse[:, 1, 1], yy[seen] + PIXEL_VARIANCE, rtol=1e-8, atol=1e-8)
        before = opacity * torch.sqrt(xx * yy - xy**2)
        after = faded * torch.sqrt(torch.linalg.det(torch.stack([a, b, b, c], -1).view(2, 20, 2, 2)) ** -1)
        torch.testing.assert_close(after[seen], before[seen], rtol=1e-9, atol=1e-12)

    def test_no_low_pass_changes_nothing(self) -> None:
        kernels, tau = self.kernels()
        opacity = torch.full((20,), 0.4, dtype=torch.float64)
        _, _, faded = low_pass(project_anchored(kernels, tau, Views.of(cameras())), opacity, variance=0.0)
        torch.testing.assert_close(faded, opacity.expand(2, 20), rtol=1e-12, atol=1e-12)

    def test_gradients(self) -> None:
        layout, views = KernelLayout.even(2, 2), Views.of(cameras())

        def everything(points: Tensor, tau: Tensor, opacity: Tensor) -> tuple[Tensor, ...]:
            return low_pass(project_anchored(anchored_kernels(points, layout), tau, views), opacity)

        tau = torch.tensor([0.3, 0.5, 0.8, 1.1], dtype=torch.float64, requires_grad=True)
        opacity = torch.tensor([0.2, 0.5, 0.8, 0.9], dtype=torch.float64, requires_grad=True)
        points = torch.tensor(0.5 * curves(2).detach().numpy(), requires_grad=True)
        assert torch.autograd.gradcheck(everything, (points, tau, opacity))

    def test_single_precision_agrees_with_double(self) -> None:
        kernels, tau = self.kernels()
        opacity = torch.full((20,), 0.4, dtype=torch.float64)
        double = low_pass(project_anchored(kernels, tau, Views.of(cameras())), opacity)
        names = [f.name for f in dataclasses.fields(kernels)]
        single_kernels = dataclasses.replace(kernels, **{n: getattr(kernels, n).float() for n in names})
        views = Views.of(cameras(), torch.float32)
        single = low_pass(project_anchored(single_kernels, tau.float(), views), opacity.float())
        for one, other in zip(single, double, strict=True):
            assert one.dtype == torch.float32
            torch.testing.assert_close(one.double(), other, rtol=1e-4, atol=1e-3)

    def test_a_sphere_on_the_axis_in_closed_form(self) -> None:
        camera = Camera("c", 100, 80, 120.0, 90.0, 50.0, 40.0, np.eye(4))
        tau = 2.0
        point = torch.tensor([[0.0, 0.0, 60.0]]).double()
        projected = project_covariances(point, tau**2 * torch.eye(3).double()[None], Views.of([camera]))
        expected = [(120.0 * tau / 60.0) ** 2, 0.0, (90.0 * tau / 60.0) ** 2]
        np.testing.assert_allclose(projected.covariances[0, 0], expected, atol=1e-12)
        assert math.isclose(float(projected.means[0, 0, 0]), 50.0)
