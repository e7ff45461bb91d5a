"""Struts as Blender's own Curves: the handles are those of the cubics, the attributes tell what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from test_blender_twins import shifted

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.exports import export_twin
from frametwin.blender.display.point_values import farthest, height_above, twin_sampling
from frametwin.blender.display.twins import find_twin, show_twin
from frametwin.blender.frames.plan_objects import use_millimetres
from frametwin.blender.frames.strut_curves import (
    PIECES,
    Sampling,
    StrutCurves,
    read_attribute,
    recorded_frame,
    strut_curves_steps,
)
from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import Twin


def pieces_of(obj: bpy.types.Object) -> np.ndarray:
    """(N, 4, 3) cubic of each piece, as Blender's attributes have it."""
    data = obj.data
    point, left, right = (read_attribute(data, name) for name in ("position", "handle_left", "handle_right"))
    strut = np.repeat(np.arange(len(data.curves)), [len(curve.points) for curve in data.curves])
    inner = np.flatnonzero(strut[1:] == strut[:-1])
    return np.stack([point[inner], right[inner], left[inner + 1], point[inner + 1]], axis=1)


def test_the_bezier_handles_are_those_of_the_struts(scene: Any, rich_frame: Wireframe) -> None:
    use_millimetres(scene)
    shown = show_twin(shifted(rich_frame, [3.0, 4.0, 0.0]), rich_frame)
    data = shown.twin.data
    assert shown.twin.type == "CURVES" and len(data.curves) == rich_frame.strut_count
    assert set(read_attribute(data, "curve_type")) == {2}  # Bezier
    whole = np.delete(np.arange(18), 3)  # strut 3 is missing and cut more finely
    sizes = np.array([len(curve.points) - 1 for curve in data.curves])
    assert (sizes[whole] == PIECES).all() and sizes[3] == 20
    strut = np.repeat(np.arange(18), sizes)
    found = pieces_of(shown.twin)
    first = np.cumsum(sizes) - sizes
    for i, piece in enumerate(found):
        k = strut[i]
        begin = (i - first[k]) / sizes[k]
        places = begin + np.linspace(0.0, 1.0, 7) / sizes[k]
        wanted = bezier.evaluate(rich_frame.control_points[k] + [3.0, 4.0, 0.0], places)
        np.testing.assert_allclose(bezier.evaluate(piece, np.linspace(0.0, 1.0, 7)), wanted, atol=2e-5)


def test_points_and_struts_say_what_was_measured(scene: Any, rich_frame: Wireframe) -> None:
    shown = show_twin(shifted(rich_frame, [0.0, 0.0, -2.0]), rich_frame)
    data, printed = shown.twin.data, rich_frame.printed
    sizes = np.array([len(curve.points) for curve in data.curves])
    strut = np.repeat(np.arange(18), sizes)
    for name in ("displacement", "displacement_left", "displacement_right"):  # in units, which are metres here
        np.testing.assert_allclose(read_attribute(data, name), np.tile([0.0, 0.0, -0.002], (len(strut), 1)), atol=1e-9)
    np.testing.assert_allclose(read_attribute(data, "radius"), (rich_frame.radius[strut] + 0.5) / 1000.0, rtol=1e-6)
    np.testing.assert_array_equal(read_attribute(data, "opacity") == 0.0, strut == 3)
    np.testing.assert_array_equal(read_attribute(data, "missing"), strut == 3)
    np.testing.assert_array_equal(read_attribute(data, "strut"), np.arange(18))
    np.testing.assert_array_equal(read_attribute(data, "printed"), printed)
    assert read_attribute(data, "batch").tolist() == [0, 0, 2, 1, 5, 2**31 - 1] * 3
    for name in ("completeness", "confidence", "displacement_mean", "displacement_max"):
        key = "displacement" if name == "displacement_mean" else name
        np.testing.assert_allclose(read_attribute(data, name), shown.values[key].values, rtol=1e-6)


def test_a_half_broken_strut_is_missing_only_where_it_is_broken(scene: Any) -> None:
    frame = Wireframe.create(
        [[0, 0, 0], [0, 0, 40], [30, 0, 0], [30, 0, 40]], [[0, 1], [2, 3], [1, 3], [0, 3]], radius=1.0
    )
    opacity = np.ones((4, 20))
    opacity[1, 8:] = 0.0
    twin = shifted(frame, [0.0, 0.0, 0.0]).replace(opacity=opacity, completeness=opacity.mean(axis=1))
    data = show_twin(twin, frame).twin.data
    missing, parameter = read_attribute(data, "missing"), read_attribute(data, "parameter")
    strut = np.repeat(np.arange(4), [len(curve.points) for curve in data.curves])
    assert not missing[strut != 1].any()
    np.testing.assert_array_equal(missing[strut == 1], parameter[strut == 1] > 0.41)
    guessed = read_attribute(data, "radius_guessed")
    assert not guessed[strut != 1].any()
    np.testing.assert_array_equal(guessed[strut == 1], parameter[strut == 1] > 0.36)  # next to a dark piece


