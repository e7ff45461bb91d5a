"""Struts far from where they were planned: bowed by many radii, and in prints that sag by a fifth of their size."""

from __future__ import annotations

import numpy as np
import pytest

from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting.api import fit_views
from frametwin.fitting.misplaced import shapes_to_try
from frametwin.formats import find_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import Simulation, SimulationSettings, simulate
from frametwin.twin.twin import Twin

BOWED = 60
"""A strut in the middle of the half bowl."""


def made(name: str, peak: float, seed: int) -> Simulation:
    return simulate(find_frame(name), SimulationSettings(size=(600, 800), seed=seed, peak=peak))


def fitted(capture: Simulation, truth: Wireframe) -> Twin:
    masks = [mask / np.float32(255) for mask in silhouettes(truth, capture.cameras)]
    return fit_views(capture.frame, capture.cameras, masks).twin


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
