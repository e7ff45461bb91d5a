"""How the fit moves a frame: smooth motions and their descent, and free steps against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from rod_cases import squared_loss
from scipy import sparse
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.fast_settings import CoarseStage
from frametwin.fitting.loads import load_answers, rigid_motions, smooth_warps
from frametwin.fitting.motion import (
    GROUND,
    Pose,
    as_rods,
    free_step,
    joint_system,
    smooth_descent,
    start_pose,
    strain,
    without_inner,
)
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import solve_clamped
from frametwin.mechanics.stiffness import FrameBeams
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Terms
from frametwin.raster.silhouette import silhouettes

FRAMES = {"straight": tower(), "curved": tower(curved=True)}


def remainder(wanted: np.ndarray, motions: np.ndarray) -> float:
    """Share of a motion (6V,) that is not in the span of others (6V, M)."""
    shares = np.linalg.lstsq(motions, wanted, rcond=1e-10)[0]
    return float(np.linalg.norm(motions @ shares - wanted) / np.linalg.norm(wanted))


def lumped(frame: Wireframe, force: np.ndarray) -> np.ndarray:
    """(V, 6) loads of a body force (V, 3) on half of every strut that ends at a joint."""
    weight = np.zeros(frame.vertex_count)
    for strut, length in zip(frame.edges, frame.chord_lengths, strict=True):
        weight[strut] += length / 2.0
    return np.concatenate([force * weight[:, None], np.zeros_like(force)], axis=1)


def clamped(elastic: ElasticFrame, loads: np.ndarray) -> np.ndarray:
    """(V, 6) displacements by the finite elements' own solver."""
    matrix = sparse.csc_matrix(elastic.assemble(elastic.stiffness).toarray())
    return solve_clamped(matrix, loads, elastic.frame.grounded)


@pytest.mark.parametrize("name", FRAMES)
def test_rigid_motions_are_rigid(name: str) -> None:
    elastic = ElasticFrame(FRAMES[name])
    motions = rigid_motions(elastic.frame.vertices)
    stiffness = elastic.assemble(elastic.stiffness)
    assert motions.shape == (6 * elastic.vertex_count, 6)
    assert np.abs(stiffness @ motions).max() < 1e-9 * np.abs(stiffness.entries).max()
    assert np.linalg.matrix_rank(motions) == 6
    furthest = np.linalg.norm(motions.reshape(-1, 6, 6)[:, :3], axis=1).max(axis=0)
    np.testing.assert_allclose(furthest[:3], 1.0)
    assert ((furthest[3:] > 0.5) & (furthest[3:] <= 1.0 + 1e-12)).all()


@pytest.mark.parametrize("cells", [1, 2])
def test_answers_are_those_of_the_clamped_frame(cells: int) -> None:
    elastic = ElasticFrame(FRAMES["curved"])
    frame = elastic.frame
    pad = 1e-3 * frame.extent
    box = frame.bounds + np.array([[-pad], [pad]])
    basis = LatticeField.zeros(box, [even_cells(box, cells)]).dense_matrix(frame.vertices)
    answers = load_answers(elastic, cells)
    assert np.isfinite(answers).all()
    found = answers.reshape(-1, 6, answers.shape[1])
    np.testing.assert_allclose(np.sqrt(np.square(found[:, :3]).sum(axis=1).mean(axis=0)), 1.0)
    assert np.abs(found[frame.grounded]).max() < 1e-3
    matched = 0
    for column in basis.T[np.abs(basis).max(axis=0) > 0.05]:
        for axis in np.eye(3):
            wanted = clamped(elastic, lumped(frame, column[:, None] * axis)).ravel()
            along = wanted @ answers / (np.linalg.norm(wanted) * np.linalg.norm(answers, axis=0))
            best = int(np.argmax(along))
            scaled = wanted / np.sqrt(np.square(wanted.reshape(-1, 6)[:, :3]).sum(axis=1).mean())
            np.testing.assert_allclose(answers[:, best], scaled, atol=2e-3)
            matched += 1
    assert matched >= 3 * 8


def test_gravity_lies_in_the_span_of_the_answers() -> None:
    frame = FRAMES["straight"]
    elastic = ElasticFrame(frame)
    answers = load_answers(elastic, 1)
    down = np.tile([0.0, 0.0, -1.0], (frame.vertex_count, 1))
    assert remainder(clamped(elastic, lumped(frame, down)).ravel(), answers) < 1e-4
    # With the moments of the struts' own weight, which the answers leave out, the shifts are nearly the same.
    moved = np.arange(answers.shape[0]) % 6 < 3
    assert remainder(FrameBeams.build(frame).solve().ravel()[moved], answers[moved]) < 0.05


