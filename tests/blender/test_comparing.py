"""Two twins and two batches compared: what the operators show is what the plain function says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from test_addon_legend import history
from test_blender_twins import shifted

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.colouring import legend_of
from frametwin.blender.display.comparing import KEY, compare_batches, compare_twins, comparison_of, leave_batches
from frametwin.blender.display.display_inputs import ATTRIBUTE, get_input
from frametwin.blender.display.legend_entries import legend_entries
from frametwin.blender.display.print_jobs import FIRST_FRAME, FRAMES_A_BATCH, show_job_steps
from frametwin.blender.display.twins import find_twin, recolour_twin, show_twin
from frametwin.blender.frames.strut_curves import read_attribute
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.history import PrintHistory
from frametwin.twin.twin import Twin

ops = bpy.ops.frametwin


def bowed(frame: Wireframe, strut: int, depth: float) -> Twin:
    """A twin of a frame, one of whose struts is bowed; strut 3 is missing."""
    curves = np.array(frame.control_points)
    curves[strut, 1:3, 2] -= depth
    return shifted(frame, [0.0, 0.0, 0.0]).replace(control_points=curves)


def struts_of_points(obj: Any) -> np.ndarray:
    return np.repeat(np.arange(len(obj.data.curves)), [len(curve.points) for curve in obj.data.curves])


def test_a_twin_is_compared_point_by_point(scene: Any, rich_frame: Wireframe) -> None:
    frame = Wireframe.create(rich_frame.vertices, rich_frame.edges, name="hexagon")  # straight
    first = show_twin(shifted(frame, [0.0, 0.0, 0.0]), frame)
    second = show_twin(bowed(frame, 8, 4.0), frame)  # strut 8 lies flat
    found = compare_twins(first, second)
    distance, strut = read_attribute(second.twin.data, "difference"), struts_of_points(second.twin)
    along = read_attribute(second.twin.data, "parameter")
    np.testing.assert_allclose(distance[strut == 8], 12.0 * (along * (1.0 - along))[strut == 8], atol=1e-5)
    assert np.isnan(distance[strut == 3]).all()  # it is missing
    np.testing.assert_allclose(distance[(strut != 8) & (strut != 3)], 0.0, atol=1e-5)
    assert (found.count, found.struts[0]) == (17, 8) and found.largest == pytest.approx(3.0)
    u = np.linspace(0.0, 1.0, 17)
    assert found.mean == pytest.approx((12.0 * u * (1.0 - u)).mean() / 17)
    known = find_twin(second.collection).values["difference"]
    assert known.unit == "mm" and np.flatnonzero(np.isnan(known.values)).tolist() == [3]
    legend = recolour_twin(second.collection, "difference")
    assert legend.high == pytest.approx(3.0) and get_input(second.twin, ATTRIBUTE) == "difference"
    assert comparison_of(second.twin) == found and comparison_of(first.twin) is None
    assert "no value" not in {entry.words for entry in legend_entries([second.twin])}  # strut 3 is red
    assert "difference" not in find_twin(first.collection).values


def test_twins_of_other_struts_are_refused(scene: Any, rich_frame: Wireframe) -> None:
    part, _ = rich_frame.subset(np.arange(18) > 2)
    shown = [show_twin(shifted(frame, [0.0, 0.0, 0.0]), frame) for frame in (rich_frame, part)]
    with pytest.raises(InputError, match="choose another twin of the same plan"):
        compare_twins(*shown)
    assert comparison_of(shown[1].twin) is None and shown[1].twin.data.attributes.get("difference") is None


def two_batches(frame: Wireframe) -> PrintHistory:
    """A print of two batches, in the second of which what stood before sank by 1.5 mm more, and strut 11 was laid."""
    one = history(frame)
    (batch,) = one.batches
    sunk = np.eye(4)
    sunk[2, 3] = -1.5
    standing = batch.standing.transformed(sunk)
    printed = batch.standing.printed | (np.arange(18) == 11)
    none = np.zeros(0, dtype=np.int64)
    stands = standing.replace(printed=printed)
    later = replace(batch, batch=1, standing=stands, laid=np.array([11]), missed=none, lost=none)
    return replace(one, batches=(batch, later))


def test_batches_are_compared_where_struts_stand_in_both(scene: Any, rich_frame: Wireframe) -> None:
    frame = Wireframe.create(rich_frame.vertices, rich_frame.edges).replace(printed=rich_frame.printed)
    job = run_steps(show_job_steps(two_batches(frame), scene)).collection
    found = compare_batches(job, 0, 1)
    (obj,) = [obj for obj in job.all_objects if KEY in obj]
    assert obj.name.startswith("standing 1") and found.other == "batch 0"
    assert found.count == 10 and 1.0 < found.largest <= 1.5 + 1e-6  # 5 fell, 11 is new; flat ones are 1.5 mm apart
    distance, row = read_attribute(obj.data, "difference"), struts_of_points(obj)
    numbers = read_attribute(obj.data, "strut")
    assert np.isnan(distance[numbers[row] == 11]).all() and np.isfinite(distance[numbers[row] != 11]).all()
    ring = numbers[row] == 7  # one of the upper hexagon, which lies flat
    np.testing.assert_allclose(distance[ring], 1.5, atol=1e-5)
    assert legend_of(obj).quantity == "difference"
    assert "no value" in {entry.words for entry in legend_entries([obj])}  # of strut 11
    leave_batches(job)
    legends = [legend_of(each) for each in job.all_objects if each.name.startswith("standing")]
    assert {(legend.quantity, legend.high) for legend in legends} == {("displacement", legends[0].high)}
    for wrong in ((0, 0), (0, 2), (-1, 1)):
        with pytest.raises(InputError, match="batch"):
            compare_batches(job, *wrong)


@pytest.fixture
def tab(extension: str, scene: Any, rich_frame: Wireframe) -> Any:
    """The add-on's settings with two twins, the second of which is looked at."""
    settings = scene.frametwin
    shown = [show_twin(shifted(rich_frame, [0.0, 0.0, height]), rich_frame) for height in (2.0, 3.0)]
    settings.twin = shown[1].collection
    return settings


