"""Struts that are bent as no cubic can be: found by the fit, kept by the twin and its files, judged by their curves."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bowed_struts import bowed, with_pieces

from frametwin.errors import InputError
from frametwin.evaluation.evaluate import evaluate
from frametwin.fields.base import enlarged_box
from frametwin.fields.lattice import LatticeField
from frametwin.fitting.api import fit_views
from frametwin.fitting.halves import Halves, halved_frame, joined_curve
from frametwin.fitting.known_start import KnownStart
from frametwin.formats import find_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.last_twin import start_after
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import SimulationSettings, simulate
from frametwin.twin.findings import missing_struts
from frametwin.twin.handing_over import handed_over, taken_over
from frametwin.twin.twin import Twin, read_twin, write_twin

BOW = 5.0
"""Radii by which struts bow at their middle."""

BOWED = 79
"""A long strut of the half bowl."""


def fitted(seed: int, missing: tuple[int, ...] = ()) -> tuple[Wireframe, dict[int, np.ndarray], Twin]:
    """Truth, the curves of three bent struts of it, and its twin from pictures without those that are missing."""
    made = simulate(find_frame("half_bowl"), SimulationSettings(seed=seed))
    rng = np.random.default_rng(seed)
    long = np.flatnonzero(made.truth.chord_lengths > 8.0 * made.truth.radius)
    quartics = {}
    for strut in rng.choice(long, 3, replace=False).tolist():
        curve = made.truth.control_points[strut]
        chord, across = curve[3] - curve[0], rng.normal(size=3)
        across -= across @ chord / (chord @ chord) * chord
        by = BOW * made.truth.radius[strut] * across / np.linalg.norm(across)
        quartics[strut] = bowed(curve, by)
    seen = with_pieces(made.truth, quartics)
    whole = np.setdiff1d(np.arange(made.truth.strut_count), list(quartics))  # the first struts of what is seen
    there = np.ones(seen.strut_count, dtype=bool)
    there[np.searchsorted(whole, missing)] = False
    seen = seen.replace(printed=there)
    masks = [mask / np.float32(255) for mask in silhouettes(seen, made.cameras)]
    return made.truth, quartics, fit_views(made.frame, made.cameras, masks).twin


@pytest.fixture(scope="module")
def bent_print() -> tuple[Wireframe, dict[int, np.ndarray], Twin]:
    """As of `fitted`."""
    return fitted(2)


def off(curve: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distances of points of a curve to the nearest of many of another."""
    points, near = bezier.evaluate(curve, np.linspace(0.0, 1.0, 40)), bezier.evaluate(true, np.linspace(0.0, 1.0, 800))
    return np.linalg.norm(points[:, None] - near, axis=2).min(axis=1)


def test_bent_struts_get_the_curve_that_they_have(bent_print):
    truth, quartics, twin = bent_print
    assert set(quartics) <= set(twin.bent)
    assert len(twin.bent) <= len(quartics) + 1
    for strut, true in quartics.items():
        radius = truth.radius[strut]
        found, cubic = off(twin.bent[strut], true), off(twin.control_points[strut], true)
        assert found.mean() < 0.1 * radius
        assert found.max() < 0.3 * radius
        assert cubic.max() > 2.0 * found.max()  # as the bow that is clamped leaves a sixth of itself to any cubic
        assert found.mean() < 2.0 * twin.sigma_across[strut] < cubic.max()  # which is that of the curve


@pytest.mark.parametrize(
    ("seed", "missing"),
    [
        pytest.param(32, (), id="two that cross were taken for each other beyond their crossing"),
        pytest.param(21, (41, 59, 98), id="a straight one had left its place to a bent one, which seemed broken"),
    ],
)
def test_struts_that_were_drawn_in_the_place_of_others_are_found(seed, missing):
    truth, quartics, twin = fitted(seed, missing)
    assert set(quartics) <= set(twin.bent)
    for strut, true in quartics.items():
        found = off(twin.bent[strut], true)
        assert found.mean() < 0.1 * truth.radius[strut]
        assert found.mean() < 2.0 * twin.sigma_across[strut]
    others = np.setdiff1d(np.arange(truth.strut_count), [*quartics, *missing])
    errors = evaluate(twin.curves, twin.vertices, truth)
    assert errors.strut_mean[others].max() < 0.1 * truth.radius.max()
    assert missing_struts(twin, truth.printed).tolist() == list(missing)
    assert not set(missing) & set(twin.bent)


def test_nothing_else_is_disturbed_by_bent_struts(bent_print):
    truth, quartics, twin = bent_print
    assert twin.attached.all()
    assert (twin.completeness > 0.97).all()
    whole = np.setdiff1d(np.arange(truth.strut_count), list(quartics))
    errors = evaluate(twin.curves, twin.vertices, truth)
    assert errors.strut_mean[whole].max() < 0.3 * truth.radius.max()
    assert errors.joints.max < 0.3 * truth.radius.max()
    assert twin.control_points.shape == truth.control_points.shape
    assert len(twin.vertices) == truth.vertex_count


def test_struts_that_are_known_not_to_be_bent_are_not_asked_again():
    made = simulate(find_frame("half_bowl"), SimulationSettings(seed=2))
    truth = made.truth
    curve = truth.control_points[BOWED]
    across = np.cross(curve[3] - curve[0], [0.0, 0.0, 1.0])
    quartics = {BOWED: bowed(curve, BOW * truth.radius[BOWED] * across / np.linalg.norm(across))}
    masks = [mask / np.float32(255) for mask in silhouettes(with_pieces(truth, quartics), made.cameras)]
    still = LatticeField.zeros(enlarged_box(truth.bounds), [(1, 1, 1)])
    every = np.arange(truth.strut_count)
    for known, told in ((every, set()), (np.delete(every, BOWED), {BOWED})):
        twin = fit_views(truth, made.cameras, masks, start=KnownStart(still, cubic=known)).twin
        assert set(twin.bent) == told


