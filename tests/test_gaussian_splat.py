"""The compiled Gaussian splatter against depth-sorted alpha blending in plain torch."""

from __future__ import annotations

import numba
import numpy as np
import pytest
import torch
from torch import Tensor

from frametwin.cameras.rigs import ring_rig
from frametwin.geometry import bezier
from frametwin.raster import gaussian, reference
from frametwin.raster.kernels import KernelLayout, anchored_kernels
from frametwin.raster.projection import Views, low_pass, project_anchored
from frametwin.raster.splat import splat_flat

SIZES = [(40, 56), (33, 21), (18, 70)]  # views may differ


def splat(means: Tensor, conics: Tensor, opacity: Tensor, sizes: list[tuple[int, int]]) -> list[Tensor]:
    """The pictures (H, W) of `splat_flat`."""
    parts = splat_flat(means, conics, opacity, sizes).split([height * width for height, width in sizes])
    return [part.view(size) for part, size in zip(parts, sizes, strict=True)]


def random_scene(seed: int, sizes: list[tuple[int, int]], count: int = 50) -> tuple[Tensor, Tensor, Tensor]:
    """Means, conics and opacity in float64: long and tiny kernels, inside and across the rim and outside."""
    rng = np.random.default_rng(seed)
    shape = (len(sizes), count)
    extent = np.array([[w, h] for h, w in sizes])[:, None]
    means = rng.uniform(-0.2, 1.2, (*shape, 2)) * extent
    turn, long = rng.uniform(0.0, np.pi, shape), rng.uniform(0.4, 9.0, shape)
    short = rng.uniform(0.3, 1.0, shape) * np.minimum(long, 2.0)
    c, s = np.cos(turn), np.sin(turn)
    conics = np.stack(
        [
            (c / long) ** 2 + (s / short) ** 2,
            c * s * (long**-2 - short**-2),
            (s / long) ** 2 + (c / short) ** 2,
        ],
        axis=-1,
    )
    conics[:, ::9] = 0.0  # culled
    means[:, 1] = [1e6, -3e5]  # far outside
    opacity = rng.uniform(0.05, 0.95, shape)
    return tuple(torch.from_numpy(x).requires_grad_() for x in (means, conics, opacity))


def blended(scene: tuple[Tensor, Tensor, Tensor], sizes: list[tuple[int, int]], seed: int = 0) -> list[Tensor]:
    depth = torch.from_numpy(np.random.default_rng(seed).permutation(scene[2].shape[1]))
    return [reference.blend(*(x[v] for x in scene), depth.double(), size) for v, size in enumerate(sizes)]


def weighted_sum(images: list[Tensor], seed: int) -> Tensor:
    """A loss with a different gradient at every pixel."""
    rng = np.random.default_rng(seed)
    parts = [(i.double() * torch.from_numpy(rng.normal(size=i.shape))).sum() for i in images]
    return torch.stack(parts).sum()


@pytest.mark.parametrize("seed", range(3))
def test_equals_sorted_blending(seed: int) -> None:
    scene = random_scene(seed, SIZES)
    for compiled, sorted_blend in zip(splat(*scene, SIZES), blended(scene, SIZES), strict=True):
        assert compiled.dtype == torch.float32
        assert sorted_blend.max() > 0.5
        torch.testing.assert_close(compiled.double(), sorted_blend, rtol=0.0, atol=5e-6)


