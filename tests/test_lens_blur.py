"""Blur of lenses: it is told by how soft the edges of masks are, and rods are drawn as soft."""

from __future__ import annotations

from math import erf, hypot, sqrt

import cv2
import numpy as np
import pytest
from rod_cases import of_frame
from small_frames import tower

from frametwin.cameras.rigs import ring_rig
from frametwin.evaluation.evaluate import evaluate
from frametwin.fitting.api import fit_views
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.lenses import lens_blurs
from frametwin.raster import rods
from frametwin.raster.lens_blur import edge_spread
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import SimulationSettings, deform_print

FRAME = tower()
CAMERAS = ring_rig(FRAME, 6, size=(240, 320))
BLUR = 2.0


def masks_of(frame: object, blur: float) -> list[np.ndarray]:
    sharp = [p / np.float32(255) for p in silhouettes(frame, CAMERAS, supersampling=4)]  # type: ignore[arg-type]
    return [cv2.GaussianBlur(p, (0, 0), blur) if blur else p for p in sharp]


@pytest.mark.parametrize("spread", [0.8, 1.5, 3.0])
@pytest.mark.parametrize("angle", [0.0, 25.0, 45.0])
def test_the_spread_of_a_straight_edge_is_told(spread: float, angle: float) -> None:
    y, x = np.mgrid[:120, :120] - 59.3
    distance = np.cos(np.radians(angle)) * x + np.sin(np.radians(angle)) * y
    edge = np.vectorize(lambda d: 0.5 * (1.0 + erf(d / (sqrt(2.0) * spread))))(distance).astype(np.float32)
    slope_of_a_pixel = sqrt(1.0 / 12.0)  # a difference of neighbours is the slope over a pixel
    assert edge_spread(edge) == pytest.approx(hypot(spread, slope_of_a_pixel), rel=0.04)
    noisy = edge + np.random.default_rng(0).normal(0.0, 0.01, edge.shape).astype(np.float32)
    assert edge_spread(noisy) == pytest.approx(hypot(spread, slope_of_a_pixel), rel=0.2)
    assert edge_spread(np.zeros((9, 9), np.float32)) == 0.0


def test_blur_is_told_by_a_plan_that_lies_elsewhere_and_sharp_masks_have_none() -> None:
    sagged = deform_print(FRAME, SimulationSettings(seed=1, peak=0.03 * FRAME.extent)).truth
    elastic = ElasticFrame(FRAME)
    assert lens_blurs(elastic, CAMERAS, masks_of(sagged, 0.0)) is None
    masks = [*masks_of(sagged, BLUR)[:4], *masks_of(sagged, 0.0)[4:]]
    told = lens_blurs(elastic, CAMERAS, masks)
    assert told is not None
    np.testing.assert_allclose(told[:4], BLUR, rtol=0.1)
    np.testing.assert_array_equal(told[4:], 0.0)


def test_crossing_struts_are_blurred_as_a_whole() -> None:
    """At joints too the rods cover what a blurred silhouette covers; blurred one by one they do not."""
    drawn, masks = of_frame(FRAME, 6), masks_of(FRAME, BLUR)
    whole = Pyramid(CAMERAS, masks, [BLUR] * len(CAMERAS)).level(1.0, 0.0)
    one_by_one = Pyramid(CAMERAS, masks).level(1.0, BLUR)
    errors = [
        np.abs(1.0 - rods.transmittance(drawn, level) - whole.target).mean() / whole.target.mean()
        for level in (whole, one_by_one)
    ]
    assert errors[0] < 0.01 < 0.03 < errors[1]


def test_a_lens_out_of_focus_changes_neither_place_nor_width() -> None:
    sagged = deform_print(FRAME, SimulationSettings(seed=1, peak=0.03 * FRAME.extent)).truth
    twins = [fit_views(FRAME, CAMERAS, masks_of(sagged, blur)).twin for blur in (0.0, BLUR)]
    errors = [evaluate(twin.control_points, twin.vertices, sagged).curves.mean for twin in twins]
    radii = [np.median(twin.thickness.mean(axis=1) / FRAME.radius) for twin in twins]
    assert errors[1] < errors[0] + 0.002 * FRAME.extent
    assert radii[1] == pytest.approx(radii[0], abs=0.03)
    assert twins[1].verdict.status == "good"