def test_the_next_batch_knows_of_struts_that_were_whole_and_not_bent(bent_print):
    truth, _, twin = bent_print
    printed = np.ones(truth.strut_count, dtype=bool)
    printed[:5] = False
    broken = np.setdiff1d(np.arange(7, 12), list(twin.bent))[0]
    seen = twin.replace(completeness=np.where(np.arange(truth.strut_count) == broken, 0.5, 1.0))
    still = LatticeField.zeros(enlarged_box(truth.bounds), [(1, 1, 1)])
    known = start_after(seen, still, truth.replace(printed=printed), ()).cubic
    expected = np.setdiff1d(np.arange(5, truth.strut_count), [broken, *twin.bent])
    np.testing.assert_array_equal(np.flatnonzero(printed)[known], expected)


def test_curves_of_a_twin_are_the_cubics_but_for_bent_struts(bent_print):
    truth, quartics, twin = bent_print
    u = np.linspace(0.0, 1.0, 9)
    whole = np.setdiff1d(np.arange(truth.strut_count), list(twin.bent))
    curves, cubics = bezier.evaluate(twin.curves, u), bezier.evaluate(twin.control_points, u)
    assert twin.curves.shape == (truth.strut_count, 6, 3)
    np.testing.assert_allclose(curves[whole], cubics[whole], atol=1e-9)
    for strut in quartics:
        np.testing.assert_allclose(curves[strut], bezier.evaluate(twin.bent[strut], u), atol=1e-9)
        assert np.abs(curves[strut] - cubics[strut]).max() > 0.3 * truth.radius[strut]


def test_bent_struts_are_in_the_file_and_cross_to_another_process(bent_print, tmp_path):
    truth, _, twin = bent_print
    write_twin(tmp_path, twin)
    plan = truth.replace(vertices=twin.vertices, control_points=twin.control_points)
    for again in (read_twin(tmp_path), taken_over(handed_over(twin, plan))[0]):
        assert again.bent.keys() == twin.bent.keys()
        for strut, curve in twin.bent.items():
            np.testing.assert_array_equal(again.bent[strut], curve)


@pytest.mark.parametrize(
    ("bent", "told"),
    [
        ({"3": []}, "list of struts"),
        ([{"strut": 3}], "list of struts"),
        ([{"strut": 1e9, "control_points": [[0, 0, 0]] * 6}], "strut"),
        ([{"strut": 10**9, "control_points": [[0, 0, 0]] * 6}], "1000000000"),
        ([{"strut": 3, "control_points": [[0, 0, 0]] * 4}], "4 points"),
        ([{"strut": 3, "control_points": [[0, 0]] * 6}], "bent of strut 3"),
        ([{"strut": 3, "control_points": [[0, 0, 0]] * 6}] * 2, "twice"),
    ],
)
def test_damaged_curves_of_bent_struts_are_refused_by_name(bent_print, tmp_path, bent, told):
    _, _, twin = bent_print
    path = write_twin(tmp_path, twin)
    path.write_text(json.dumps({**json.loads(path.read_text()), "bent": bent}))
    with pytest.raises(InputError, match=told):
        read_twin(path)


def test_two_halves_of_a_curve_are_joined_to_it():
    rng = np.random.default_rng(0)
    curves = rng.normal(size=(5, 4, 3)) + 4.0 * np.arange(4)[:, None]
    u = np.linspace(0.0, 1.0, 200)
    for degree in (3, 5):
        joined = joined_curve(*bezier.split(curves, 0.5), degree)
        for one, other in zip(joined, curves, strict=True):
            assert off(one, other).max() < 0.05
            np.testing.assert_allclose(bezier.evaluate(one, [0.0, 1.0]), bezier.evaluate(other, [0.0, 1.0]), atol=1e-9)
    straight = bezier.straight(curves[:, 0], curves[:, 3])
    joined = joined_curve(*bezier.split(straight, 0.5), 5)
    np.testing.assert_allclose(bezier.evaluate(joined, u), bezier.evaluate(straight, u), atol=1e-9)


def test_a_frame_with_halves_has_the_same_curves():
    frame = find_frame("half_bowl")
    halves = Halves(np.array([4, 90]), frame.strut_count, frame.vertex_count)
    cut = halved_frame(frame, halves)
    assert (cut.strut_count, cut.vertex_count) == (frame.strut_count + 2, frame.vertex_count + 2)
    for i, strut in enumerate(halves.struts):
        middle = bezier.evaluate(frame.control_points[strut], [0.5])[0]
        np.testing.assert_allclose(cut.vertices[frame.vertex_count + i], middle, atol=1e-9)
        assert cut.edges[strut, 0] == frame.edges[strut, 0]
        assert cut.edges[frame.strut_count + i, 1] == frame.edges[strut, 1]
        assert cut.lengths[[strut, frame.strut_count + i]].sum() == pytest.approx(frame.lengths[strut])


def test_an_exact_print_has_no_bent_strut():
    made = simulate(find_frame("bridge"), SimulationSettings(size=(480, 640), seed=0))
    masks = [mask / np.float32(255) for mask in silhouettes(made.truth, made.cameras)]
    assert not fit_views(made.frame, made.cameras, masks).twin.bent
