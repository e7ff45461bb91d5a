"""Errors of a twin: against closed forms, a brute-force reference, and real frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.evaluation.curve_distance import CurveSet, counts_by_length, points_at, ragged
from frametwin.evaluation.evaluate import Statistics, evaluate
from frametwin.files import dump_json
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.findings import Detection, longest_gap, missing_struts, uncertain_struts
from frametwin.twin.twin import Twin


def lines(*ends: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Wireframe:
    """Straight struts that share no joint."""
    vertices = np.array(ends, dtype=float).reshape(-1, 3)
    return Wireframe.create(vertices, np.arange(len(vertices)).reshape(-1, 2), radius=1.0)


def random_curves(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 1, 3)) * 20.0 + rng.normal(size=(count, 4, 3)) * 6.0


def brute_force(curves: np.ndarray, points: np.ndarray, interval: np.ndarray | None = None) -> np.ndarray:
    """Distances by 4,001 samples a curve, then by closing in around the best one."""
    best = np.full(len(points), np.inf)
    span = np.tile([0.0, 1.0], (len(curves), 1)) if interval is None else interval
    for curve, (low, high) in zip(curves, span, strict=True):
        if low == high:
            continue
        u = np.linspace(low, high, 4001)
        gap = np.linalg.norm(points[:, None] - bezier.evaluate(curve, u), axis=2)  # (N, 4001)
        u, step = u[gap.argmin(axis=1)], (high - low) / 4000
        for _ in range(12):  # ten times finer each round
            near = np.clip(u[:, None] + step * np.linspace(-1.0, 1.0, 21), low, high)
            gap = np.linalg.norm(points[:, None] - np.einsum("nkb,bx->nkx", bezier.bernstein(3, near), curve), axis=2)
            u, step = near[np.arange(len(points)), gap.argmin(axis=1)], step / 10.0
        best = np.minimum(best, gap.min(axis=1))
    return best


def to_segments(curves: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances to straight curves, in closed form."""
    a, along = curves[:, 0], curves[:, 3] - curves[:, 0]
    across = points[:, None] - a
    share = np.clip(np.sum(across * along, axis=2) / np.sum(along * along, axis=1), 0.0, 1.0)
    return np.linalg.norm(across - share[..., None] * along, axis=2).min(axis=1)


# --- distances to curves


def test_rows_of_different_lengths_are_laid_end_to_end() -> None:
    rows, place = ragged(np.array([2, 0, 3]))
    assert rows.tolist() == [0, 0, 2, 2, 2] and place.tolist() == [0, 1, 0, 1, 2]


@pytest.mark.parametrize("seed", range(3))
def test_distances_equal_a_brute_force_search(seed: int) -> None:
    curves = random_curves(12, seed)
    points = np.random.default_rng(seed + 10).normal(size=(150, 3)) * 25.0
    assert np.abs(CurveSet.build(curves).distances(points) - brute_force(curves, points)).max() < 1e-9
    interval = np.sort(np.random.default_rng(seed).uniform(size=(12, 2)), axis=1)
    interval[3] = 0.0
    found = CurveSet.build(curves, interval).distances(points)
    assert np.abs(found - brute_force(curves, points, interval)).max() < 1e-9


def test_points_on_the_curves_are_at_no_distance() -> None:
    curves = random_curves(40, 5)
    points = bezier.evaluate(curves, np.linspace(0.0, 1.0, 77)).reshape(-1, 3)
    assert CurveSet.build(curves).distances(points).max() < 1e-7


def test_distance_to_a_parabola() -> None:
    # y = x^2 over -2..2; from (0, h) the nearest point is the apex up to h = 1/2, then sqrt(h - 1/4) away
    parabola = bezier.elevate([[-2.0, 4.0, 0.0], [0.0, -4.0, 0.0], [2.0, 4.0, 0.0]], 3)
    heights = np.array([-1.0, 0.1, 0.3, 0.45, 0.6, 1.0, 2.0, 3.0])
    points = np.stack([np.zeros(8), heights, np.zeros(8)], axis=1)
    expected = np.where(heights < 0.5, np.abs(heights), np.sqrt(np.maximum(heights - 0.25, 0.0)))
    assert np.allclose(CurveSet.build(parabola[None]).distances(points), expected, atol=1e-9)


