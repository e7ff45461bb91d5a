"""Prints batch by batch: simulated from the tab, on the timeline, and as a film."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from worker_cases import until

from frametwin.blender.display.print_jobs import (
    FIRST_FRAME,
    FRAMES_A_BATCH,
    ROLE_KEY,
    batch_shown,
    jobs_in,
    place_shift,
)
from frametwin.blender.frames.curves import wireframe_to_curve
from frametwin.blender.frames.strut_curves import recorded_frame
from frametwin.capture.image_files import decode_png
from frametwin.files import read_json
from frametwin.formats import frame_json
from frametwin.geometry.parametric import named_frame
from frametwin.printing.records.history import read_history

ops = bpy.ops.frametwin
SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "film_print.py"


@pytest.fixture
def tab(extension: str, scene: Any, tmp_path: Path) -> Any:
    cases.addon("session").runner.close()
    settings = scene.frametwin
    settings.render.folder = str(tmp_path / "work")
    settings.print.batch_size = 26
    ops.use_millimetres()
    ops.add_frame()
    return settings


def roles(collection: bpy.types.Collection) -> dict[str, bpy.types.Object]:
    return {obj[ROLE_KEY]: obj for obj in collection.objects}


def test_prints_with_and_without_adaptation_on_the_timeline(tab: Any, scene: Any, tmp_path: Path) -> None:
    tab.print_object = wireframe_to_curve(named_frame("bridge"), name="a print")
    scene.frame_set(7)
    before = (scene.frame_current, scene.frame_start, scene.frame_end)
    tab.print.speed, tab.print.pull = 4.2, 0.1
    ops.simulate_print()
    words = cases.pump_until_done(300.0)
    assert not tab.print_object.visible_get()
    assert "Adapted: " in words and "As designed: " in words
    adapted, blind = jobs_in(scene)
    assert (adapted.name, blind.name) == ("bridge, adapted, print-001", "bridge, as designed, print-002")
    assert scene.frame_current == scene.frame_end and all_in_view(adapted, blind)
    assert tab.print.job.endswith("print-002") and not tab.plan.visible_get()
    history = read_history(Path(tab.print.job).with_name("print-001"))
    wanted = read_json(Path(tab.print.job, "simulation.json"))["options"]
    assert (wanted["plan"]["waypoints"], wanted["print"]["draw"]) == ({"speed": 4.2}, 0.1)
    work = Path(tab.render.folder)
    assert sorted(path.name for path in work.iterdir()) == ["print-001", "print-002"]
    assert not [file for file in work.rglob("*.json") if ".part" in file.read_text()]  # the folder it was made in
    assert history.adapts and not read_history(tab.print.job).adapts
    assert len(adapted.children) == len(history.batches) > 1
    for number, (batch, inner) in enumerate(zip(history.batches, adapted.children, strict=True)):
        scene.frame_set(FIRST_FRAME + number * FRAMES_A_BATCH)
        assert batch_shown(adapted, scene.frame_current) == inner
        shown = [obj for obj in adapted.all_objects if not obj.hide_viewport]
        assert set(shown) == set(inner.objects)
        standing = recorded_frame(roles(inner)["standing"])
        np.testing.assert_array_equal(standing.control_points, batch.standing.control_points[batch.standing.printed])
        following = roles(inner).get("next")
        left = ~batch.adapted.printed & ~np.isin(np.arange(76), batch.lost)
        assert (following is None) == (not left.any())
    beside = recorded_frame(roles(blind.children[0])["plan"])
    shift = place_shift(history.design, 1)[:3, 3]
    np.testing.assert_allclose(beside.vertices, named_frame("bridge").vertices + shift, atol=1e-4)

    scene.frame_set(FIRST_FRAME)
    ops.step_batch(step=1)
    assert scene.frame_current == FIRST_FRAME + FRAMES_A_BATCH
    ops.step_batch(step=-1)
    ops.step_batch(step=-1)
    assert scene.frame_current == FIRST_FRAME
    ops.remove_jobs()
    assert not jobs_in(scene) and not scene.timeline_markers and not ops.step_batch.poll()
    assert (scene.frame_current, scene.frame_start, scene.frame_end) == before
    assert tab.print_object.visible_get() and tab.plan.visible_get()  # as before
    tab.plan.hide_set(False)
    ops.show_job()
    assert "batches on the timeline" in cases.pump_until_done()
    assert not tab.plan.visible_get()
    check_film(Path(tab.print.job), tmp_path)


def all_in_view(*jobs: bpy.types.Collection) -> bool:
    """Whether the 3D view looks at about the middle of all that is shown of jobs, from as far as they are large."""
    area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    view = area.spaces.active.region_3d
    bpy.context.view_layer.update()
    seen = [obj for job in jobs for obj in job.all_objects if obj.visible_get()]
    points = np.concatenate([np.array(obj.bound_box) @ np.array(obj.matrix_world)[:3, :3].T for obj in seen])
    low, high = points.min(axis=0), points.max(axis=0)
    size, aside = np.linalg.norm(high - low), np.linalg.norm(0.5 * (low + high) - view.view_location)
    return bool(aside < 0.5 * size < view.view_distance < 3.0 * size)


def check_film(job: Path, folder: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--", str(job), "--out", str(folder / "film.mp4"), "--size", "320x180"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert (folder / "film.mp4").read_bytes()[4:8] == b"ftyp"
    pictures = sorted(folder.glob("film_batch_*.png"))
    assert len(pictures) == len(read_history(job).batches)
    first, last = (decode_png(path.read_bytes()) for path in (pictures[0], pictures[-1]))
    assert first.shape[:2] == (180, 320) and np.abs(first.astype(int) - last).max() > 50


def test_a_simulated_print_that_is_cancelled_leaves_no_folder(tab: Any, scene: Any) -> None:
    before = cases.scene_state()
    ops.simulate_print()
    runner = cases.addon("session").runner
    cases.pump_until(lambda: runner.status.stage == "printing" and runner.status.iteration > 0)
    ops.cancel()
    assert cases.pump_until_done() == "Cancelled" and cases.scene_state() == before
    until(lambda: not Path(tab.render.folder).exists(), "the end of the job folder")


def test_a_job_for_a_robot_is_planned_and_shown_where_nothing_is_printed(tab: Any, scene: Any) -> None:
    tab.print.coupon, tab.print.supports, tab.print.speed = 6, 1, 3.3
    ops.plan_print()
    words = cases.pump_until_done(200.0)
    job = Path(tab.print.job)
    settings = read_json(job / "job.json")["settings"]
    assert settings["robot"]["waypoints"]["speed"] == 3.3
    assert settings["coupon"] == 6 and settings["support_struts"] >= 1
    assert frame_json.read(job / "design.json").strut_count == 76 + settings["support_struts"] + 6
    assert "print its first batch" in words and list((job / "batches" / "000" / "waypoints").iterdir())
    assert not ops.answer_print.poll()
    ops.show_job()
    assert "none has been answered" in cases.pump_until_done()
    assert not jobs_in(scene)


def test_a_folder_that_is_no_job(tab: Any, tmp_path: Path) -> None:
    tab.print.job = str(tmp_path)
    before = cases.scene_state()
    ops.show_job()
    assert "no print job" in cases.pump_until_done() and cases.scene_state() == before
    tab.fit.capture = str(tmp_path)
    ops.answer_print()
    words = cases.pump_until_done()
    assert "job.json" in words and cases.scene_state() == before


def test_bad_words_of_the_film_script(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--", str(tmp_path), "--out", str(tmp_path / "film.mp4")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 2 and "no print job" in done.stderr and not list(tmp_path.iterdir())