@pytest.mark.parametrize("cells", [1, 2])
def test_warps_hold_every_rigid_motion_and_even_stretch(cells: int) -> None:
    elastic = ElasticFrame(FRAMES["curved"])
    warps = smooth_warps(elastic, cells)
    for motion in rigid_motions(elastic.frame.vertices).T:
        assert remainder(motion, warps) < 1e-6
    stretch = np.zeros((elastic.vertex_count, 6))
    stretch[:, 2] = elastic.frame.vertices[:, 2]
    assert remainder(stretch.ravel(), warps) < 1e-6
    shift = warps.reshape(-1, 6, warps.shape[1])[:, :3]
    np.testing.assert_allclose(np.sqrt(np.square(shift).sum(axis=1).mean(axis=0)), 1.0)


def test_a_pose_is_drawn_where_it_is() -> None:
    elastic = ElasticFrame(FRAMES["curved"])
    plan = start_pose(elastic)
    drawn = as_rods(elastic, plan, 5)
    np.testing.assert_array_equal(drawn.control_points, elastic.frame.control_points)
    np.testing.assert_array_equal(drawn.joints, elastic.frame.vertices)
    np.testing.assert_array_equal(drawn.radius, np.repeat(elastic.frame.radius[:, None], 5, axis=1))
    assert drawn.opacity.shape == (len(elastic.edges), 5)
    assert (drawn.opacity == 1.0).all()
    rng = np.random.default_rng(0)
    pose = plan.moved(rng.normal(size=plan.joints.shape), rng.normal(size=plan.inner.shape))
    drawn = as_rods(elastic, pose, 2)
    np.testing.assert_allclose(drawn.joints[elastic.edges[:, 1]], drawn.control_points[:, 3], atol=1e-12)
    np.testing.assert_allclose(drawn.joints, elastic.frame.vertices + pose.joints[:, :3])
    four = Pose(plan.joints, plan.inner, plan.radius, np.tile([0.1, 0.2, 0.3, 0.4], (len(elastic.edges), 1)))
    np.testing.assert_array_equal(as_rods(elastic, four, 8).opacity[0], [0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.4])
    np.testing.assert_array_equal(as_rods(elastic, four, 2).opacity[0], [0.2, 0.4])


def random_terms(frame: Wireframe, seed: int) -> Terms:
    """Terms of no picture, positive semidefinite as all are, and weak in some directions."""
    rng = np.random.default_rng(seed)
    root, joint_root = rng.normal(size=(frame.strut_count, 12, 5)), rng.normal(size=(frame.vertex_count, 3, 2))
    return Terms(
        loss=1.0,
        hessian=root @ root.transpose(0, 2, 1),
        gradient=np.einsum("eij,ej->ei", root, rng.normal(size=(frame.strut_count, 5))),
        joint_hessian=joint_root @ joint_root.transpose(0, 2, 1),
        joint_gradient=np.einsum("vij,vj->vi", joint_root, rng.normal(size=(frame.vertex_count, 2))),
        widths=np.zeros((frame.strut_count, 1, 2)),
        joint_widths=np.zeros((frame.vertex_count, 2)),
    )


def motion_matrix(elastic: ElasticFrame) -> np.ndarray:
    """(E, 12, 6V + 6E) dense: control points by all freedoms."""
    count, joints = len(elastic.edges), 6 * elastic.vertex_count
    columns = []
    for unit in np.eye(joints + 6 * count):
        moved = elastic.displaced(np.zeros((count, 4, 3)), unit[:joints].reshape(-1, 6), unit[joints:].reshape(-1, 6))
        columns.append(moved.reshape(count, 12))
    return np.stack(columns, axis=2)


