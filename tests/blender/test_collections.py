"""The one collection that holds all others of ours, and files in which they stand at the root of the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from test_addon_legend import history
from test_blender_twins import assert_nothing_is_left, shifted

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.print_jobs import jobs_in, remove_job, show_job_steps
from frametwin.blender.display.prints import copy_to_bend, show_print_steps
from frametwin.blender.display.twins import import_twin, remove_twin, show_twin
from frametwin.blender.frames.plan_objects import add_plan
from frametwin.blender.scene import visibility
from frametwin.blender.views.rigs import rig_around
from frametwin.formats import write_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.twin import write_twin

ops = bpy.ops.frametwin


def simulated(frame: Wireframe) -> dict[str, Any]:
    """A print as the worker answers with it: everything as planned."""
    return {
        "printed_struts": np.ones(frame.strut_count, dtype=bool),
        "control_points": frame.control_points,
        "vertices": frame.vertices,
        "present": np.tile([0.0, 1.0], (frame.strut_count, 1)),
    }


def test_all_that_is_made_stands_in_one_collection(scene: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    run = tmp_path / "run-007"
    run.mkdir()
    write_twin(run, shifted(rich_frame, [0.0, 0.0, 2.0]))
    write_frame(run / "frame.json", rich_frame)
    plan, mine = add_plan(rich_frame), bpy.data.objects.new("mine", None)
    scene.collection.objects.link(mine)
    prints = [copy_to_bend(plan), run_steps(show_print_steps(rich_frame, simulated(rich_frame)))]
    rig = rig_around(rich_frame, count=3)
    twin = import_twin(run).collection
    job = run_steps(show_job_steps(history(rich_frame), scene)).collection
    (home,) = scene.collection.children
    assert home.name == "FrameTwin" and not home.objects and list(scene.collection.objects) == [mine]
    assert [each.name for each in home.children] == ["Plans", "Prints", rig.name, twin.name, job.name]
    assert list(home.children["Plans"].objects) == [plan] and list(home.children["Prints"].objects) == prints
    assert twin.name == "hexagon twin, run-007"
    remove_twin(twin)
    remove_job(job)
    assert [each.name for each in home.children] == ["Plans", "Prints", rig.name]


def test_scenes_have_each_their_own(scene: Any, rich_frame: Wireframe) -> None:
    other = bpy.data.scenes.new("other")
    homes = [rig_around(rich_frame, count=1, scene=each) and each.collection.children[0] for each in (scene, other)]
    assert homes[0] != homes[1]
    show_twin(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame)
    assert [len(home.children) for home in homes] == [2, 1]


@pytest.mark.parametrize("way", ["hide_viewport", "exclude"])
def test_what_is_new_is_seen_although_the_collection_was_closed(scene: Any, rich_frame: Wireframe, way: str) -> None:
    plan = add_plan(rich_frame)
    eye = bpy.context.view_layer.layer_collection.children["FrameTwin"]
    setattr(eye, way, True)
    shown = show_twin(shifted(rich_frame, [0.0, 0.0, 1.0]), rich_frame)
    bpy.context.view_layer.update()
    assert shown.twin.visible_get()
    setattr(eye, way, True)
    visibility.show_all(shown.collection, bpy.context.view_layer)
    assert shown.twin.visible_get()
    visibility.hide(plan)
    setattr(eye, way, True)
    visibility.show(plan)
    assert plan.visible_get()


def test_a_print_that_is_cancelled_leaves_no_collection(scene: Any, rich_frame: Wireframe) -> None:
    steps = show_print_steps(rich_frame, simulated(rich_frame))
    next(steps)
    steps.close()
    assert_nothing_is_left()


def test_files_with_collections_at_the_root_of_the_scene_work_on(
    extension: str, scene: Any, rich_frame: Wireframe, tmp_path: Path
) -> None:
    settings = scene.frametwin
    ops.use_millimetres()
    ops.add_frame()
    ops.make_rig()
    settings.twin = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame).collection
    run_steps(show_job_steps(history(rich_frame), scene))
    home = scene.collection.children["FrameTwin"]
    for child in list(home.children):  # as older versions made them
        home.children.unlink(child)
        if child.name != "Plans":
            scene.collection.children.link(child)
    scene.collection.objects.link(settings.plan)
    bpy.data.collections.remove(home)
    bpy.data.collections.remove(bpy.data.collections["Plans"])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "old.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "old.blend"))
    scene, settings = bpy.context.scene, bpy.context.scene.frametwin
    assert [each.name for each in scene.collection.children] == ["Cameras", "hexagon twin", "hexagon print"]
    steps = cases.addon("steps")
    assert steps.twin_of(bpy.context) == settings.twin and steps.rig_of(bpy.context) == settings.rig
    assert steps.plan_of(bpy.context) == settings.plan and len(jobs_in(scene)) == 1
    ops.select_struts(kind="worst")
    ops.make_rig()  # in the place of the old one
    assert list(scene.collection.children["FrameTwin"].children) == [settings.rig]
    assert settings.rig.name == "Cameras" and len(bpy.data.cameras) == 8
    ops.remove_twin()
    ops.remove_jobs()
    assert [each.name for each in scene.collection.children] == ["FrameTwin"]
