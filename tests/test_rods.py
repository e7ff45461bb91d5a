"""The compiled splatter of blurred rods against depth-sorted alpha blending in plain torch and exact silhouettes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numba
import numpy as np
import pytest
import torch
from rod_cases import (
    camera_at,
    leaves_of,
    level_of,
    lone_rod,
    of_frame,
    random_scene,
    reference_kernels,
    views,
    weighted_sum,
)
from rod_splat import splat_rods
from small_frames import tower
from torch import Tensor

from frametwin.cameras.rigs import ring_rig
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rod_kernels, rod_reference, rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods
from frametwin.raster.silhouette import silhouettes


def pictures(drawn: Rods, level: Level) -> list[np.ndarray]:
    return level.pictures(1.0 - rods.transmittance(drawn, level).astype(np.float64))


def splatted(leaves: tuple[Tensor, ...], drawn: Rods, level: Level) -> list[Tensor]:
    return splat_rods(leaves[0], leaves[1], drawn.edges, leaves[2], leaves[3], level)


@pytest.mark.parametrize("blur", [0.0, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_equals_sorted_blending(seed: int, blur: float) -> None:
    scene, level = random_scene(seed), level_of(views(), blur)
    leaves = leaves_of(scene)
    exact = [rod_reference.blend(*kernels) for kernels in reference_kernels(leaves, scene.edges, level)]
    for compiled, sorted_blend in zip(splatted(leaves, scene, level), exact, strict=True):
        assert compiled.dtype == torch.float32
        assert sorted_blend.max() > 0.5
        torch.testing.assert_close(compiled.double(), sorted_blend, rtol=0.0, atol=1e-5)


def test_order_of_depth_does_not_matter() -> None:
    scene, level = random_scene(7), level_of(views())
    for alphas, depth in reference_kernels([x.detach() for x in leaves_of(scene)], scene.edges, level):
        order = torch.from_numpy(np.random.default_rng(0).permutation(len(depth)))
        one, other = rod_reference.blend(alphas, depth), rod_reference.blend(alphas, depth[order])
        torch.testing.assert_close(one, other, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("seed", "blur"), [(0, 0.0), (1, 0.8), (2, 0.8)])
def test_gradients_equal_those_of_sorted_blending(seed: int, blur: float) -> None:
    scene, level = random_scene(seed), level_of(views(), blur)
    leaves = leaves_of(scene)
    kernels = reference_kernels(leaves, scene.edges, level)
    exact = torch.autograd.grad(weighted_sum([rod_reference.blend(*k) for k in kernels], seed), leaves)
    compiled = torch.autograd.grad(weighted_sum(splatted(leaves, scene, level), seed), leaves)
    for mine, truth in zip(compiled, exact, strict=True):
        assert truth.abs().max() > 0.1
        # The compiled loops take no notice of what is nearly hidden.
        error = (mine - truth).abs() / truth.abs().max()
        assert error.max() < 1e-3
        assert error.mean() < 1e-4


def test_gradients_of_the_reference_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(3)
    camera = torch.from_numpy(level_of([camera_at([30.0, 4.0, 9.0], (7, 9), 9.0, stretch=1.2)]).cameras[0])
    view = rod_reference.ReferenceView(camera, (7, 9), 0.7)
    points = torch.from_numpy(rng.normal(scale=6.0, size=(2, 3, 3))).requires_grad_()
    joints = torch.from_numpy(rng.normal(scale=6.0, size=(3, 3))).requires_grad_()
    radius = torch.from_numpy(rng.uniform(1.0, 4.0, (2, 2))).requires_grad_()
    opacity = torch.from_numpy(rng.uniform(0.6, 0.9, (2, 2))).requires_grad_()
    edges = torch.tensor([[0, 1], [1, 2]])
    assert torch.autograd.gradcheck(
        lambda p, j, r, o: rod_reference.picture(p, j, edges, r, o, view), (points, joints, radius, opacity)
    )


def through_the_picture() -> tuple[Rods, Level]:
    """Struts that begin and end outside of the picture, so that no end is seen."""
    rng = np.random.default_rng(8)
    level = level_of([camera_at([80.0, 3.0, 5.0], (40, 50), 120.0)], 0.8)
    sides = np.array([[0.0, -40.0, 9.0], [0.0, 40.0, -7.0], [5.0, -12.0, -35.0], [-6.0, 3.0, 38.0]])
    curves = bezier.straight(sides[[0, 2]], sides[[1, 3]]) + rng.normal(scale=1.5, size=(2, 4, 3))
    each = np.ones((1, 4))  # all pieces alike, as the place where they differ is no unknown
    radius, opacity = rng.uniform(1.0, 1.5, (2, 1)) * each, rng.uniform(0.6, 0.9, (2, 1)) * each
    return Rods(curves, np.array(sides), np.array([[0, 1], [2, 3]]), radius, opacity), level


@pytest.mark.parametrize(("kind", "size"), [(0, 1.0), (2, 0.1), (3, 0.1)])
def test_gradients_of_the_splatter_are_those_of_finite_differences(kind: int, size: float) -> None:
    scene, level = through_the_picture()
    leaves = leaves_of(scene)
    grad = torch.autograd.grad(weighted_sum(splatted(leaves, scene, level), 4), leaves)[kind]
    rng = np.random.default_rng(2)
    for _ in range(3):
        move = size * torch.from_numpy(rng.uniform(0.2, 1.0, grad.shape)) * grad.sign()  # so that little cancels
        if kind == 2:
            move[:] = move[:, :1] * move[:, :1].sign() * grad.sum(dim=1, keepdim=True).sign()
        step, ends = 4e-3, []  # small enough for the curvature, large enough for float32 pictures
        for h in (step, -step):
            at = [x.detach() + h * move if i == kind else x.detach() for i, x in enumerate(leaves)]
            ends.append(weighted_sum(splatted(tuple(at), scene, level), 4).item())
        assert float((grad * move).sum()) == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=5e-3)


def test_the_gradient_by_the_radius_counts_the_joints_that_grow_with_it() -> None:
    level = level_of([camera_at([0.0, -100.0, 10.0], (60, 60), 200.0)], 1.0)
    scene = lone_rod([-7.0, 2.0, -4.0], [6.0, 0.0, 5.0], 1.2, pieces=2)

    def area(radius: float) -> tuple[float, Tensor]:
        leaves = leaves_of(replace(scene, radius=np.full((1, 2), radius)))
        total = splatted(leaves, scene, level)[0].double().sum()
        return total.item(), torch.autograd.grad(total, leaves)[2]

    ahead, behind = area(1.21)[0], area(1.19)[0]
    assert float(area(1.2)[1].sum()) == pytest.approx((ahead - behind) / 0.02, rel=2e-3)


def test_a_strut_that_moves_with_its_joints_has_the_gradient_of_finite_differences() -> None:
    level = level_of([camera_at([0.0, -100.0, 10.0], (60, 60), 200.0)], 1.0)
    y, x = np.mgrid[:60, :60]
    weight = torch.from_numpy(np.sin(0.13 * x + 0.4) * np.cos(0.09 * y))
    start, end = np.array([-7.0, 2.0, -4.0]), np.array([6.0, 0.0, 5.0])
    scene = lone_rod(start, end, 1.2, pieces=3)

    def loss(leaves: tuple[Tensor, ...]) -> Tensor:
        return (splatted(leaves, scene, level)[0].double() * weight).sum()

    leaves = leaves_of(scene)
    by_curve, by_joint, _, _ = torch.autograd.grad(loss(leaves), leaves)
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, [0.0, 1.0, 0.0])
    # Along it the flat ends move too, which is left out: beneath the rims of the discs it shows a little.
    for direction, tolerance in ((across, 0.01), (np.array([0.0, 1.0, 0.0]), 0.02), (along, 0.3)):
        d = torch.from_numpy(direction)
        slope = float((by_curve @ d).sum() + (by_joint @ d).sum())
        moved = [(leaves[0] + h * d, leaves[1] + h * d, *leaves[2:]) for h in (0.2, -0.2)]
        ahead, behind = (float(loss(leaf).detach()) for leaf in moved)
        assert slope == pytest.approx((ahead - behind) / 0.4, rel=tolerance, abs=0.02)


@pytest.mark.parametrize(("blur", "tolerance"), [(0.0, 0.045), (0.5, 3e-3), (1.0, 1.5e-3)])
@pytest.mark.parametrize("radius", [0.2, 0.6, 1.5])  # 0.8, 2.4 and 6 pixels
def test_a_lone_rod_covers_what_its_silhouette_covers(radius: float, blur: float, tolerance: float) -> None:
    camera = camera_at([20.0, -500.0, 60.0], (48, 64), 2000.0)
    frame = Wireframe.create([[-30.0, 0.0, -13.0], [30.0, 5.0, 12.0]], [[0, 1]], radius=radius)
    fine = silhouettes(frame, [camera.resized(64 * 16, 48 * 16)])[0] / 255.0
    if blur > 0.0:
        fine = cv2.GaussianBlur(fine, (0, 0), 16.0 * blur)
    exact = fine.reshape(48, 16, 64, 16).mean(axis=(1, 3))
    found = pictures(of_frame(frame, 4), level_of([camera], blur))[0]
    inside = np.s_[5:-5, 5:-5]  # blurring knows nothing beyond the picture's rim
    assert exact[inside].max() > 0.3
    # A pixel is a box, the rod's edge a normal distribution as wide: the less blur, the more that shows.
    np.testing.assert_allclose(found[inside], exact[inside], atol=tolerance)
    assert found[inside].sum() == pytest.approx(exact[inside].sum(), rel=2e-3)


@pytest.mark.parametrize(("blur", "tolerance"), [(0.0, 8e-3), (0.5, 2e-3), (2.0, 2e-3)])
@pytest.mark.parametrize("angle", [0.0, 21.0, 45.0, 90.0])
def test_the_area_is_length_times_width(angle: float, blur: float, tolerance: float) -> None:
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    scene = lone_rod([-9.0 * c, 0.0, -9.0 * s], [9.0 * c, 0.0, 9.0 * s], 0.9, pieces=3, joints=False)
    camera = camera_at([0.0, -1000.0, 0.0], (120, 120), 4000.0)  # 4 pixels a millimetre
    area = pictures(scene, level_of([camera], blur))[0].sum()
    assert area == pytest.approx(18.0 * 1.8 * 16.0, rel=tolerance)


def test_joints_round_the_ends() -> None:
    camera = camera_at([0.0, -800.0, 0.0], (90, 90), 4000.0)
    frame = Wireframe.create([[-5.0, 0.0, 0.0], [5.0, 0.0, 0.0]], [[0, 1]], radius=1.2)
    exact = silhouettes(frame, [camera], supersampling=8)[0].sum() / 255.0
    assert pictures(of_frame(frame, 2), level_of([camera], 0.0))[0].sum() == pytest.approx(exact, rel=0.015)


def test_a_quarter_turn_of_the_camera_turns_the_picture() -> None:
    """Bent by more than a right angle in all, with few pieces: nothing may depend on rows and columns."""
    curve = np.array([[[-8.0, 0.0, -4.0], [-6.0, 0.0, 12.0], [7.0, 1.0, 11.0], [8.0, 0.0, -5.0]]])
    scene = Rods(curve, curve[0, [0, 3]], np.array([[0, 1]]), np.full((1, 3), 1.4), np.full((1, 3), 0.8))
    camera = camera_at([3.0, -100.0, 8.0], (91, 91), 400.0)
    camera = replace(camera, cx=45.5, cy=45.5)
    turned = np.eye(4)
    turned[:2, :2] = [[0.0, 1.0], [-1.0, 0.0]]
    rolled = replace(camera, camera_to_world=camera.camera_to_world @ turned)
    upright, lying = (pictures(scene, level_of([c], 0.4))[0] for c in (camera, rolled))
    assert upright.max() > 0.7
    assert min(np.abs(lying - np.rot90(upright, k)).max() for k in (1, 3)) < 1e-5


@pytest.mark.parametrize("pieces", [4, 5, 8])
@pytest.mark.parametrize("axis", [0, 2])
def test_a_curved_strut_seen_end_on_throws_no_spike(pieces: int, axis: int) -> None:
    ends = np.array([[0.0, -8.0, 0.0], [0.0, 8.0, 0.0]])
    ends[1, 2 - axis] = 0.1
    curve = bezier.straight(ends[:1], ends[1:])
    curve[:, 1:3, axis] += 4.0  # in the picture it goes out and comes back on itself
    frame = Wireframe.create(ends, [[0, 1]], control_points=curve, radius=1.0)
    camera = camera_at([0.0, -100.0, 0.0], (80, 160), 400.0)
    exact = silhouettes(frame, [camera], supersampling=4)[0] / 255.0
    found = pictures(of_frame(frame, pieces), level_of([camera], 0.0))[0]
    assert not found[cv2.dilate(exact, np.ones((7, 7))) == 0.0].any()
    assert found.sum() == pytest.approx(exact.sum(), rel=0.08)


def test_whole_pixels_shift_the_picture() -> None:
    camera = views()[0]
    moved = replace(camera, cx=camera.cx + 3.0, cy=camera.cy - 2.0)
    here, there = (pictures(random_scene(4), level_of([c]))[0] for c in (camera, moved))
    np.testing.assert_allclose(there[:-2, 3:], here[2:, :-3], atol=1e-6)


def test_pieces_without_opacity_are_as_if_they_were_not() -> None:
    scene, level = random_scene(5), level_of(views())
    scene.opacity[2] = 0.0
    others = [0, 1, 3, 4, 5]
    without = Rods(
        scene.control_points[others], scene.joints, scene.edges[others], scene.radius[others], scene.opacity[others]
    )
    np.testing.assert_array_equal(rods.transmittance(scene, level), rods.transmittance(without, level))


def test_nothing_to_draw() -> None:
    level = level_of(views())
    behind = lone_rod([400.0, 30.0, 130.0], [380.0, 90.0, 100.0], 3.0)  # behind the first, outside of the others
    nothing = Rods(
        np.zeros((0, 4, 3)), np.zeros((0, 3)), np.zeros((0, 2), dtype=int), np.zeros((0, 5)), np.zeros((0, 5))
    )
    for scene in (behind, nothing):
        leaves = leaves_of(scene)
        found = splatted(leaves, scene, level)
        assert [tuple(p.shape) for p in found] == [tuple(shape) for shape in level.shapes.tolist()]
        assert not any(bool(p.any()) for p in found)
        for grad in torch.autograd.grad(sum(p.sum() for p in found), leaves):
            assert not grad.any()


def test_many_opaque_rods_leave_no_denormal_numbers() -> None:
    rod = lone_rod([-20.0, 0.0, 0.0], [20.0, 0.0, 0.0], 3.0)
    scene = Rods(
        *(np.repeat(x, 60, axis=0) for x in (rod.control_points,)),
        rod.joints,
        np.repeat(rod.edges, 60, axis=0),
        np.repeat(rod.radius, 60, axis=0),
        np.repeat(rod.opacity, 60, axis=0),
    )
    level = level_of([camera_at([0.0, -60.0, 0.0], (30, 30), 60.0)])
    assert rods.transmittance(scene, level).min() == pytest.approx(rod_kernels.DARK)
    leaves = leaves_of(scene)
    for grad in torch.autograd.grad(splatted(leaves, scene, level)[0].sum(), leaves):
        assert bool(torch.isfinite(grad).all())


def test_same_bits_with_any_number_of_threads() -> None:
    scene, level = random_scene(2, struts=9), level_of(views())
    leaves = leaves_of(scene)
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, before):
            numba.set_num_threads(threads)
            found = splatted(leaves, scene, level)
            results.append([*found, *torch.autograd.grad(sum(p.square().sum() for p in found), leaves)])
    finally:
        numba.set_num_threads(before)
    for one, other in zip(*results, strict=True):
        assert torch.equal(one, other)


def test_a_drawing_that_is_kept_is_that_of_the_same_rods_alone() -> None:
    """Whatever of the rods or cameras changes, the picture is that of a level on which nothing was drawn before."""
    frame = tower()
    cameras = ring_rig(frame, 3, size=(60, 80))
    masks = [np.zeros((60, 80), dtype=np.float32)] * 3
    level = Pyramid(cameras, masks).level(1.0, 0.7)
    first = Rods(
        control_points=frame.control_points,
        joints=frame.vertices,
        edges=frame.edges,
        radius=np.repeat(frame.radius[:, None], 4, axis=1),
        opacity=np.ones((frame.strut_count, 4)),
    )
    changed = [
        replace(first, control_points=first.control_points + 1.0),
        replace(first, joints=first.joints + 1.0),
        replace(first, radius=1.2 * first.radius),
        replace(first, opacity=np.where(np.arange(4) == 2, 0.0, first.opacity)),
        replace(first, joint_size=np.full(frame.vertex_count, 2.0)),
        first,
    ]
    for drawn in changed:
        rods.transmittance(first, level)
        rods.plain_evidence(first, level)
        for kept, fresh in (
            (rods.transmittance(drawn, level), rods.transmittance(drawn, replace(level))),
            (rods.plain_evidence(drawn, level), rods.plain_evidence(drawn, replace(level))),
        ):
            np.testing.assert_array_equal(kept, fresh)
    other = replace(level, cameras=level.cameras + 1e-3)
    assert not np.array_equal(rods.transmittance(first, other), rods.transmittance(first, level))


@pytest.mark.parametrize("pieces", [8, 12])
def test_a_fine_polyline_lies_as_much_within_a_bend_as_outside_of_it(pieces: int) -> None:
    handle = 4.0 / 3.0 * np.tan(np.pi / 16.0)  # an eighth of a circle of radius 50
    turn = np.array([[1.0, 0.0], [1.0, handle], [0.0, 0.0], [np.sqrt(0.5), np.sqrt(0.5)]])
    turn[2] = turn[3] + handle * np.array([np.sqrt(0.5), -np.sqrt(0.5)])
    corners = rods.basis(pieces) @ (50.0 * turn)
    share = np.linspace(0.0, 1.0, 101)[:, None, None]
    along = corners[:-1] + share * np.diff(corners, axis=0)
    outside = np.linalg.norm(along, axis=2) - 50.0
    sagitta = 50.0 * (1.0 - np.cos(np.pi / 8.0 / pieces))  # by which one with its corners on the circle lies within
    assert abs(outside[:, 1:-1].mean()) < 0.03 * sagitta
    assert abs(outside).max() < sagitta
    np.testing.assert_array_equal(corners[[0, -1]], 50.0 * turn[[0, -1]])