def dense_model(elastic: ElasticFrame, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
    """Hessian and gradient of the linearised loss by all freedoms, joints first."""
    follow = motion_matrix(elastic)
    matrix = np.einsum("eip,eij,ejq->pq", follow, terms.hessian, follow, optimize=True)
    gradient = np.einsum("eip,ei->p", follow, terms.gradient)
    for v in range(elastic.vertex_count):
        own = slice(6 * v, 6 * v + 3)
        matrix[own, own] += terms.joint_hessian[v]
        gradient[own] += terms.joint_gradient[v]
    return matrix, gradient


def dense_energy(elastic: ElasticFrame) -> np.ndarray:
    """Elastic energy's Hessian by all freedoms, feet on the ground held as the fit holds them."""
    joints = 6 * elastic.vertex_count
    matrix = np.zeros((joints + 6 * len(elastic.edges),) * 2)
    matrix[:joints, :joints] = elastic.assemble(elastic.stiffness + elastic.spin_stiffness).toarray()
    for v in np.flatnonzero(elastic.frame.grounded):
        matrix[range(6 * v, 6 * v + 3), range(6 * v, 6 * v + 3)] += GROUND / np.median(elastic.frame.radius) ** 2
    for k, block in enumerate(elastic.inner_stiffness):
        own = slice(joints + 6 * k, joints + 6 * k + 6)
        matrix[own, own] += block
    return matrix


def test_the_system_of_the_joints_is_that_of_the_struts_that_follow() -> None:
    elastic = ElasticFrame(FRAMES["curved"])
    terms = random_terms(elastic.frame, 1)
    matrix, gradient = joint_system(elastic, terms)
    joints = 6 * elastic.vertex_count
    wanted, slope = dense_model(elastic, terms)
    np.testing.assert_allclose(matrix.toarray(), wanted[:joints, :joints], atol=1e-8)
    np.testing.assert_allclose(gradient, slope[:joints], atol=1e-9)


def test_what_is_eliminated_follows_as_plain_matrices_have_it() -> None:
    rng, elastic = np.random.default_rng(8), ElasticFrame(FRAMES["curved"])
    struts, joints = len(elastic.edges), elastic.vertex_count
    root, zeros = rng.normal(size=(struts, 12, 9)), np.zeros((joints, 3, 3))
    gradient, bent, away = rng.normal(size=(struts, 12)), rng.normal(size=(struts, 6)), rng.normal(size=(joints, 6))
    terms = Terms(0.0, root @ root.transpose(0, 2, 1), gradient, zeros, zeros[..., 0], zeros, zeros)
    anchor = start_pose(elastic)
    found = without_inner(elastic, terms, (anchor.moved(away, bent), anchor), (0.2, 0.5))
    slope = np.zeros(6 * joints)
    for e in range(struts):
        follow, ends = elastic.follow[e], elastic.freedoms[e]
        mixed = terms.hessian[e][3:9] @ follow
        inner = terms.hessian[e][3:9, 3:9] + 0.7 * elastic.inner_stiffness[e]
        own = gradient[e, 3:9] + 0.2 * elastic.inner_stiffness[e] @ bent[e]
        np.testing.assert_allclose(found.inverse[e] @ inner, np.eye(6), atol=1e-9)
        np.testing.assert_allclose(found.follows[e], np.linalg.solve(inner, mixed), atol=1e-9)
        np.testing.assert_allclose(found.goes[e], np.linalg.solve(inner, own), atol=1e-9)
        stiffness = elastic.stiffness[e] + elastic.spin_stiffness[e]
        slope[ends] += follow.T @ gradient[e] + 0.2 * stiffness @ away.ravel()[ends]
        slope[ends] -= mixed.T @ np.linalg.solve(inner, own)
    held = GROUND * 0.7 * elastic.frame.grounded[:, None] / np.median(elastic.frame.radius) ** 2
    slope.reshape(-1, 6)[:, :3] += held * away[:, :3] * (0.2 / 0.7)
    np.testing.assert_allclose(found.slope, slope, rtol=1e-9, atol=1e-8 * np.abs(slope).max())


@pytest.mark.parametrize(("pull", "drag"), [(0.3, 0.0), (0.05, 0.4)])
@pytest.mark.parametrize("name", FRAMES)
def test_a_free_step_minimises_its_quadratic_model(name: str, pull: float, drag: float) -> None:
    elastic = ElasticFrame(FRAMES[name])
    terms = random_terms(elastic.frame, 2)
    rng = np.random.default_rng(3)
    plan = start_pose(elastic)
    shapes = (plan.joints.shape, plan.inner.shape)
    anchor = plan.moved(*(0.3 * rng.normal(size=shape) for shape in shapes))
    pose = anchor.moved(*(0.3 * rng.normal(size=shape) for shape in shapes))
    away = np.concatenate([(pose.joints - anchor.joints).ravel(), (pose.inner - anchor.inner).ravel()])
    matrix, slope = dense_model(elastic, terms)
    stiffness = dense_energy(elastic)
    wanted = np.linalg.solve(matrix + (pull + drag) * stiffness, -slope - pull * stiffness @ away)
    joints, inner = free_step(elastic, terms, pose, anchor, pull, drag)
    found = np.concatenate([joints.ravel(), inner.ravel()])
    # The sparse system is held by faint springs that the dense one does without.
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.abs(wanted).max())


