"""Stages of the fast fit one by one: what they leave alone, what they change, and which pictures they look at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.errors import Cancelled
from frametwin.fitting.fast_settings import CoarseStage, FastSettings, Stage
from frametwin.fitting.fast_stages import astray, free_stage, not_bowed_far, recover, smooth_stages
from frametwin.fitting.fast_state import Problem, Record, State, drawn, terms_of
from frametwin.fitting.levels import Levels
from frametwin.fitting.loads import rigid_motions
from frametwin.fitting.part_fit import PartFit
from frametwin.fitting.presets import PRESETS, fitter_of
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.deformations import rigid_motion
from frametwin.progress import Progress, ProgressCallback
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.rods import squared_loss
from frametwin.raster.silhouette import silhouettes

PLAN = tower()
CAMERAS = ring_rig(PLAN, 5, size=(240, 320))
STAGE = Stage(detail=3.0, blur=0.7, iterations=4, pieces=6, pull=0.04, drag=0.12)


def masks_of(frame: Wireframe, present: np.ndarray | None = None) -> list[np.ndarray]:
    return [p / np.float32(255) for p in silhouettes(frame, CAMERAS, present=present, supersampling=2)]


def problem_of(
    masks: list[np.ndarray], callback: ProgressCallback | None = None, settings: FastSettings | None = None
) -> tuple[Problem, State]:
    settings = FastSettings(refine=(STAGE,)) if settings is None else settings
    problem = Problem.of(PLAN, CAMERAS, masks, settings, callback)
    return problem, State.planned(problem, Record())


def shifted(by: tuple[float, float, float]) -> Wireframe:
    return rigid_motion(PLAN, (0.0, 0.0, 0.0), by)


def test_a_stage_gives_a_new_state_and_leaves_the_old_one_alone() -> None:
    problem, state = problem_of(masks_of(shifted((0.4, 0.0, 0.0))))
    before = [np.array(values) for values in vars(state.pose).values()]
    after = free_stage(problem, state, STAGE)
    for values, kept in zip(vars(state.pose).values(), before, strict=True):
        assert np.array_equal(values, kept)
    assert state.record.loss == () and state.terms is None
    assert len(after.record.loss) == STAGE.iterations and after.record.loss[-1] < after.record.loss[0]
    assert after.anchor is state.anchor
    assert np.linalg.norm(after.pose.joints[:, :3] - [0.4, 0.0, 0.0], axis=1).mean() < 0.15
    with pytest.raises(ValueError, match="no stage"):
        _ = state.last_terms


def test_the_loss_of_a_step_is_the_mean_over_the_pixels_that_it_looked_at() -> None:
    problem, state = problem_of(masks_of(shifted((0.4, 0.0, 0.0))))
    after = free_stage(problem, state, replace(STAGE, iterations=1))
    level, rods = problem.level(STAGE), drawn(problem, state, STAGE.pieces)
    assert after.record.loss == (2.0 * squared_loss(rods, level) / level.target.size,)
    assert terms_of(problem, state, STAGE).loss == after.last_terms.loss


def test_a_step_bows_no_strut_further_than_it_may_and_moves_joints_all_the_same() -> None:
    problem, state = problem_of(masks_of(shifted((0.4, 0.0, 0.0))))
    rng = np.random.default_rng(3)
    joints = rng.normal(size=state.pose.joints.shape) * 0.1
    inner = rng.normal(size=state.pose.inner.shape) * rng.uniform(0.0, 1.0, (PLAN.strut_count, 1))
    plan, longest = PLAN.control_points, 0.5
    capped = not_bowed_far(problem, joints, inner, longest)

    def step(own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Control points' steps, and how far the curve's points step across the strut relative to its ends, at most."""
        moved = problem.elastic.displaced(plan, joints, own) - plan
        u = np.linspace(0.0, 1.0, 9)
        chord = PLAN.vertices[PLAN.edges[:, 1]] - PLAN.vertices[PLAN.edges[:, 0]]
        along = chord / np.linalg.norm(chord, axis=1)[:, None]
        between = moved[:, :1] * (1.0 - u)[:, None] + moved[:, 3:] * u[:, None]
        bow = bezier.evaluate(moved, u) - between
        across = bow - np.einsum("esj,ej->es", bow, along)[..., None] * along[:, None]
        return moved, np.linalg.norm(across, axis=2).max(axis=1)

    (before, far), (after, left) = step(inner), step(capped)
    assert (far > longest).any() and (far < longest).any()
    np.testing.assert_allclose(left, np.minimum(far, longest), rtol=1e-9)
    np.testing.assert_array_equal(after[:, [0, 3]], before[:, [0, 3]])
    np.testing.assert_array_equal(not_bowed_far(problem, joints, inner, 1e6), inner)


def test_smooth_stages_stay_within_their_motions() -> None:
    coarse = tuple(
        CoarseStage(detail=detail, blur=blur, iterations=6, pieces=4) for detail, blur in ((1.0, 1.0), (2.0, 0.7))
    )
    problem, state = problem_of(masks_of(shifted((0.8, -0.5, 0.0))), settings=FastSettings(coarse=coarse))
    motions = rigid_motions(PLAN.vertices)
    after = smooth_stages(problem, state, motions, pull=1.0)
    joints = after.pose.joints.ravel()
    share = np.linalg.lstsq(motions, joints, rcond=None)[0]
    np.testing.assert_allclose(motions @ share, joints, atol=1e-9)
    np.testing.assert_allclose(after.pose.joints[:, :2].mean(axis=0), [0.8, -0.5], atol=0.1)