def test_the_operator_shows_what_the_function_says(tab: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    first, second = [each for each in bpy.data.collections if "hexagon" in each.name]
    assert not ops.compare_twins.poll()
    tab.view.other = first
    ops.list_struts()
    ops.compare_twins()
    shown = find_twin(second)
    found = comparison_of(shown.twin)
    assert tab.view.quantity == "difference" and shown.legend.quantity == "difference"
    assert found.other == first.name and found.count == 10
    table = cases.addon("inspect_struts").table_of(bpy.context)
    assert table.order("difference")[0] == found.struts[0] and table.text(3, "difference") == "-"
    assert cases.addon("compared").title_of_colours("difference", "", shown.twin) == f"Distance from {first.name}"
    tab.view.quantity = "displacement"
    assert shown.legend.quantity == "difference" and find_twin(second).legend.quantity == "displacement"
    ops.select_struts(kind="worst")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    tab = bpy.context.scene.frametwin
    assert comparison_of(find_twin(tab.twin).twin) == found
    tab.view.quantity = "difference"
    assert find_twin(tab.twin).legend.quantity == "difference"
    tab.twin = tab.view.other  # which was compared with nothing
    assert "has not been compared" in cases.addon("session").last_words


def test_the_operator_compares_the_batches_of_all_jobs(tab: Any, scene: Any, rich_frame: Wireframe) -> None:
    assert not ops.compare_batches.poll()
    jobs = [run_steps(show_job_steps(two_batches(rich_frame), scene, place=i)).collection for i in range(2)]
    ops.compare_batches()
    assert scene.frame_current == FIRST_FRAME + FRAMES_A_BATCH
    assert [sum(KEY in obj for obj in job.all_objects) for job in jobs] == [1, 1]
    tab.print.first_batch, tab.print.second_batch = 1, 0
    ops.compare_batches()
    found = [obj for job in jobs for obj in job.all_objects if KEY in obj]
    assert [obj.name.split(".")[0] for obj in found] == ["standing 0"] * 2 and scene.frame_current == FIRST_FRAME
    tab.print.first_batch = 7
    assert "choose lower numbers" in cases.refused(ops.compare_batches)
    ops.leave_batches()
    assert not any(KEY in obj for obj in bpy.data.objects)
