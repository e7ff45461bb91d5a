"""Struts that are bent as no cubic can be, in a scene: one spline each, along the curve that was found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bowed_struts import bowed
from test_blender_twins import shifted
from test_strut_curves import pieces_of

from frametwin.blender.display.comparing import compare_twins
from frametwin.blender.display.exports import export_twin
from frametwin.blender.display.twins import TwinObjects, find_twin, show_twin
from frametwin.blender.frames.plan_objects import use_millimetres
from frametwin.blender.frames.strut_curves import BENT_KEY, PIECES, read_attribute, recorded_curves
from frametwin.formats import obj as obj_lines
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import Twin

BENT = 8
"""A strut that lies flat."""


@pytest.fixture
def frame(rich_frame: Wireframe) -> Wireframe:
    return Wireframe.create(rich_frame.vertices, rich_frame.edges, radius=0.8, name="hexagon")  # straight


def bent_twin(frame: Wireframe, depth: float) -> Twin:
    """A twin whose strut `BENT` hangs by ``depth`` mm, clamped at both ends; strut 3 is missing."""
    curve = bezier.elevate(bowed(frame.control_points[BENT], np.array([0.0, 0.0, -depth])), 5)
    return shifted(frame, [0.0, 0.0, 0.0]).replace(bent={BENT: curve})


def shown_bent(frame: Wireframe, depth: float) -> TwinObjects:
    return show_twin(bent_twin(frame, depth), frame)


@pytest.mark.parametrize("depth", [2.0, 12.0, 60.0])
def test_a_bent_strut_is_one_spline_along_its_curve(scene: Any, frame: Wireframe, depth: float) -> None:
    use_millimetres(scene)
    twin = bent_twin(frame, depth)
    shown = show_twin(twin, frame)
    data = shown.twin.data
    sizes = np.array([len(curve.points) - 1 for curve in data.curves])
    assert len(sizes) == frame.strut_count and (read_attribute(data, "strut") == np.arange(frame.strut_count)).all()
    assert (np.delete(sizes, [3, BENT]) == PIECES).all() and PIECES <= sizes[BENT] <= 16
    first = int(sizes[:BENT].sum())
    u, count = np.linspace(0.0, 1.0, 33), int(sizes[BENT])
    found = bezier.evaluate(pieces_of(shown.twin)[first : first + count], u).reshape(-1, 3)
    wanted = bezier.evaluate(twin.bent[BENT], ((np.arange(count)[:, None] + u) / count).ravel())
    least = 0.01 * frame.radius[BENT] + 1e-5  # of which Blender's single precision takes some
    assert np.linalg.norm(found - wanted, axis=1).max() < least
    assert found[:, 2].min() == pytest.approx(frame.control_points[BENT, 0, 2] - depth, abs=0.02 * depth)


def test_quantities_of_a_bent_strut_are_those_of_its_curve(scene: Any, frame: Wireframe) -> None:
    use_millimetres(scene)
    shown = shown_bent(frame, 6.0)
    u = np.linspace(0.0, 1.0, 17)
    bow = 16.0 * 6.0 * u**2 * (1.0 - u) ** 2
    assert shown.values["displacement_max"].values[BENT] == pytest.approx(6.0)
    assert shown.values["displacement"].values[BENT] == pytest.approx(bow.mean())
    assert shown.values["distance"].values[BENT] == pytest.approx(-6.0)
    data = shown.twin.data
    strut = np.repeat(np.arange(frame.strut_count), [len(curve.points) for curve in data.curves])
    along, moved = read_attribute(data, "parameter"), read_attribute(data, "displacement")
    u = along[strut == BENT].astype(np.float64)
    np.testing.assert_allclose(moved[strut == BENT, 2], -96.0 * u**2 * (1.0 - u) ** 2, atol=1e-5)
    np.testing.assert_allclose(moved[strut != BENT], 0.0, atol=1e-6)


def test_two_twins_with_bent_struts_are_compared_by_their_curves(scene: Any, frame: Wireframe) -> None:
    straight = show_twin(shifted(frame, [0.0, 0.0, 0.0]), frame)
    low = shown_bent(frame, 6.0)
    found = compare_twins(straight, low)
    assert found.struts[0] == BENT and found.largest == pytest.approx(6.0)
    assert compare_twins(low, straight).largest == pytest.approx(6.0, rel=0.02)  # of points of the straight one
    assert compare_twins(low, shown_bent(frame, 6.0)).largest == pytest.approx(0.0, abs=1e-6)


def test_bent_struts_stay_with_the_object_and_are_exported_as_lines(
    scene: Any, frame: Wireframe, tmp_path: Path
) -> None:
    twin = bent_twin(frame, 6.0)
    shown = find_twin(show_twin(twin, frame).collection)
    np.testing.assert_array_equal(recorded_curves(shown.twin), twin.curves)
    np.testing.assert_array_equal(shown.frame().control_points, twin.control_points)
    export_twin(shown, tmp_path / "shown.obj", "cm")
    factor = np.diag([0.1, 0.1, 0.1, 1.0])
    obj_lines.write(tmp_path / "wanted.obj", shown.frame().transformed(factor), "cm", 0.1 * twin.curves)
    assert (tmp_path / "shown.obj").read_bytes() == (tmp_path / "wanted.obj").read_bytes()
    del shown.twin.data[BENT_KEY]
    np.testing.assert_array_equal(recorded_curves(shown.twin), twin.control_points)