def test_very_different_lengths_do_not_hide_the_nearest_curve() -> None:
    curves = bezier.straight(
        [[0.0, 0.0, 0.0], *[[x, 1.0, 0.0] for x in range(50)]],
        [[1000.0, 0.0, 0.0], *[[x, 1.1, 0.0] for x in range(50)]],
    )
    points = np.random.default_rng(0).uniform([-5.0, -3.0, -3.0], [1005.0, 3.0, 3.0], (500, 3))
    assert np.abs(CurveSet.build(curves).distances(points) - to_segments(curves, points)).max() < 1e-9


def test_a_set_without_curves_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        CurveSet.build(random_curves(2, 0), np.zeros((2, 2)))


def test_real_frame_against_dense_samples(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    rng = np.random.default_rng(0)
    curves = frame.control_points + rng.normal(size=frame.control_points.shape)
    counts = counts_by_length(curves, 100)
    strut, k = ragged(counts + 1)
    samples = points_at(curves, strut, k / counts[strut])
    points = rng.uniform(*frame.bounds, (300, 3))
    nearest = np.array([np.linalg.norm(samples - point, axis=1).min() for point in points])
    spacing = float(np.linalg.norm(np.diff(samples, axis=0), axis=1)[np.diff(strut) == 0].max())
    found = CurveSet.build(curves).distances(points)
    # A sample lies within half a spacing of the nearest point, at right angles to the way there.
    assert (found <= nearest + 1e-12).all()
    assert (nearest <= np.hypot(found, spacing) + 1e-3).all()


# --- errors


def test_no_error_of_the_truth_itself() -> None:
    frame = named_frame("half_bowl")
    errors = evaluate(frame.control_points, frame.vertices, frame)
    for statistics in (errors.curves, errors.joints, errors.equal_parameter):
        assert max(statistics.mean, statistics.p95, statistics.max) < 1e-7
    assert np.nanmax(errors.strut_max) < 1e-7 and not np.isnan(errors.joint).any()


def test_parallel_lines_are_as_far_apart_as_they_were_shifted() -> None:
    frame = lines(((0, 0, 0), (10, 0, 0)), ((0, 500, 0), (30, 500, 0)))
    shift = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])  # across the struts
    errors = evaluate(frame.control_points + shift[:, None], frame.vertices + np.repeat(shift, 2, axis=0), frame)
    assert np.allclose(errors.strut_mean, [1.0, 2.0]) and np.allclose(errors.strut_max, [1.0, 2.0])
    assert np.allclose(errors.strut_equal_mean, [1.0, 2.0]) and np.allclose(errors.joint, [1, 1, 2, 2])
    # The mean goes by length, 10 mm and 30 mm; joints count alike.
    assert errors.curves.mean == pytest.approx(1.75) and errors.curves.max == pytest.approx(2.0)
    assert errors.equal_parameter.mean == pytest.approx(1.75)
    assert errors.joints.mean == pytest.approx(1.5)


def test_swapped_curves_are_the_same_set_but_not_the_same_struts() -> None:
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 7, 0), (20, 7, 0)))
    errors = evaluate(frame.control_points[[1, 0]], frame.vertices[[2, 3, 0, 1]], frame)
    assert errors.curves.max < 1e-9
    for statistics in (errors.joints, errors.equal_parameter):
        assert [statistics.mean, statistics.p95, statistics.max] == pytest.approx([7.0, 7.0, 7.0])


def test_sliding_along_a_line_is_an_error_at_equal_parameter_only() -> None:
    frame = lines(((0, 0, 0), (30, 0, 0)))
    curves = frame.control_points.copy()
    curves[0, 1:3, 0] += 4.0  # the point at u moves by 4 * 3 u (1 - u), which is 2 on average and 3 at most
    errors = evaluate(curves, frame.vertices, frame)
    assert errors.curves.max < 1e-9 and errors.joints.max == 0.0
    assert errors.equal_parameter.mean == pytest.approx(2.0, rel=1e-3)
    assert errors.equal_parameter.max == pytest.approx(3.0, rel=1e-9)