def test_only_what_bends_or_stretches_costs_elastic_energy() -> None:
    """Next to none for shifts and turns of the whole (struts then spin a little); else as the square of its size."""
    elastic = ElasticFrame(tower(2))
    plan = start_pose(elastic)
    moves = rigid_motions(elastic.frame.vertices).T.reshape(6, -1, 6)
    bent = np.random.default_rng(2).normal(size=plan.joints.shape) * np.abs(moves).max()
    rigid = [plan.moved(move, np.zeros_like(plan.inner)) for move in moves]
    once, twice = (plan.moved(share * bent, share * np.ones_like(plan.inner)) for share in (1.0, 2.0))
    assert strain(elastic, plan, plan) == 0.0
    assert max(abs(strain(elastic, whole, plan)) for whole in rigid) < 1e-4 * strain(elastic, once, plan)
    assert strain(elastic, twice, plan) == pytest.approx(4.0 * strain(elastic, once, plan))


def test_without_pictures_a_frame_goes_back_to_its_anchor() -> None:
    elastic = ElasticFrame(FRAMES["straight"])
    rng = np.random.default_rng(4)
    anchor = start_pose(elastic)
    pose = anchor.moved(rng.normal(size=anchor.joints.shape), rng.normal(size=anchor.inner.shape))
    nothing = Terms(*(0.0 * np.asarray(x) for x in vars(random_terms(elastic.frame, 0)).values()))
    joints, inner = free_step(elastic, nothing, pose, anchor, 0.5, 0.0)
    np.testing.assert_allclose(joints, -pose.joints, atol=2e-3)
    np.testing.assert_allclose(inner, -pose.inner, atol=1e-9)
    still = free_step(elastic, nothing, anchor, anchor, 0.5, 0.2)
    assert not still[0].any()
    assert not still[1].any()


def seen(truth: Wireframe) -> Level:
    """Four views of a deformed tower, small and blurred."""
    cameras = ring_rig(FRAMES["straight"], 4, size=(192, 256), margin=0.15)
    masks = [picture / np.float32(255) for picture in silhouettes(truth, cameras, supersampling=2)]
    return Pyramid(cameras, masks).level(0.5, 1.0)


def sagging(elastic: ElasticFrame, scale: float) -> Pose:
    """Gravity and a sideways wind, as loads that the answers span."""
    frame = elastic.frame
    wind = np.tile([0.6, 0.3, -1.0], (frame.vertex_count, 1))
    joints = clamped(elastic, lumped(frame, wind))
    return start_pose(elastic).moved(joints * scale / np.abs(joints[:, :3]).max(), np.zeros((frame.strut_count, 6)))


@pytest.mark.parametrize("pull", [0.0, 1e-3])
def test_smooth_descent_lowers_the_loss_at_every_step_and_finds_the_sag(pull: float) -> None:
    elastic = ElasticFrame(FRAMES["straight"])
    truth = as_rods(elastic, sagging(elastic, 2.0), 1)
    level = seen(elastic.frame.replace(vertices=truth.joints, control_points=truth.control_points))
    stage = CoarseStage(detail=0.9, blur=1.0, iterations=12, pieces=2, pull=pull)
    stiffness = pull * elastic.assemble(elastic.stiffness)
    motions = np.concatenate([rigid_motions(elastic.frame.vertices), load_answers(elastic, 1)], axis=1)
    pose = start_pose(elastic)
    total = [squared_loss(as_rods(elastic, pose, 2), level)]
    for step, loss in smooth_descent(elastic, motions, pose, level, stage, 1.0):
        assert loss == pytest.approx(squared_loss(as_rods(elastic, step, 2), level), rel=1e-6)
        furthest = np.linalg.norm((step.joints - pose.joints)[:, :3], axis=1)
        assert np.percentile(furthest, 98) <= 1.0 + 1e-9
        assert not step.inner.any()
        pose = step
        total.append(loss + 0.5 * pose.joints.ravel() @ (stiffness @ pose.joints.ravel()))
    assert 3 <= len(total) - 1 <= 12
    assert np.all(np.diff(total) < 0.0)
    before = np.linalg.norm(truth.joints - elastic.frame.vertices, axis=1)
    after = np.linalg.norm(truth.joints - as_rods(elastic, pose, 1).joints, axis=1)
    assert before.max() > 2.0
    assert after.max() < 0.1 * before.max()


def test_smooth_descent_at_the_truth_goes_nowhere_far() -> None:
    elastic = ElasticFrame(FRAMES["straight"])
    level = seen(elastic.frame)
    motions = rigid_motions(elastic.frame.vertices)
    stage = CoarseStage(detail=0.9, blur=1.0, iterations=6, pieces=4)
    steps = list(smooth_descent(elastic, motions, start_pose(elastic), level, stage, 1.0))
    assert steps and max(np.abs(pose.joints[:, :3]).max() for pose, _ in steps) < 0.05