def test_order_of_depth_does_not_matter() -> None:
    scene = random_scene(7, SIZES)
    for one, other in zip(blended(scene, SIZES, seed=1), blended(scene, SIZES, seed=2), strict=True):
        torch.testing.assert_close(one, other, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_gradients_equal_those_of_sorted_blending(seed: int) -> None:
    scene = random_scene(seed, SIZES)
    compiled = torch.autograd.grad(weighted_sum(splat(*scene, SIZES), seed), scene)
    exact = torch.autograd.grad(weighted_sum(blended(scene, SIZES), seed), scene)
    for mine, truth in zip(compiled, exact, strict=True):
        # The footprint ends at pixels with a kink; float32 rounding beside it moves single terms.
        scale = truth.abs().amax(dim=(0, 1)).clamp(min=1e-3)
        assert ((mine - truth).abs() / scale).max() < 2e-3
        assert ((mine - truth).abs() / scale).mean() < 2e-5


def test_gradients_of_the_reference_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(3)
    means = torch.from_numpy(rng.uniform(1.0, 7.0, (4, 2))).requires_grad_()
    conics = torch.tensor([[0.4, 0.1, 0.3], [0.9, -0.2, 0.5], [0.2, 0.0, 1.2], [2.0, 0.5, 2.0]]).double()
    opacity = torch.from_numpy(rng.uniform(0.2, 0.9, 4)).requires_grad_()
    depth = torch.arange(4.0)
    assert torch.autograd.gradcheck(
        lambda m, c, o: reference.blend(m, c, o, depth, (7, 8), floor=0.0),
        (means, conics.requires_grad_(), opacity),
    )


def test_gradients_of_the_splatter_are_those_of_finite_differences() -> None:
    scene = [x.detach() for x in random_scene(5, SIZES, count=25)]
    rng = np.random.default_rng(9)
    directions = [torch.from_numpy(rng.normal(size=x.shape)) * (x != 0.0) for x in scene]
    directions[1] *= scene[1].abs().amax(-1, keepdim=True) * 0.1
    directions[2] *= 0.1

    def loss(step: float) -> Tensor:
        return weighted_sum(splat(*(x + step * d for x, d in zip(scene, directions, strict=True)), SIZES), 4)

    leaves = [x.clone().requires_grad_() for x in scene]
    grads = torch.autograd.grad(weighted_sum(splat(*leaves, SIZES), 4), leaves)
    slope = sum(float((g * d).sum()) for g, d in zip(grads, directions, strict=True))
    step = 2e-3  # small enough for the curvature, large enough for float32 pictures
    assert slope == pytest.approx(float(loss(step) - loss(-step)) / (2.0 * step), rel=2e-3)


def test_footprint_stays_close_to_the_gaussian() -> None:
    scene = random_scene(11, SIZES)
    for v, (cut, size) in enumerate(zip(splat(*scene, SIZES), SIZES, strict=True)):
        depth = torch.arange(scene[2].shape[1])
        whole = reference.blend(*(x[v] for x in scene), depth, size, floor=0.0)
        assert (cut - whole).abs().max() < 1.0 / 255.0  # a grey level, where many kernels overlap


def test_nothing_to_draw() -> None:
    sizes = [(5, 7), (3, 4)]
    empty = splat(torch.zeros(2, 0, 2), torch.zeros(2, 0, 3), torch.zeros(2, 0), sizes)
    assert [tuple(image.shape) for image in empty] == sizes
    unseen = [torch.full((2, 3, 2), 2.0), torch.zeros(2, 3, 3), torch.ones(2, 3)]
    leaves = [x.requires_grad_() for x in unseen]
    images = splat(*leaves, sizes)
    assert all(not image.any() for image in (*empty, *images))
    for grad in torch.autograd.grad(sum(image.sum() for image in images), leaves):
        assert not grad.any()


def test_many_opaque_kernels_leave_no_denormal_numbers() -> None:
    count = 400
    means = torch.full((1, count, 2), 4.0, requires_grad=True)
    conics = torch.tensor([0.05, 0.0, 0.05]).repeat(1, count, 1).requires_grad_()
    opacity = torch.ones(1, count, requires_grad=True)
    arrays = [x.detach().numpy() for x in (means, conics, opacity)]
    through = gaussian.transmittance(*arrays, np.array([[8, 8]]))
    assert through.min() == pytest.approx(gaussian.MIN_TRANSMITTANCE)
    (image,) = splat(means, conics, opacity, [(8, 8)])
    grads = torch.autograd.grad(image.sum(), (means, conics, opacity))
    assert all(bool(torch.isfinite(g).all()) and not g.any() for g in grads)


def test_same_bits_with_any_number_of_threads() -> None:
    scene = random_scene(2, SIZES, count=80)
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, before):
            numba.set_num_threads(threads)
            flat = splat_flat(*scene, SIZES)
            results.append([flat, *torch.autograd.grad(flat.square().sum(), scene)])
    finally:
        numba.set_num_threads(before)
    for one, other in zip(*results, strict=True):
        assert torch.equal(one, other)


def test_whole_pixels_shift_the_picture() -> None:
    means, conics, opacity = (x.detach()[:1] for x in random_scene(4, [(40, 56)]))
    (here,) = splat(means, conics, opacity, [(40, 56)])
    (there,) = splat(means + torch.tensor([3.0, -2.0]), conics, opacity, [(40, 56)])
    torch.testing.assert_close(there[:-2, 3:], here[2:, :-3], rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("index", range(3))
def test_values_that_are_not_finite_are_refused(index: int) -> None:
    scene = [x.detach().clone() for x in random_scene(0, SIZES)]
    scene[index][0, 5] = float("nan")
    with pytest.raises(FloatingPointError, match=("means", "conics", "opacity")[index]):
        splat(*scene, SIZES)


def test_shapes_that_do_not_fit_are_refused() -> None:
    means, conics, opacity = random_scene(0, SIZES)
    with pytest.raises(ValueError, match="3 views|2 views"):
        splat(means, conics, opacity, SIZES[:2])
    with pytest.raises(ValueError, match="opacity"):
        splat(means, conics, opacity[:, :-1], SIZES)


def test_gradients_reach_curves_thickness_and_opacity() -> None:
    rng = np.random.default_rng(1)
    straight = bezier.straight(rng.normal(scale=6.0, size=(4, 3)), rng.normal(scale=6.0, size=(4, 3)))
    layout, cameras = KernelLayout.even(4, 5), ring_rig([[-9.0] * 3, [9.0] * 3], 2, size=(48, 64))
    views = Views.of(cameras)
    points = torch.from_numpy(straight).requires_grad_()
    tau = torch.from_numpy(rng.uniform(0.3, 0.9, layout.size)).requires_grad_()
    alpha = torch.from_numpy(rng.uniform(0.2, 0.9, layout.size)).requires_grad_()
    leaves = (points, tau, alpha)
    projected = project_anchored(anchored_kernels(points, layout), tau, views)
    scene = low_pass(projected, alpha)
    exact = [reference.blend(*(x[v] for x in scene), projected.depth[v], size) for v, size in enumerate(views.sizes)]
    compiled = splat(*scene, views.sizes)
    for one, other in zip(compiled, exact, strict=True):
        assert other.max() > 0.5
        torch.testing.assert_close(one.double(), other, rtol=0.0, atol=5e-6)
    mine = torch.autograd.grad(weighted_sum(compiled, 0), leaves, retain_graph=True)
    truth = torch.autograd.grad(weighted_sum(exact, 0), leaves)
    for one, other in zip(mine, truth, strict=True):
        assert (one - other).abs().max() < 1e-4 * other.abs().max()
