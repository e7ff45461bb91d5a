"""What goes wrong is one report in words, leaves the scene as it was and no process behind; the next try just works."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from worker_cases import is_gone, script, until, worker_python

from frametwin.blender.display.highlights import highlighted_struts
from frametwin.blender.display.preview import KEY as PREVIEW
from frametwin.blender.display.twins import find_twin
from frametwin.errors import InputError
from frametwin.formats import read_frame

ops = bpy.ops.frametwin
REMEDY = "press Set Up in Preferences > Add-ons > FrameTwin, or choose another Python there"
posix = pytest.mark.skipif(os.name == "nt", reason="shell scripts and signals are for POSIX")


@pytest.fixture
def session(extension: str, scene: Any) -> Any:
    module = cases.addon("session")
    module.runner.close()
    yield module
    module.runner.close()
    cases.addon("computing").preferences_of().python = ""


@pytest.fixture
def tab(session: Any, scene: Any, small_capture: Path, tmp_path: Path) -> Any:
    """The settings, with a small capture that is ready to be fitted, slowly."""
    settings = scene.frametwin
    settings.fit.capture, settings.render.folder = str(small_capture), str(tmp_path / "work")
    settings.fit.preset = "paper"
    return settings


def test_the_curves_move_while_a_fit_runs_and_cancelling_ends_it(tab: Any, session: Any, scene: Any) -> None:
    before = cases.scene_state()
    ops.fit()
    assert not ops.fit.poll() and not ops.sag.poll()
    cases.pump_until(lambda: any(PREVIEW in obj for obj in scene.objects))
    shown = next(obj for obj in scene.objects if PREVIEW in obj)
    first = [tuple(point.position) for point in shown.data.points]
    cases.pump_until(lambda: [tuple(point.position) for point in shown.data.points] != first)
    assert session.runner.status.total and "loss" in session.runner.status.line
    pids = session.runner.pids
    ops.cancel()
    assert cases.pump_until_done() == "Cancelled"
    assert cases.scene_state() == before and tab.twin is None
    assert not list(Path(tab.render.folder).glob("*"))
    tab.fit.preset = "fast"
    ops.fit()
    assert "struts found" in cases.pump_until_done()
    session.runner.close()
    assert all(is_gone(pid) for pid in pids) and not session.runner.pids


@posix
def test_a_worker_that_is_killed_is_reported_and_the_next_fit_works(tab: Any, session: Any) -> None:
    before = cases.scene_state()
    ops.fit()
    cases.pump_until(lambda: session.runner.status.total > 0)
    (pid,) = session.runner.pids
    os.kill(pid, signal.SIGKILL)
    words = cases.pump_until_done()
    assert "SIGKILL" in words and "fresh" in words and session.runner.status.error
    assert cases.scene_state() == before
    tab.fit.preset = "fast"
    ops.fit()
    assert "struts found" in cases.pump_until_done()
    plan = read_frame(Path(tab.fit.capture))
    np.testing.assert_array_equal(find_twin(tab.twin).frame().edges, plan.edges)


def test_a_python_that_is_missing(
    tab: Any, session: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, online: None
) -> None:
    computing = cases.addon("computing")
    computing.preferences_of().python = str(tmp_path / "nowhere")
    before = cases.scene_state()
    with monkeypatch.context() as nothing:  # to compute with
        nothing.delenv("FRAMETWIN_PYTHON", raising=False)
        nothing.setattr(computing, "running_interpreter", lambda packages: None)
        assert f"nowhere: Python: does not exist; {REMEDY}" in cases.refused(ops.fit)
    assert cases.scene_state() == before and not session.runner.busy
    # Where there is another one, what is typed wrongly does not win over it; the panels tell of it.
    assert computing.chosen_python(torch=True).python != str(tmp_path / "nowhere")
    assert computing.given_problem().endswith("nowhere: Python: does not exist; it is not used.")
    tab.fit.preset = "fast"
    ops.fit()
    assert "struts found" in cases.pump_until_done()


def test_the_environment_that_was_set_up_is_the_one_in_use(
    session: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    computing, set_up = cases.addon("computing"), cases.addon("set_up")
    computing.preferences_of().python = str(tmp_path / "nowhere")
    monkeypatch.setattr(computing, "installed_python", lambda folder: worker_python())
    assert computing.chosen_python(torch=True).python == worker_python()  # also before the end is noticed
    ended = UnderWay()
    monkeypatch.setattr(session, "installer", None)
    session.start_installation(ended, set_up.use_environment)
    assert session.pump() and computing.preferences_of().python
    ended.running, ended.done = False, True
    assert not session.pump() and computing.preferences_of().python == ""
    assert computing.chosen_python(torch=True).python == worker_python()
    ops.show_set_up_log()
    assert bpy.data.texts[set_up.LOG].as_string() == "$ pip install\nSuccessfully installed\n"


@posix
def test_a_worker_of_another_version(tab: Any, session: Any, tmp_path: Path) -> None:
    ready = '{"event": "ready", "protocol": 1, "frametwin": "9.9.9", "jobs": []}'
    fake = script(tmp_path / "python", f"echo '{ready}'; exec sleep 60")
    cases.addon("computing").preferences_of().python = fake
    before = cases.scene_state()
    ops.fit()
    words = cases.pump_until_done()
    assert "9.9.9 where" in words and REMEDY in words and "Traceback" not in words
    assert cases.scene_state() == before and not session.runner.pids
    ops.test_python()
    assert "9.9.9" in cases.pump_until_done()


@posix
def test_a_python_without_frametwin(tab: Any, session: Any, tmp_path: Path) -> None:
    bare = script(tmp_path / "python", f'exec "{sys.executable}" -S -I "$@"')
    cases.addon("computing").preferences_of().python = bare
    ops.fit()
    assert cases.pump_until_done() == f"{bare}: frametwin: is not installed there; {REMEDY}."


class UnderWay:
    """What the preferences look at of a set-up that is under way."""

    running, done, error, number, total, stage = True, False, "", 1, 3, "installing PyTorch"
    log = ("$ pip install", "Successfully installed")

    def start(self) -> None:
        """Nothing is installed here."""

    def cancel(self, wait: float = 0.0) -> None:
        self.running = False


@pytest.fixture
def online() -> Iterator[None]:
    """Set Up is offered to those alone who let Blender use the network; nothing is loaded here."""
    system = bpy.context.preferences.system
    before, system.use_online_access = system.use_online_access, True
    yield
    system.use_online_access = before


def test_set_up_waits_for_the_job_that_runs(tab: Any, session: Any, online: None) -> None:
    assert ops.set_up.poll()
    ops.fit()
    assert "Fit is under way: wait for it, or cancel it" in cases.refused(ops.set_up)
    assert session.runner.busy and session.installer is None
    ops.cancel()
    cases.pump_until_done()
    assert ops.set_up.poll()


def test_nothing_is_computed_with_a_python_that_is_being_set_up(
    tab: Any, session: Any, online: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    ops.open_capture()
    monkeypatch.setattr(session, "installer", UnderWay())
    assert "is under way" in cases.refused(ops.set_up)
    assert tab.fit.preset == "paper" and "is being set up: wait until that is done" in cases.refused(ops.fit)
    computing = cases.addon("computing")
    with pytest.raises(InputError, match="is being set up: wait until that is done, or cancel it in Preferences"):
        computing.chosen_python(torch=True)
    for operator in (ops.sag, ops.plan_print, ops.test_python):  # these have another Python
        assert operator.poll()
    preferences = computing.preferences_of()
    preferences.python = str(computing.environment_folder() / "bin" / "python")
    for operator in (ops.fit, ops.sag, ops.simulate_print, ops.plan_print, ops.test_python):
        assert "is being set up: wait until that is done" in cases.refused(operator)
    preferences.python = worker_python()  # another one that the user has
    assert ops.fit.poll() and computing.chosen_python(torch=True).python == os.path.abspath(worker_python())
    preferences.python = ""
    tab.fit.preset = "fast"
    ops.cancel_set_up()
    assert ops.fit.poll() and ops.set_up.poll()


def test_the_test_button_tells_versions(session: Any) -> None:
    ops.test_python()
    words = cases.pump_until_done()
    assert words.startswith("Works: Python 3.") and "PyTorch 2." in words and "numpy" in words and "cores" in words
    until(lambda: not session.runner.pids, "the end of the worker that was tested")


def test_a_damaged_capture(tab: Any, session: Any, small_capture: Path) -> None:
    before = cases.scene_state()
    image = next((small_capture / "images").glob("*.png"))
    whole = image.read_bytes()
    image.write_bytes(whole[: len(whole) // 2])
    words = cases.refused(ops.fit) if not started(ops.fit) else cases.pump_until_done()
    assert image.name in words and "Traceback" not in words
    image.write_bytes(whole)
    (small_capture / "frame.json").write_text('{"format": "frametwin-frame", "version": 1, "vertices": [[0')
    assert "frame.json" in cases.refused(ops.fit)
    assert "frame.json" in cases.refused(ops.open_capture)
    assert cases.scene_state() == before


def started(operator: Any) -> bool:
    """Whether an operator begins a job; one that refuses at once is as good."""
    try:
        operator()
    except RuntimeError:
        return False
    return True


def test_files_that_cannot_be_used(tab: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = cases.scene_state()
    damaged = tmp_path / "damaged.json"
    damaged.write_text('{"format": "frametwin-frame", "version": 1, "vertices": [[0, 0')
    for operator in (ops.import_frame, ops.import_cameras):
        assert "damaged.json" in cases.refused(operator, filepath=str(damaged))
        assert "nowhere.json" in cases.refused(operator, filepath=str(tmp_path / "nowhere.json"))
    for name, words in (
        ("mesh.stl", "does not exist"),
        ("picture.png", "is a picture, which holds no frame; choose a frame or a mesh."),
        ("scene.blend", "is a file of Blender"),
        ("print.3mf", "file: "),
        ("cut.stl", "Blender cannot read it"),
        ("cut.off", "file: "),
    ):
        if name != "mesh.stl":
            (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n" * 3)
        said = cases.refused(ops.import_frame, filepath=str(tmp_path / name))
        assert f"{name}: file: " in said and words in said and said.strip().endswith(".")
    monkeypatch.setattr(cases.addon("plan"), "find_spec", lambda name: None)  # as in Blender's own Python
    for kind, library in (("3dm", "rhino3dm"), ("dxf", "ezdxf")):
        said = cases.refused(ops.import_frame, filepath=str(tmp_path / f"plan.{kind}"))
        assert library in said and f"frametwin convert plan.{kind} plan.json" in said
    assert "twin.json: file: the file does not exist" in cases.refused(ops.import_run, directory=str(tmp_path))
    tab.fit.capture = "//capture"
    assert "save the file" in cases.refused(ops.fit)
    assert cases.scene_state() == before and tab.plan is None


def test_opening_another_file_ends_what_runs(tab: Any, session: Any) -> None:
    ops.fit()
    cases.pump_until(lambda: session.runner.status.total > 0)
    (pid,) = session.runner.pids
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert not session.runner.busy and is_gone(pid)
    assert not [obj for obj in bpy.data.objects if PREVIEW in obj]


def test_a_deleted_plan_or_twin_is_no_plan(tab: Any, session: Any) -> None:
    ops.add_frame()
    ops.sag()
    bpy.data.objects.remove(tab.plan)  # while the worker computes
    assert "printed" in cases.pump_until_done()  # the print is shown all the same
    assert tab.print_object is not None and not ops.sag.poll()
    tab.fit.preset = "fast"
    ops.fit()
    cases.pump_until_done()
    for obj in list(tab.twin.objects):
        bpy.data.objects.remove(obj)
    assert "import the run again" in cases.refused(ops.select_struts, kind="worst")
    ops.remove_twin()
    assert tab.twin is None and not ops.adapt.poll()


def test_rendering_is_cancelled_without_a_rest(tab: Any, session: Any) -> None:
    ops.add_frame()
    tab.render.style = "photo"
    tab.cameras.width, tab.cameras.height = 800, 600
    ops.make_rig()
    before = cases.scene_state()
    ops.render()
    cases.pump_until(lambda: session.runner.status.stage == "rendering")
    ops.cancel()
    assert cases.pump_until_done() == "Cancelled"
    until(lambda: not list(Path(tab.render.folder).glob(".*")), "the end of the half-made folder")
    assert not list(Path(tab.render.folder).glob("*")) and cases.scene_state() == before
    assert tab.fit.capture.endswith("capture")


@pytest.mark.parametrize("stage", ["reading the result", "showing the result"])
def test_a_fit_that_is_cancelled_at_its_end_leaves_no_folder(tab: Any, session: Any, stage: str) -> None:
    before = cases.scene_state()
    tab.fit.preset = "fast"
    ops.fit()
    cases.pump_until(lambda: session.runner.status.stage == stage, pump=lambda: session.runner.pump(0.0))
    assert [path.name for path in Path(tab.render.folder).iterdir()] == ["run-001"]
    ops.cancel()
    assert cases.scene_state() == before and tab.twin is None
    until(lambda: not Path(tab.render.folder).exists(), "the end of the run folder")


def test_a_scene_that_is_deleted_while_a_job_runs(tab: Any, session: Any, scene: Any) -> None:
    tab.fit.preset = "fast"
    ops.fit()
    bpy.data.scenes.new("other")
    bpy.data.scenes.remove(scene)
    assert "is gone" in cases.pump_until_done() and session.runner.status.error
    assert not bpy.data.objects and not bpy.data.collections


def test_who_edits_while_a_fit_ends_stays_in_edit_mode(tab: Any, session: Any) -> None:
    ops.open_capture()
    bpy.ops.object.mode_set(mode="EDIT")
    ops.sag()
    cases.pump_until_done()
    tab.fit.preset = "fast"
    ops.fit()
    assert "struts found" in cases.pump_until_done()
    assert bpy.context.mode == "EDIT_CURVE" and bpy.context.object == tab.plan and tab.plan.visible_get()
    assert not tab.print_object.visible_get() and find_twin(tab.twin)


def test_a_fit_that_was_saved_in_the_middle_leaves_no_curves_in_the_file(
    tab: Any, session: Any, tmp_path: Path
) -> None:
    ops.fit()
    cases.pump_until(lambda: any(PREVIEW in obj for obj in bpy.data.objects))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "middle.blend"))
    assert any(PREVIEW in obj for obj in bpy.data.objects)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "middle.blend"))
    assert not any(PREVIEW in obj for obj in bpy.data.objects)
    assert not session.runner.busy and not session.runner.status.message  # of another file


def test_what_is_hidden_is_shown_to_have_its_struts_highlighted(tab: Any, session: Any) -> None:
    ops.open_capture()
    ops.sag()
    cases.pump_until_done()
    assert not tab.plan.visible_get() and tab.print_object.visible_get()
    tab.fit.preset = "fast"
    ops.fit()
    cases.pump_until_done()
    assert not tab.print_object.visible_get()
    twin = find_twin(tab.twin).twin
    twin.hide_set(True)
    ops.step_strut(step=1)
    assert bpy.context.mode == "OBJECT" and twin.visible_get() and len(highlighted_struts(twin)) == 1
    eye = bpy.context.view_layer.layer_collection.children["FrameTwin"].children[tab.twin.name]
    for way in ("hide_viewport", "exclude"):
        setattr(eye, way, True)
        ops.select_struts(kind="worst")
        assert bpy.context.mode == "OBJECT" and twin.visible_get()
    ops.remove_twin()
    assert tab.print_object.visible_get() and not tab.plan.visible_get()


def test_undo_while_a_fit_runs_does_it_no_harm(tab: Any, session: Any, scene: Any) -> None:
    if not bpy.ops.ed.undo_push.poll():
        pytest.skip("this Blender has no undo without a window")
    bpy.ops.ed.undo_push(message="start")
    ops.add_frame()
    bpy.ops.ed.undo_push(message="frame")
    ops.fit()
    cases.pump_until(lambda: any(PREVIEW in obj for obj in bpy.data.objects))
    bpy.ops.ed.undo_push(message="with its curves")
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    ops.cancel()
    cases.pump_until_done()
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    assert not any(PREVIEW in obj for obj in bpy.data.objects)
    bpy.context.scene.frametwin.fit.preset = "fast"
    ops.fit()
    cases.pump_until(
        lambda: session.runner.status.stage == "showing the result",
        pump=lambda: session.runner.pump(0.0),  # step by step, or a fast machine shows all of it in one
    )
    bpy.ops.ed.undo()
    assert "struts found" in cases.pump_until_done()
    assert find_twin(bpy.context.scene.frametwin.twin)


def test_undo_brings_the_plan_before_back_into_view(tab: Any, scene: Any) -> None:
    if not bpy.ops.ed.undo_push.poll():
        pytest.skip("this Blender has no undo without a window")
    ops.add_frame()
    bpy.ops.ed.undo_push(message="one")
    first = tab.plan.name
    ops.add_frame()
    bpy.ops.ed.undo_push(message="another")
    assert not bpy.data.objects[first].visible_get()
    bpy.ops.ed.undo()
    assert bpy.context.scene.frametwin.plan.name == first and bpy.data.objects[first].visible_get()


def test_undo_takes_back_and_redo_brings_again(tab: Any, scene: Any) -> None:
    if not bpy.ops.ed.undo_push.poll():
        pytest.skip("this Blender has no undo without a window")
    bpy.ops.ed.undo_push(message="start")
    ops.add_frame()
    bpy.ops.ed.undo_push(message="frame")
    bpy.ops.ed.undo()
    assert bpy.context.scene.frametwin.plan is None and not ops.make_rig.poll()
    bpy.ops.ed.redo()
    assert bpy.context.scene.frametwin.plan is not None and ops.make_rig.poll()