def test_the_radius_of_what_is_not_printed_is_a_guess(scene: Any, rich_frame: Wireframe) -> None:
    data = show_twin(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame).twin.data
    counts = [len(curve.points) for curve in data.curves]
    guessed, strut = read_attribute(data, "radius_guessed"), np.repeat(np.arange(18), counts)
    whole = strut != 3  # of which half is missing
    np.testing.assert_array_equal(guessed[whole], ~rich_frame.printed[strut[whole]])


def test_the_distance_from_the_plan_is_that_to_its_nearest_point() -> None:
    frame = Wireframe.create(
        [[0, 0, 10], [40, 0, 10], [80, 0, 10]], [[0, 1], [1, 2]], radius=1.0, grounded=[True, False, False]
    )
    moved = frame.control_points + np.array([[[5.0, 3.0, -4.0]], [[0.0, 0.0, 2.0]]])
    sampling = Sampling.of(np.array([4, 4]))
    found = height_above(moved, frame.control_points, sampling)
    along = sampling.parameter * 40.0
    beyond = np.maximum(along + 5.0 - 40.0, 0.0)  # slid beyond the end of the plan
    wanted = np.where(sampling.strut == 0, -np.hypot(5.0, beyond), 2.0)
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    np.testing.assert_allclose(farthest(found, sampling), [-np.hypot(5.0, 5.0), 2.0])


def test_a_bent_strut_is_compared_with_its_bent_plan(rich_frame: Wireframe) -> None:
    twin = shifted(rich_frame, [1.0, 2.0, -3.0])
    sampling = twin_sampling(twin, np.array([3]), rich_frame.radius)
    found = np.abs(height_above(twin.control_points, rich_frame.control_points, sampling))
    point, _ = sampling.points(twin.control_points)
    fine = bezier.evaluate(rich_frame.control_points, np.linspace(0.0, 1.0, 4001))
    wanted = [np.linalg.norm(fine[k] - place, axis=1).min() for k, place in zip(sampling.strut, point, strict=True)]
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_what_was_measured_is_locked_and_exported_as_it_was(scene: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    twin = shifted(rich_frame, [3.0, 4.0, 0.0])
    shown = show_twin(twin, rich_frame)
    obj = shown.twin
    locks = (*obj.lock_location, *obj.lock_rotation, *obj.lock_scale, obj.lock_rotation_w)
    assert all(locks) and not obj.select_get()
    for suffix in ("json", "obj", "csv"):
        export_twin(shown, tmp_path / f"before.{suffix}")
    obj.location, obj.scale = (0.05, 0.0, 0.0), (2.0, 1.0, 1.0)
    obj.data.position_data.foreach_set("vector", np.zeros(3 * len(obj.data.points), dtype=np.float32))
    bpy.context.view_layer.update()
    for suffix in ("json", "obj", "csv"):
        export_twin(find_twin(shown.collection), tmp_path / f"after.{suffix}")
        assert (tmp_path / f"after.{suffix}").read_bytes() == (tmp_path / f"before.{suffix}").read_bytes()
    np.testing.assert_array_equal(read_frame(tmp_path / "after.json").control_points, twin.control_points)


def test_torn_ends_survive_in_the_record(scene: Any, rich_frame: Wireframe) -> None:
    plain = shifted(rich_frame, [0.0, 0.0, 1.0])
    attached, gap = np.ones((18, 2), dtype=bool), np.zeros((18, 2))
    attached[0, 1], gap[0, 1] = False, 4.5
    curves = plain.control_points.copy()
    curves[0, 3] += [4.5, 0.0, 0.0]
    twin = Twin(**{**vars(plain), "control_points": curves, "attached": attached, "gap": gap})
    shown = show_twin(twin, rich_frame)
    np.testing.assert_array_equal(shown.frame().control_points, curves)
    np.testing.assert_array_equal(shown.plan().edges, rich_frame.edges)


def test_other_objects_are_told_apart(scene: Any, rich_frame: Wireframe) -> None:
    sampling = Sampling.of(np.full(18, PIECES))
    content = StrutCurves(rich_frame, rich_frame, sampling, {}, np.arange(18))
    obj = run_steps(strut_curves_steps(content, "struts", scene.collection, 1000.0))
    np.testing.assert_array_equal(recorded_frame(obj).batch, rich_frame.batch)
    del obj.data["frametwin"]
    with pytest.raises(InputError, match="not those of a twin"):
        recorded_frame(obj)
    with pytest.raises(InputError, match="nothing: is no attribute"):
        read_attribute(obj.data, "nothing")