def test_both_ways_count() -> None:
    # Both struts of the twin lie on the first: nothing lies where the second should be.
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 8, 0), (20, 8, 0)))
    errors = evaluate(frame.control_points[[0, 0]], frame.vertices[[0, 1, 0, 1]], frame)
    assert errors.curves.mean == pytest.approx(2.0)  # 8 for half of the truth, 0 for the twin
    assert errors.curves.max == pytest.approx(8.0)
    assert errors.strut_mean == pytest.approx([0.0, 4.0])


def test_an_arc_against_its_chord() -> None:
    # y = 4 s (1 - u) u over a chord of 40 mm, sagitta 3 mm: from the chord up, 3 at most and 2 on average
    frame = lines(((0, 0, 0), (40, 0, 0)))
    curves = frame.control_points.copy()
    curves[0, 1:3, 1] = 4.0
    errors = evaluate(curves, frame.vertices, frame)
    assert errors.curves.max == pytest.approx(3.0, rel=1e-6)
    assert errors.equal_parameter.mean == pytest.approx(2.0, rel=1e-3)
    assert errors.equal_parameter.max == pytest.approx(3.0, rel=1e-9)
    assert errors.curves.p95 < errors.curves.max


def test_what_is_not_printed_does_not_count() -> None:
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 8, 0), (20, 8, 0))).replace(printed=[True, False])
    curves = frame.control_points + np.array([0.0, 50.0])[:, None, None]
    errors = evaluate(curves, curves[:, [0, 3]].reshape(-1, 3), frame)
    assert errors.curves.max < 1e-12 and errors.joints.max == 0.0
    assert np.isnan([errors.strut_mean[1], errors.strut_equal_max[1], *errors.joint[2:]]).all()


def test_missing_struts_count_only_where_they_exist() -> None:
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 8, 0), (20, 8, 0)), ((0, 30, 0), (20, 30, 0)))
    present = np.array([[0.0, 1.0], [0.0, 0.5], [0.0, 0.0]])
    curves, vertices = frame.control_points.copy(), frame.vertices.copy()
    vertices[3] = [60.0, 8.0, 0.0]  # the strut's missing end is far off, but along the strut
    curves[1] = bezier.straight(vertices[2], vertices[3])
    vertices[4:], curves[2] = 99.0, 99.0 + curves[2]  # a strut that is missing entirely
    errors = evaluate(curves, vertices, frame, present)
    assert errors.curves.max < 1e-9 and errors.joints.max == 0.0
    assert np.isnan(errors.strut_max).tolist() == [False, False, True]
    assert np.isnan(errors.joint).tolist() == [False, False, False, True, True, True]
    # At equal parameter the twin is 40 u ahead, up to u = 1/2.
    assert errors.strut_equal_max[1] == pytest.approx(20.0)
    assert errors.strut_equal_mean[1] == pytest.approx(10.0)


def test_the_existing_half_of_a_strut_still_counts() -> None:
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 90, 0), (20, 90, 0)))
    curves = frame.control_points + np.array([0.0, 3.0])[:, None, None] * np.array([0.0, 0.0, 1.0])
    present = np.array([[0.0, 1.0], [0.5, 1.0]])
    errors = evaluate(curves, curves[:, [0, 3]].reshape(-1, 3), frame, present)
    assert errors.strut_mean[1] == pytest.approx(3.0, rel=1e-2) and errors.strut_max[1] >= 3.0
    assert errors.curves.mean == pytest.approx(1.0, rel=2e-2)  # 20 mm at 0 and 10 mm at 3
    assert np.isnan(errors.joint).tolist() == [False, False, True, False]


