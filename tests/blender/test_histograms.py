"""Histograms of what the colours show: each strut counts once, in the bin of its colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from test_blender_twins import shifted

from frametwin.blender.display.histograms import binned, histogram_of
from frametwin.blender.display.twins import recolour_twin, show_twin
from frametwin.geometry.wireframe import Wireframe


def test_values_beyond_the_ends_are_in_the_bins_at_the_ends() -> None:
    values = np.array([-5.0, 0.0, 0.24, 0.26, 0.99, 1.0, 9.0, np.nan])
    weights = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 100.0])
    assert binned(values, weights, (0.0, 1.0), 4).tolist() == [3, 1, 0, 3]
    assert binned(values, weights, (1.0, 0.0), 4).tolist() == [3, 0, 1, 3]  # the other way round
    assert binned(values[:0], weights[:0], (0.0, 1.0), 4).tolist() == [0, 0, 0, 0]


def test_struts_with_a_value_are_counted(scene: Any, rich_frame: Wireframe) -> None:
    shown = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame)
    counts = histogram_of([shown.twin], shown.legend)
    assert counts[-1] == 10 and counts.sum() == 10  # of 18 struts 11 are printed, of which one is missing
    np.testing.assert_allclose(histogram_of([shown.twin, shown.twin], shown.legend), 2.0 * counts)
    legend = recolour_twin(shown.collection, "confidence", 0.0, 1.0)  # of strut k it is k/17
    wanted = np.zeros(32)
    for strut in set(range(11)) - {3}:
        wanted[min(int((1.0 - np.float32(strut / 17.0)) * 32), 31)] += 1  # the good end is the high one
    np.testing.assert_array_equal(histogram_of([shown.twin], legend), wanted)


def test_a_strut_counts_once_also_where_it_has_many_values(scene: Any, rich_frame: Wireframe) -> None:
    frame = rich_frame.replace(radius=np.linspace(1.0, 2.0, 18), printed=np.ones(18, dtype=bool))
    twin = shifted(frame, [0.0, 0.0, 1.0])
    opacity = np.ones((18, 20))
    opacity[3] = 0.0
    opacity[7, 10:] = 0.0  # half of it is gone, so that it has more points than the others
    shown = show_twin(twin.replace(opacity=opacity, completeness=opacity.mean(axis=1)), frame)
    legend = recolour_twin(shown.collection, "radius", 0.0, 10.0)  # in mm, while the attribute is in Blender units
    counts = histogram_of([shown.twin], legend, bins=10)
    thinner = np.flatnonzero(frame.radius + 0.5 < 2.0)
    wanted = len(thinner) - (3 in thinner) - 0.5 * (7 in thinner)
    np.testing.assert_allclose(counts.sum(), 16.5, atol=0.05)
    np.testing.assert_allclose(counts[8], wanted, atol=0.05)
