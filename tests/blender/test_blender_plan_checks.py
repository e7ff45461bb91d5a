"""What is said of faulty plans, and the struts that are selected for it."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest

from frametwin.blender.frames.curves import wireframe_to_curve
from frametwin.blender.frames.plan_checks import plan_problems, select_struts
from frametwin.geometry.wireframe import Wireframe

SQUARE = [[0, 0, 0], [50, 0, 0], [50, 0, 40], [0, 0, 40]]
EDGES = [[0, 3], [1, 2], [3, 2]]


def found(frame: Wireframe) -> dict[str, tuple[int, ...]]:
    return {problem.kind: problem.struts for problem in plan_problems(frame)}


def test_a_sound_frame_has_no_problem(rich_frame: Wireframe) -> None:
    assert plan_problems(Wireframe.create(SQUARE, EDGES, radius=1.0)) == ()
    assert plan_problems(rich_frame) == ()


def test_parts_in_the_air_and_apart_are_told_from_each_other() -> None:
    vertices = [*SQUARE, [90, 0, 0], [90, 0, 30], [20, 9, 20], [30, 9, 20]]
    frame = Wireframe.create(vertices, [[6, 7], *EDGES, [4, 5]], radius=1.0)
    assert found(frame) == {"floating": (0,), "separate": (4,)}
    assert "1 strut is hanging in the air" in plan_problems(frame)[0].sentence


def test_a_frame_that_stands_nowhere() -> None:
    frame = Wireframe.create(SQUARE, EDGES, radius=1.0, grounded=[False] * 4)
    assert found(frame) == {"nothing_grounded": (0, 1, 2)}


def test_short_and_doubled_struts() -> None:
    vertices = [*SQUARE, [0, 0, 41.5], [0, 0.2, 0], [0, 0.2, 40]]
    frame = Wireframe.create(vertices, [*EDGES, [3, 4], [6, 5]], radius=1.0)
    problems = found(frame)
    assert problems["short"] == (3,) and problems["doubled"] == (0, 4)
    bent = frame.control_points.copy()
    bent[4, 1:3] += [0.0, 5.0, 0.0]
    assert "doubled" not in found(frame.replace(control_points=bent))


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_exactly_the_culprits_are_selected(scene: Any, rich_frame: Wireframe, mode: str) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data.splines.remove(obj.data.splines[2])  # numbers are those of the frame, not of the splines
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode=mode)
    assert select_struts(obj, [1, 2, 7]) == 2
    bpy.ops.object.mode_set(mode="EDIT")
    chosen = [all(p.select_control_point for p in s.bezier_points) for s in obj.data.splines]
    some = [any(p.select_control_point for p in s.bezier_points) for s in obj.data.splines]
    assert np.flatnonzero(chosen).tolist() == np.flatnonzero(some).tolist() == [1, 6]
    assert select_struts(obj, []) == 0
    assert not any(p.select_control_point for s in obj.data.splines for p in s.bezier_points)
