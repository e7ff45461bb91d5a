"""Struts far from where they were planned: bowed by many radii, and in prints that sag by a fifth of their size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowed_struts import bowed, with_pieces
from rod_cases import camera_at, level_of, lone_rod, shifted

from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting.api import fit_views
from frametwin.fitting.misplaced import shapes_to_try
from frametwin.fitting.presence import outline_misfit
from frametwin.formats import find_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rods
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import Simulation, SimulationSettings, simulate
from frametwin.twin.twin import Twin

BOWED = 60
"""A strut in the middle of the half bowl."""


def made(name: str, peak: float, seed: int) -> Simulation:
    return simulate(find_frame(name), SimulationSettings(size=(600, 800), seed=seed, peak=peak))


def fitted(capture: Simulation, truth: Wireframe, **changes: int) -> Twin:
    masks = [mask / np.float32(255) for mask in silhouettes(truth, capture.cameras)]
    return fit_views(capture.frame, capture.cameras, masks, changes=changes).twin


def test_shapes_to_try_have_the_same_ends_and_bow_to_all_sides() -> None:
    ends = np.array([[[0.0, 0.0, 0.0], [30.0, 0.0, 0.0]], [[1.0, 2.0, 3.0], [1.0, 2.0, 43.0]]])
    struts = bezier.straight(ends[:, 0], ends[:, 1])
    struts[:, 1] += [0.0, 3.0, 1.0]
    shapes = shapes_to_try(struts, np.array([1.5, 2.0]))
    np.testing.assert_array_equal(shapes[:, :, 0], np.repeat(ends[:, None, 0], shapes.shape[1], axis=1))
    np.testing.assert_array_equal(shapes[:, :, 3], np.repeat(ends[:, None, 1], shapes.shape[1], axis=1))
    for own, (start, end), radius in zip(shapes, ends, (1.5, 2.0), strict=True):
        bow = bezier.evaluate(own, np.array([0.5]))[:, 0] - 0.5 * (start + end)
        np.testing.assert_allclose(bow @ (end - start), 0.0, atol=1e-9)
        far = np.linalg.norm(bow, axis=1)
        assert far[0] == 0.0  # straight comes first
        assert far.max() > 9.0 * radius
        np.testing.assert_allclose(bow[1:].mean(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("radii", [5.0, 8.0])
def test_a_strut_that_bowed_alone_is_found(radii: float) -> None:
    capture = made("half_bowl", 9.0, seed=2)
    curves = np.array(capture.truth.control_points)
    chord = curves[BOWED, 3] - curves[BOWED, 0]
    aside = np.cross(chord, [0.2, -0.3, 1.0])
    curves[BOWED, 1:3] += 4.0 / 3.0 * radii * capture.truth.radius[BOWED] * aside / np.linalg.norm(aside)
    truth = capture.truth.replace(control_points=curves)
    twin = fitted(capture, truth)
    errors = evaluate(twin.control_points, twin.vertices, truth)
    assert twin.attached.all()
    assert twin.completeness[BOWED] > 0.95
    assert errors.strut_mean[BOWED] < 0.2
    assert errors.strut_mean.max() < 0.3


@pytest.mark.parametrize(("name", "peak", "seed"), [("half_bowl", 38.0, 12), ("bridge", 40.0, 9)])
def test_a_print_that_sags_by_a_fifth_of_its_size_has_no_torn_ends(name: str, peak: float, seed: int) -> None:
    capture = made(name, peak, seed)
    twin = fitted(capture, capture.truth)
    errors = evaluate(twin.control_points, twin.vertices, capture.truth)
    assert twin.attached.all()
    assert errors.curves.mean < 0.08
    assert errors.strut_mean.max() < 0.5


def test_struts_that_broke_off_are_not_bowed_to_other_places() -> None:
    settings = SimulationSettings(size=(600, 800), seed=4, missing=4, missing_share=1.0)
    capture = simulate(find_frame("half_bowl"), settings)
    masks = [image / np.float32(255.0) for image in capture.images]
    twin = fit_views(capture.frame, capture.cameras, masks).twin
    gone = np.flatnonzero(capture.present.mean(axis=1) == 0.0)
    assert len(gone) == 4
    assert twin.completeness[gone].max() < 0.2
    assert np.delete(twin.completeness, gone).min() > 0.8


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
def test_an_outline_that_is_beside_a_strut_is_told_in_radii(share: float) -> None:
    rod = lone_rod([-20.0, 0.0, 0.0], [20.0, 0.0, 0.0], 2.0, pieces=4)
    level = level_of([camera_at([0.0, -400.0, 0.0], (80, 300), 2000.0)], 0.7)
    beside = shifted(rod, np.array([0.0, 0.0, share * 2.0]))
    level = replace(level, target=np.float32(1.0) - rods.transmittance(beside, level))
    assert outline_misfit(rod, level)[0] == pytest.approx(share, rel=0.25)
    assert outline_misfit(beside, level)[0] == pytest.approx(0.0, abs=1e-6)


def test_a_strut_that_bowed_otherwise_than_a_cubic_can_says_how_far_it_is_off() -> None:
    """A clamped bow s^2 (1 - s)^2, of which a cubic with the same ends and tangents leaves a part."""
    capture = made("half_bowl", 9.0, seed=5)
    truth = capture.truth
    curve = truth.control_points[BOWED]
    aside = np.cross(curve[3] - curve[0], [0.2, -0.3, 1.0])
    bent = bowed(curve, 5.0 * truth.radius[BOWED] * aside / np.linalg.norm(aside))
    printed = with_pieces(truth, {BOWED: bent})
    twin = fitted(capture, printed, degree=3)
    found = bezier.evaluate(twin.control_points[BOWED], np.linspace(0.0, 1.0, 50))
    true = bezier.evaluate(bent, np.linspace(0.0, 1.0, 2000))
    error = np.linalg.norm(found[:, None] - true[None], axis=2).min(axis=1).mean()
    assert twin.attached.all()
    assert 0.05 < error < 2.0 * twin.sigma_across[BOWED]
    assert twin.sigma_across[BOWED] > 3.0 * np.median(twin.sigma_across)
