"""The image loss and the bending term against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from frametwin.fields.network import NetworkField, NetworkShape
from frametwin.fitting.losses import BendingLoss, image_loss
from frametwin.geometry import bezier

BOX = np.array([[-3.0, -3.0, 0.0], [3.0, 3.0, 10.0]])
MAST = bezier.straight([[0.0, 0.0, 0.0]], [[0.0, 0.0, 10.0]])  # from the floor to the ceiling of the box


class TestImageLoss:
    def test_sums_over_views_and_pixels(self) -> None:
        images = [torch.full((2, 3), 0.75), torch.zeros(4, 1)]
        targets = [torch.ones(2, 3), torch.tensor([[1.0], [0.0], [0.5], [0.0]])]
        assert float(image_loss(images, targets)) == pytest.approx(6 * 0.25 + 1.5)

    def test_means_over_the_pixels_of_a_view_are_added(self) -> None:
        images = [torch.full((2, 3), 0.75), torch.zeros(4, 1)]
        targets = [torch.ones(2, 3), torch.tensor([[1.0], [0.0], [0.5], [0.0]])]
        assert float(image_loss(images, targets, reduction="mean")) == pytest.approx(0.25 + 1.5 / 4)
        for larger in (1, 3):  # no view counts more for having more pixels
            scaled = [[t.repeat(larger, larger) for t in side] for side in (images, targets)]
            assert float(image_loss(*scaled, reduction="mean")) == pytest.approx(0.25 + 1.5 / 4)

    def test_refuses_other_reductions(self) -> None:
        with pytest.raises(ValueError, match="'median' is neither"):
            image_loss([torch.zeros(2, 3)], [torch.zeros(2, 3)], reduction="median")

    def test_gradient_is_the_sign_of_the_difference(self) -> None:
        image = torch.tensor([0.2, 0.9, 0.5], requires_grad=True)
        image_loss([image], [torch.tensor([0.6, 0.1, 0.5])]).backward()
        assert image.grad is not None and image.grad.tolist() == [-1.0, 1.0, 0.0]

    @pytest.mark.parametrize(
        ("images", "targets"),
        [([torch.zeros(2, 3)], []), ([torch.zeros(2, 3)], [torch.zeros(3, 2)])],
    )
    def test_refuses_what_does_not_belong_together(self, images: list, targets: list) -> None:
        with pytest.raises(ValueError, match="agree"):
            image_loss(images, targets)


def parabola(points: Tensor) -> Tensor:
    """Laplacian of the displacement (x^2, 0, y^2 / 2): 2, 0, 1 everywhere."""
    return torch.tensor([2.0, 0.0, 1.0], dtype=points.dtype).expand_as(points)


class TestBending:
    def test_gamma_is_the_distance_to_a_power(self) -> None:
        points = np.array([[3.0, 4.0, 5.0], [0.0, 0.0, 7.0], [0.0, 2.0, 13.0]])
        for power in (0.0, 1.0, 2.0, 3.5):
            gamma = BendingLoss(BOX, MAST, power=power).gamma(points)
            np.testing.assert_allclose(gamma, [5.0**power, 0.0**power, np.sqrt(13.0) ** power], rtol=1e-3, atol=1e-3)

    def test_without_a_power_every_point_counts_alike(self) -> None:
        # Also on the print itself; 360 mm^3 times |(2, 0, 1)|^2.
        assert float(BendingLoss(BOX, MAST, power=0.0, samples=100)(parabola)) == pytest.approx(360.0 * 5.0)

    def test_gamma_sees_the_nearest_strut(self) -> None:
        curves = np.concatenate([MAST, bezier.straight([[8.0, 0.0, 0.0]], [[8.0, 30.0, 0.0]])])
        gamma = BendingLoss(BOX, curves, power=1.0).gamma([[7.0, 5.0, 0.0], [1.0, 0.0, 5.0]])
        np.testing.assert_allclose(gamma, [1.0, 1.0], rtol=1e-2)

    def test_integral_in_closed_form(self) -> None:
        # gamma = x^2 + y^2 over a square of half side 3 and the height 10, times |(2, 0, 1)|^2 = 5.
        exact = 5.0 * 10.0 * 8.0 / 3.0 * 3.0**4
        estimate = float(BendingLoss(BOX, MAST, samples=200_000)(parabola))
        assert estimate == pytest.approx(exact, rel=0.01)

    def test_estimates_have_no_bias(self) -> None:
        exact = 5.0 * 10.0 * 8.0 / 3.0 * 3.0**4
        loss = BendingLoss(BOX, MAST, samples=64, seed=3)
        assert np.mean([float(loss(parabola)) for _ in range(1500)]) == pytest.approx(exact, rel=0.02)

    def test_the_seed_decides_and_calls_differ(self) -> None:
        first, same, other = (BendingLoss(BOX, MAST, samples=100, seed=seed) for seed in (1, 1, 2))
        values = [float(first(parabola)) for _ in range(3)]
        assert values == [float(same(parabola)) for _ in range(3)]
        assert len({*values, float(other(parabola))}) == 4

    def test_a_field_learns_to_bend_less(self) -> None:
        field = NetworkField(BOX, NetworkShape(2, 3, 16, 1), seed=1)
        with torch.no_grad():
            field.output.weight.normal_(generator=torch.Generator().manual_seed(0))
        loss = BendingLoss(BOX, MAST, samples=256)
        optimiser = torch.optim.Adam(field.parameters(), lr=1e-2)
        values = []
        for _ in range(60):
            optimiser.zero_grad()
            value = loss(field.laplacian_of, field.dtype)
            value.backward()
            optimiser.step()
            values.append(value.item())
        assert np.mean(values[-5:]) < 0.1 * np.mean(values[:5])

    @pytest.mark.parametrize("wrong", [{"power": -0.5}, {"samples": 0}])
    def test_refuses_settings(self, wrong: dict) -> None:
        with pytest.raises(ValueError, match="needs a strut, a power of 0 or more"):
            BendingLoss(BOX, MAST, **wrong)

    def test_refuses_flat_boxes_and_no_struts(self) -> None:
        with pytest.raises(ValueError, match="volume"):
            BendingLoss([[0, 0, 0], [1, 1, 0]], MAST)
        with pytest.raises(ValueError, match="strut"):
            BendingLoss(BOX, np.zeros((0, 4, 3)))
