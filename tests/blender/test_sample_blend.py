"""The script that makes a sample .blend file with a finished twin."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from worker_cases import worker_python

from frametwin.blender.display.display_group import COLOUR
from frametwin.blender.display.twins import find_twin, is_twin
from frametwin.blender.frames.strut_curves import read_attribute
from frametwin.blender.scene import visibility
from frametwin.geometry.parametric import named_frame

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "make_sample_blend.py"


def run(*words: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), "--", *map(str, words), "--python", worker_python()]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


def drawn_colours(obj: Any) -> np.ndarray:
    """(N, 3) scene-linear colours of the points that Blender draws, each once."""
    geometry = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).evaluated_geometry()
    mesh = geometry.mesh
    found = np.empty((len(mesh.vertices), 4), dtype=np.float32)
    mesh.attributes[COLOUR].data.foreach_get("color", found.ravel())
    return np.unique(found[:, :3].round(4), axis=0)


def test_the_sample_opens_with_a_finished_twin(tmp_path: Path) -> None:
    file, plan = tmp_path / "sample.blend", named_frame("bridge")
    done = run("--out", file, "--size", "400x300", "--views", "6", "--seed", "3")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["sample.blend"]
    bpy.ops.wm.open_mainfile(filepath=str(file), load_ui=True)
    scene = bpy.context.scene
    (home,) = scene.collection.children
    assert [each.name for each in home.children] == ["Plans", "Prints", "Cameras", "bridge twin"]
    (collection,) = [found for found in home.children if is_twin(found)]
    shown = find_twin(collection)
    np.testing.assert_array_equal(shown.plan().control_points, plan.control_points)
    error = shown.values["error"].values
    assert len(error) == 76 and np.nanmedian(error) < 0.5 * np.nanmedian(shown.values["displacement"].values)
    assert len(shown.missing) == 2
    for name in ("displacement", "radius", "radius_guessed", "opacity", "completeness", "error", "batch", "strut"):
        assert len(read_attribute(shown.twin.data, name))
    layer = bpy.context.view_layer
    layer.update()
    frames = [obj for obj in scene.objects if obj.type in ("CURVE", "CURVES")]
    assert len(frames) == 3 and [obj for obj in frames if visibility.is_shown(obj, layer)] == [shown.twin]
    assert len(drawn_colours(shown.twin)) > 20 and layer.objects.active == shown.twin
    pictures = [image for image in bpy.data.images if image.packed_file]
    assert len(pictures) == 6 and all(image.filepath_raw == f"//{Path(image.filepath_raw).name}" for image in pictures)
    views = [area.spaces.active for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D"]
    assert {view.shading.color_type for view in views} == {"VERTEX"}


def test_what_cannot_be_written_is_told_at_once(tmp_path: Path) -> None:
    there = tmp_path / "there.blend"
    there.write_bytes(b"mine")
    for words, reason in (
        (("--out", there), "exists already"),
        (("--out", tmp_path / "sample.txt"), "is no .blend"),
        (("--out", tmp_path / "sample.blend", "--frame", "nothing"), "nothing"),
    ):
        done = run(*words)
        assert done.returncode == 2 and reason in done.stderr and "Traceback" not in done.stderr
    assert there.read_bytes() == b"mine" and [path.name for path in tmp_path.iterdir()] == ["there.blend"]


def test_a_file_that_was_made_without_the_panels_fills_them(extension: str, scene: Any, tmp_path: Path) -> None:
    from test_blender_twins import shifted

    from frametwin.blender.display.twins import show_twin
    from frametwin.blender.frames.plan_objects import add_plan
    from frametwin.blender.views.rigs import rig_around

    frame = named_frame("bridge")
    visibility.hide(add_plan(frame))
    rig_around(frame, count=3)
    show_twin(shifted(frame, [0.0, 0.0, 2.0]), frame)
    other = bpy.data.scenes.new("two twins")
    for height in (1.0, 2.0):
        show_twin(shifted(frame, [0.0, 0.0, height]), frame, scene=other)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "made.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "made.blend"))
    tab = bpy.context.scene.frametwin
    assert tab.plan.name == "bridge" and not visibility.is_shown(tab.plan, bpy.context.view_layer)
    assert tab.rig.name == "Cameras" and tab.twin.name == "bridge twin" and tab.print_object is None
    assert bpy.data.scenes["two twins"].frametwin.twin is None  # nobody knows which
    bpy.ops.frametwin.select_struts(kind="worst")
    tab.twin = tab.rig = None  # as the user chose
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "made.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "made.blend"))
    assert bpy.context.scene.frametwin.twin is None