def test_what_is_not_in_the_pictures_is_taken_as_missing() -> None:
    present = np.tile([0.0, 1.0], (PLAN.strut_count, 1))
    present[7] = 0.0
    problem, state = problem_of(masks_of(PLAN, present))
    assert np.flatnonzero(astray(problem, state, STAGE)).tolist() == [7]
    after = recover(problem, state)
    assert not after.pose.opacity[7].any()
    assert after.pose.opacity[np.arange(PLAN.strut_count) != 7].all()


def test_every_step_is_told_and_can_be_the_last() -> None:
    seen: list[Progress] = []

    def watch(progress: Progress) -> bool:
        seen.append(progress)
        return len(seen) < 3

    problem, state = problem_of(masks_of(PLAN), watch)
    with pytest.raises(Cancelled):
        free_stage(problem, state, STAGE)
    assert [progress.iteration for progress in seen] == [1, 2, 3]
    assert {progress.total for progress in seen} == {problem.steps}


def test_pictures_have_the_size_that_the_typical_strut_asks_for() -> None:
    levels = Levels(PLAN, Pyramid(CAMERAS, masks_of(PLAN)))
    middle = PLAN.bounds.mean(axis=0)
    for detail in (0.5, 1.0, 2.0):
        level = levels.at(detail, 0.7)
        assert levels.pixels_per_mm(detail) * np.median(PLAN.radius) == pytest.approx(detail)
        for camera, shape in zip(CAMERAS, level.shapes, strict=True):
            small = camera.resized(int(shape[1]), int(shape[0]))
            across = camera.camera_to_world[:3, 0]  # a millimetre across the line of sight
            ends, _ = small.project(np.array([middle, middle + across]))
            assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(levels.pixels_per_mm(detail), rel=0.05)
    whole = levels.at(1e6, 0.0)
    assert whole.shapes.tolist() == [[240, 320]] * 5  # never enlarged
    small = levels.at(0.5, 0.7)
    assert levels.at(0.5, 0.7) is small and levels.at(0.5, 1.0) is not small


def test_two_large_levels_are_kept_and_no_more_than_memory_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    levels = Levels(PLAN, Pyramid(CAMERAS, masks_of(PLAN)))
    whole, softer, small = levels.at(1e6, 0.3), levels.at(1e6, 0.4), levels.at(0.5, 0.7)
    assert levels.at(1e6, 0.3) is whole and levels.at(1e6, 0.4) is softer
    monkeypatch.setattr("frametwin.fitting.levels.KEPT", 2 * whole.target.size)
    assert levels.at(1e6, 0.5).target.size == whole.target.size
    assert levels.at(0.5, 0.7) is small and levels.at(1e6, 0.3) is not whole


@pytest.mark.parametrize("preset", PRESETS)
def test_every_way_of_fitting_gives_the_same_kind_of_result(preset: str) -> None:
    real = shifted((0.3, 0.2, 0.0))
    quick = {} if preset == "fast" else {"iterations": 3, "samples": 4, "bending_samples": 64, "image_scale": 0.5}
    part = fitter_of(preset, 0, {**quick, "kernels_per_strut": 5}).fit(PLAN, CAMERAS, masks_of(real))
    assert isinstance(part, PartFit)
    struts = PLAN.strut_count
    assert part.control_points.shape == (struts, 4, 3) and part.vertices.shape == (PLAN.vertex_count, 3)
    assert part.thickness.shape == part.opacity.shape == (struts, 5) and part.confidence.shape == (struts,)
    apart = np.linalg.norm(part.control_points[:, [0, 3]] - part.vertices[PLAN.edges], axis=2)
    gap = np.zeros((struts, 2)) if part.gap is None else part.gap
    assert bool((gap > 0.0).any()) == (preset in ("curve-driven", "deformation-driven"))  # whose ends are their own
    np.testing.assert_allclose(apart, gap, atol=1e-6)
    assert all(loss > 0.0 for loss in part.loss) and len(part.loss) >= 3
    way, field = part.vertices - PLAN.vertices, part.field.evaluate(np.array(PLAN.vertices))
    assert np.linalg.norm(field - way, axis=1).mean() < 0.75 * np.linalg.norm(way, axis=1).mean()


def test_nearer_views_alone_ask_for_no_more_than_is_kept_of_the_pictures() -> None:
    """They cover more pixels than all views do on average, and pictures that were reduced stay so."""
    first = CAMERAS[0]
    away = np.array(first.camera_to_world)
    away[:3, 3] += 2.0 * (first.centre - PLAN.bounds.mean(axis=0))
    cameras = [first, replace(first, camera_to_world=away)]
    masks = [masks_of(PLAN)[0]] * 2
    asked = Levels(PLAN, Pyramid(cameras, []))
    detail = 0.5 * asked.density * asked.radius  # half of the size of all
    levels = Levels(PLAN, Pyramid(cameras, masks, largest=asked.scale(detail)))
    assert levels.scale(detail) == levels.scale(10.0 * detail) == 0.5
    near = levels.of_views(np.array([0])).at(10.0 * detail, 0.0)
    assert near.target.size == levels.at(detail, 0.0).target.size // 2
    assert np.array_equal(near.target, levels.at(detail, 0.0).target[: near.target.size])
