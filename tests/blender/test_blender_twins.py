"""Twins in the scene: where they are, their colours, numbers with closed forms, and that nothing is left behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.colours import BINS, LOOKS, MAPS, MISSING_COLOUR, State, colour_map
from frametwin.blender.display.statistics import statistics_of, worst_struts
from frametwin.blender.display.twin_records import load_verdict
from frametwin.blender.display.twins import (
    RUN_KEY,
    Colours,
    TwinContent,
    find_twin,
    import_twin,
    recolour_twin,
    remove_twin,
    show_twin,
    show_twin_steps,
)
from frametwin.blender.frames.strut_curves import read_attribute
from frametwin.errors import InputError
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.runs import Truth
from frametwin.twin.twin import Twin, write_twin
from frametwin.twin.verdict import Verdict


def shifted(frame: Wireframe, shift: Any) -> Twin:
    """A rigidly moved twin, strut 3 missing."""
    count = frame.strut_count
    opacity = np.ones((count, 20))
    opacity[3] = 0.0
    return Twin(
        control_points=frame.control_points + shift,
        vertices=frame.vertices + shift,
        thickness=np.repeat(frame.radius[:, None], 20, axis=1) + 0.5,
        opacity=opacity,
        completeness=opacity.mean(axis=1),
        confidence=np.linspace(0.0, 1.0, count),
    )


def test_a_run_folder_is_shown_and_removed(scene: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    twin = shifted(rich_frame, [3.0, 4.0, 0.0])
    write_twin(tmp_path, twin)
    frame_json.write(tmp_path / "frame.json", rich_frame)
    shown = import_twin(tmp_path)
    found = shown.frame()
    np.testing.assert_array_equal(found.control_points, twin.control_points)
    np.testing.assert_allclose(found.radius, rich_frame.radius + 0.5, rtol=1e-12)
    np.testing.assert_array_equal(shown.plan().control_points, rich_frame.control_points)
    assert len(shown.collection.objects) == 1 and shown.collection[RUN_KEY] == str(tmp_path)
    np.testing.assert_allclose(shown.values["displacement_max"].values[rich_frame.printed], 5.0, rtol=1e-12)
    for name in ("displacement", "opacity", "completeness", "radius", "confidence"):  # nobody has seen the others
        np.testing.assert_array_equal(np.isnan(shown.values[name].values), ~rich_frame.printed)
    states = read_attribute(shown.twin.data, "state")
    np.testing.assert_array_equal(states == State.UNPRINTED, ~rich_frame.printed)
    assert shown.missing.tolist() == [3]
    remove_twin(shown.collection)
    assert_nothing_is_left()


def assert_nothing_is_left() -> None:
    for kind in ("materials", "hair_curves", "collections", "objects", "meshes", "node_groups"):
        assert not len(getattr(bpy.data, kind)), kind


def test_what_a_fit_thinks_of_its_twin_is_shown(scene: Any, rich_frame: Wireframe) -> None:
    plain = shifted(rich_frame, [0.0, 0.0, 1.0])
    count = rich_frame.strut_count
    attached, gap = np.ones((count, 2), dtype=bool), np.zeros((count, 2))
    torn = int(np.flatnonzero(rich_frame.printed)[0])
    attached[torn, 1], gap[torn, 1] = False, 4.5
    verdict = Verdict("doubtful", ("the masks leave much open", f"strut {torn} is torn off"))
    sigma = np.linspace(0.01, 0.2, count)
    twin = plain.replace(attached=attached, gap=gap, sigma_across=sigma, sigma_along=3.0 * sigma, verdict=verdict)
    shown = show_twin(twin, rich_frame)
    printed = rich_frame.printed
    np.testing.assert_allclose(shown.values["sigma"].values[printed], sigma[printed])
    np.testing.assert_allclose(shown.values["sigma_along"].values[printed], 3.0 * sigma[printed])
    assert np.flatnonzero(np.nan_to_num(shown.values["gap"].values)).tolist() == [torn]
    assert load_verdict(shown.collection) == verdict
    assert recolour_twin(shown.collection, "sigma").unit == "mm"
    older = show_twin(plain, rich_frame)
    assert not {"sigma", "gap"} & older.values.keys()
    with pytest.raises(InputError, match="sigma: cannot be shown"):
        recolour_twin(older.collection, "sigma")


def test_a_twin_comes_whole_or_not_at_all(scene: Any, rich_frame: Wireframe) -> None:
    content = TwinContent.of(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame)
    seen = [len(scene.collection.all_objects) for _ in show_twin_steps(content)]
    assert set(seen[:-1]) == {0} and seen[-1] == 1
    remove_twin(scene.collection.children[0].children[0])
    for last in range(len(seen)):
        steps = show_twin_steps(content)
        for _ in range(last + 1):
            next(steps)
        steps.close()
        assert_nothing_is_left()


def test_a_twin_comes_in_the_colours_that_are_wanted(scene: Any, rich_frame: Wireframe) -> None:
    content = TwinContent.of(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame)
    shown = run_steps(show_twin_steps(content, colours=Colours("confidence", 0.1, 0.4)))
    legend = find_twin(shown.collection).legend
    assert (legend.quantity, legend.low, legend.high, legend.automatic) == ("confidence", 0.1, 0.4, False)
    assert legend.falling and legend.ends == (0.4, 0.1)


def test_recolouring_touches_no_data(scene: Any, rich_frame: Wireframe) -> None:
    shown = show_twin(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame)
    before = {each.name: read_attribute(shown.twin.data, each.name) for each in shown.twin.data.attributes}
    for quantity in ("confidence", "radius", "displacement", "distance"):
        legend = recolour_twin(shown.collection, quantity, 0.25, 0.75)
    assert (legend.low, legend.high) == (0.25, 0.75)
    assert len(bpy.data.materials) == len(bpy.data.node_groups) == 1
    after = {each.name: read_attribute(shown.twin.data, each.name) for each in shown.twin.data.attributes}
    assert after.keys() == before.keys()
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values)
    with pytest.raises(InputError, match="range"):
        recolour_twin(shown.collection, "radius", 1.0, 1.0)
    with pytest.raises(InputError, match="colour map"):
        recolour_twin(shown.collection, "radius", map_name="Rainbow")


def test_error_across_straight_struts_is_the_shift(scene: Any) -> None:
    frame = Wireframe.create(
        [[0, 0, 0], [0, 0, 40], [30, 0, 0], [30, 0, 40]], [[0, 1], [2, 3], [1, 3], [0, 3]], radius=1.0
    )
    truth = Truth(frame, np.array([[0.0, 0.5], [0.0, 1.0], [0.0, 0.0], [0.0, 1.0]]))
    error = show_twin(shifted(frame, [0.0, 2.0, 0.0]), frame, truth=truth).values["error"].values
    np.testing.assert_allclose(error, [2.0, 2.0, np.nan, 2.0], rtol=1e-9)


def test_statistics_and_worst() -> None:
    values = np.array([1.0, np.nan, 3.0, 2.0])
    found = statistics_of(values)
    assert (found.mean, found.max, found.min) == (2.0, 3.0, 1.0)
    assert (found.p95, found.p5) == (pytest.approx(2.9), pytest.approx(1.1))
    assert worst_struts(values, 2).tolist() == [2, 3] and worst_struts(values, 9).tolist() == [2, 3, 0]


def test_the_colours_are_inside_of_the_gamut_and_distinct() -> None:
    for name in MAPS:
        colours = colour_map(name)
        assert colours.min() > 0.0 and colours.max() < 1.0  # nothing had to be clipped
        assert len(np.unique(colours.round(4), axis=0)) == BINS
        for other in (MISSING_COLOUR, *(look.colour for look in LOOKS.values() if look.words == "would have missed")):
            assert np.abs(colours - other).max(axis=1).min() > 0.1
    assert LOOKS[State.MISSED].colour != MISSING_COLOUR
