"""What the add-on draws a legend for, and what it says where a view hides the colours."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from test_blender_twins import shifted

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.colours import LOOKS, State
from frametwin.blender.display.legend_entries import legend_entries
from frametwin.blender.display.print_jobs import show_job_steps
from frametwin.blender.display.twins import TwinObjects, show_twin
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.history import BatchHistory, PrintHistory


@pytest.fixture
def legend(extension: str) -> Any:
    return cases.addon("legend")


@pytest.fixture
def shown(legend: Any, scene: Any, rich_frame: Wireframe) -> TwinObjects:
    found = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame)
    scene.frametwin.twin = found.collection
    return found


def history(frame: Wireframe) -> PrintHistory:
    """A print of one batch that sagged by 3 mm: strut 4 would have missed, strut 5 fell."""
    sagged = frame.transformed(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -3], [0, 0, 0, 1.0]]))
    standing = sagged.replace(printed=frame.printed & (np.arange(18) != 5))
    batch = BatchHistory(
        batch=0,
        planned=frame,
        standing=standing,
        adapted=standing,
        laid=np.flatnonzero(frame.printed),
        missed=np.array([4]),
        lost=np.array([5]),
        collapsed=False,
    )
    return PrintHistory(name="hexagon", adapts=True, design=frame, batches=(batch,))


def test_there_is_a_legend_for_the_twin_and_for_each_job(
    legend: Any, shown: TwinObjects, rich_frame: Wireframe
) -> None:
    view = SimpleNamespace(scene=bpy.context.scene, space_data=None)
    ((title, objects),) = legend.shown_groups(view)
    assert not title and objects == [shown.twin]
    job = run_steps(show_job_steps(history(rich_frame), bpy.context.scene))
    bpy.context.view_layer.update()
    groups = dict(legend.shown_groups(view))
    assert list(groups) == [shown.collection.name, job.collection.name]
    words = {entry.words for entry in legend_entries(groups[job.collection.name])}
    assert words == {"plan", "still to print, adapted", "would have missed", "lost"}
    assert "missing" in {entry.words for entry in legend_entries([shown.twin])}
    assert LOOKS[State.MISSED].colour not in {entry.colour for entry in legend_entries([shown.twin])}
    shown.twin.hide_set(True)
    assert list(dict(legend.shown_groups(view))) == [job.collection.name]


def test_the_legend_says_what_hides_the_colours(legend: Any, scene: Any) -> None:
    def notes(kind: str, colour: str = "VERTEX", transform: str = "Standard") -> list[str]:
        scene.view_settings.view_transform = transform
        space = SimpleNamespace(shading=SimpleNamespace(type=kind, color_type=colour))
        found: list[str] = legend.notes(SimpleNamespace(space_data=space, scene=scene))
        return found

    assert (
        not notes("SOLID") and not notes("MATERIAL") and not notes("RENDERED") and not notes("SOLID", "VERTEX", "AgX")
    )
    assert "Color > Attribute" in notes("SOLID", "MATERIAL")[0]
    assert "AgX" in notes("RENDERED", transform="AgX")[0] and notes("WIREFRAME")


def test_views_and_scene_show_colours_where_nobody_chose_otherwise(legend: Any, scene: Any) -> None:
    spaces = [area.spaces.active for area in bpy.context.window.screen.areas if area.type == "VIEW_3D"]
    scene.view_settings.view_transform = "AgX"
    cases.addon("recolour").show_colours(scene)
    assert scene.view_settings.view_transform == "Standard"
    assert {(space.shading.color_type, space.shading.light) for space in spaces} == {("VERTEX", "FLAT")}
    scene.view_settings.view_transform = "Filmic"
    for space in spaces:
        space.shading.color_type = "RANDOM"
    cases.addon("recolour").show_colours(scene)
    assert scene.view_settings.view_transform == "Filmic"
    assert {space.shading.color_type for space in spaces} == {"RANDOM"}
