"""The list of a twin's struts: sorted, filtered, and each of them looked at by a click."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from test_blender_twins import shifted

from frametwin.blender.display.statistics import StrutValues
from frametwin.formats import write_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import write_twin

ops = bpy.ops.frametwin


@pytest.fixture
def run(extension: str, scene: Any, rich_frame: Wireframe, tmp_path: Path) -> Any:
    """The add-on's settings with a twin in the scene: strut 3 is missing, 11 to 17 are not printed."""
    write_twin(tmp_path, shifted(rich_frame, [0.0, 0.0, 2.0]))
    write_frame(tmp_path / "frame.json", rich_frame)
    ops.use_millimetres()
    ops.import_run(directory=str(tmp_path))
    return scene.frametwin


def listed() -> tuple[list[bool], list[int]]:
    """What the list shows of every strut: whether, and in which place."""
    module = cases.addon("inspect_struts")
    ui_list = type("List", (), {"bitflag_filter_item": 1 << 30})()
    flags, places = module.FRAMETWIN_UL_struts.filter_items(ui_list, bpy.context, None, "struts")
    return [bool(flag) for flag in flags], places


def in_order() -> list[int]:
    """Numbers of the struts as they are listed."""
    flags, places = listed()
    return [strut for strut in np.argsort(places).tolist() if flags[strut]]


def test_struts_are_sorted_the_worst_first(run: Any) -> None:
    ops.list_struts()
    inspected = bpy.context.window_manager.frametwin_inspect
    assert len(inspected.struts) == 18
    inspected.by = "index"
    assert in_order() == list(range(18))
    inspected.by, inspected.reverse = "confidence", False
    assert in_order() == list(range(18))  # it rises with the number; those that are not printed come last
    inspected.reverse = True
    assert in_order() == [*range(10, -1, -1), *range(11, 18)]
    inspected.by, inspected.reverse = "completeness", False
    assert in_order()[0] == 3
    inspected.by = "batch"
    batches = cases.addon("inspect_struts").table.batch[in_order()]
    assert (np.diff(batches) >= 0).all() and batches.max() == 2**40


def test_struts_are_filtered(run: Any, rich_frame: Wireframe) -> None:
    ops.list_struts()
    inspected = bpy.context.window_manager.frametwin_inspect
    inspected.by, inspected.reverse, inspected.kind = "index", False, "missing"
    assert in_order() == [3]
    inspected.kind, inspected.batch = "all", 5
    assert in_order() == np.flatnonzero(rich_frame.batch == 5).tolist()
    inspected.kind = "torn"
    assert in_order() == []
    inspected.kind, inspected.batch = "radius guessed", -1
    assert in_order() == [3]  # of the missing one; those that are not printed have none at all
    inspected.kind, inspected.batch = "all", -1


def test_a_strut_that_is_chosen_is_looked_at(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[list[int]] = []
    module = cases.addon("inspect_struts")
    monkeypatch.setattr(
        module, "look_at_struts", lambda context, shown, struts, margin, move: looked.append(struts.tolist())
    )
    ops.list_struts()
    bpy.context.window_manager.frametwin_inspect.at = 7
    ops.pick_strut(strut=4)
    assert looked == [[7], [4]] and bpy.context.window_manager.frametwin_inspect.at == 4
    assert "it has 0 to 17" in cases.refused(ops.pick_strut, strut=18)


def test_the_list_is_of_the_twin_that_is_looked_at(run: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    ops.list_struts()
    module = cases.addon("inspect_struts")
    assert module.table_of(bpy.context) is not None
    ops.import_run(directory=str(tmp_path))
    assert module.table_of(bpy.context) is None and listed() == ([], [])
    ops.list_struts()
    assert module.table_of(bpy.context).count == 18
    ops.remove_twin()
    assert module.table_of(bpy.context) is None and not ops.list_struts.poll()


def test_a_click_finds_the_strut_under_it(extension: str) -> None:
    # Seen from 10 above along -z, a strut at the height z has its pixels scaled by 100 / (10 - z) about the middle.
    view = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0], [0, 0, -1.0, 10.0]])
    ends = np.array(
        [[[-3.0, 0, 0], [3.0, 0, 0]], [[0, -3.0, 5.0], [0, 3.0, 5.0]], [[-1.0, 1.0, 20.0], [1.0, 1.0, 20.0]]]
    )
    curves = ends[:, :1] + np.linspace(0.0, 1.0, 4)[:, None] * (ends[:, 1:] - ends[:, :1])
    find = cases.addon("pick_strut").nearest_strut

    def at(x: float, y: float) -> int:
        return int(find(curves, view, (200, 200), np.array([100.0 + x, 100.0 + y]), 5.0))

    assert at(20.0, 3.0) == 0 and at(29.0, 0.0) == 0 and at(36.0, 0.0) == -1
    assert at(3.0, 50.0) == 1 and at(-4.0, -59.0) == 1  # twice as large, since it is half as far away
    assert at(0.0, 15.0) == 1 and at(-10.0, -10.0) == -1  # the third is behind the camera, mirrored to there


def test_a_table_without_values() -> None:
    table = cases.addon("strut_table").StrutTable(
        "a", {"error": StrutValues("error", "mm", np.array([0.5, np.nan, 2.0]))}, np.array([1, 0, 1]), {}
    )
    assert table.order("error").tolist() == [2, 0, 1] and table.order("error", reverse=True).tolist() == [0, 2, 1]
    assert [table.text(k, "error") for k in range(3)] == ["0.50", "-", "2.00"] and table.text(0, "gap") == "-"
    assert table.order("batch").tolist() == [1, 0, 2] and table.shown(batch=1).tolist() == [True, False, True]