def test_a_shifted_real_frame(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    shift = np.array([0.3, -0.2, 0.1])
    size = float(np.linalg.norm(shift))
    errors = evaluate(frame.control_points + shift, frame.vertices + shift, frame)
    assert errors.joints.mean == pytest.approx(size) and errors.equal_parameter.max == pytest.approx(size)
    assert errors.curves.mean < size and errors.curves.max <= size + 1e-9  # struts along the shift hide it


def test_the_order_of_directions_does_not_matter() -> None:
    frame = named_frame("bridge")
    rng = np.random.default_rng(2)
    vertices = frame.vertices + rng.normal(size=frame.vertices.shape)
    other = Wireframe.create(vertices, frame.edges, radius=1.0)
    there = evaluate(other.control_points, other.vertices, frame)
    back = evaluate(frame.control_points, frame.vertices, other)
    assert there.joints == back.joints
    assert there.curves.mean == pytest.approx(back.curves.mean, rel=1e-9)
    assert there.curves.max == pytest.approx(back.curves.max, rel=1e-9)


def test_statistics() -> None:
    values = np.arange(1.0, 101.0)
    statistics = Statistics.of(np.random.default_rng(0).permutation(values))
    assert (statistics.mean, statistics.p95, statistics.max) == (50.5, 95.0, 100.0)
    weighted = Statistics.of(np.array([5.0, 1.0]), np.array([1.0, 9.0]))
    assert weighted.mean == pytest.approx(1.4) and (weighted.p95, weighted.max) == (5.0, 5.0)


def test_results_can_be_written_as_json() -> None:
    frame = lines(((0, 0, 0), (20, 0, 0)), ((0, 8, 0), (20, 8, 0))).replace(printed=[True, False])
    data = evaluate(frame.control_points, frame.vertices, frame).as_dict()
    assert data["struts"]["equal_parameter_max"] == [0.0, None] and data["unit"] == "mm"
    dump_json(data)


def test_arrays_that_do_not_fit_are_refused() -> None:
    frame = named_frame("bridge")
    with pytest.raises(InputError, match="control_points"):
        evaluate(frame.control_points[1:], frame.vertices, frame)
    with pytest.raises(InputError, match="vertices"):
        evaluate(frame.control_points, frame.vertices[1:], frame)
    with pytest.raises(InputError, match="no strut of the truth exists"):
        evaluate(frame.control_points, frame.vertices, frame, np.zeros((76, 2)))
    with pytest.raises(InputError, match="joint"):
        evaluate(frame.control_points, frame.vertices, frame, np.tile([0.2, 0.8], (76, 1)))


# --- what a twin says about single struts


def twin_with(opacity: np.ndarray, confidence: np.ndarray) -> Twin:
    count = len(opacity)
    curves = bezier.straight(np.zeros((count, 3)), np.ones((count, 3)))
    return Twin(curves, np.zeros((2, 3)), np.ones(opacity.shape), opacity, opacity.mean(axis=1), confidence)


def test_gaps_make_struts_suspect() -> None:
    opacity = np.ones((6, 20))
    opacity[1, 10:] = 0.0  # half missing
    opacity[2, ::3] = 0.0  # dark in places, which is what hidden struts look like
    opacity[3, :3] = 0.2  # a short end
    opacity[4] = 0.0  # missing entirely
    opacity[5] = 0.0  # never printed
    assert longest_gap(opacity) == pytest.approx([0.0, 0.5, 0.05, 0.15, 1.0, 1.0])
    twin = twin_with(opacity, np.array([0.9, 0.1, 0.1, 0.9, 0.1, 0.1]))
    printed = np.array([True] * 5 + [False])
    assert missing_struts(twin, printed).tolist() == [1, 3, 4]
    assert uncertain_struts(twin, printed).tolist() == [2]


def test_detection_tells_found_overlooked_and_false() -> None:
    present = np.array([[0.0, 1.0], [0.0, 0.5], [0.5, 1.0], [0.0, 0.0], [0.0, 0.0]])
    printed = np.array([True, True, True, True, False])
    found = Detection.of(np.array([0, 1, 3]), present, printed)
    assert found.as_dict() == {"found": [1, 3], "overlooked": [2], "false": [0]}
