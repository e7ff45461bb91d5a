"""What Blender's users expect of an add-on: its commands in Blender's menus, files that open by what they are, help."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest

from frametwin.blender.display.colours import LOOKS
from frametwin.blender.display.quantities import QUANTITIES
from frametwin.blender.frames.curves import wireframe_from_curve
from frametwin.capture.capture import read_capture
from frametwin.formats import read_frame, write_frame
from frametwin.geometry.parametric import FRAMES, named_frame
from frametwin.geometry.wireframe import Wireframe

ops = bpy.ops.frametwin


@pytest.fixture
def tab(extension: str, scene: Any, tmp_path: Path) -> Any:
    cases.addon("session").runner.close()
    settings = scene.frametwin
    settings.render.folder = str(tmp_path / "work")
    return settings


class Entries:
    """A layout that remembers what is put into it."""

    def __init__(self) -> None:
        self.operators: list[str] = []
        self.menus: list[str] = []

    def operator(self, name: str, **words: Any) -> Any:
        self.operators.append(name)
        return type("Properties", (), {})()

    def menu(self, name: str, **words: Any) -> None:
        self.menus.append(name)

    def separator(self, **words: Any) -> None:
        """A line."""


def entries(draw: Any) -> Entries:
    shown = Entries()
    draw(type("Menu", (), {"layout": shown})(), bpy.context)
    return shown


def test_every_command_is_in_the_menu_and_has_a_name_to_be_found_by(tab: Any) -> None:
    operators = {
        cls.bl_idname.removeprefix("frametwin."): cls
        for cls in cases.addon("plan").Step.__subclasses__() + bpy.types.Operator.__subclasses__()
        if getattr(cls, "bl_idname", "").startswith("frametwin.")
    }
    assert len(operators) > 30
    assert {cls.bl_label.partition(": ")[0] for cls in operators.values()} == {"FrameTwin"}
    menus = cases.addon("menus")
    found = {name.removeprefix("frametwin.") for name in entries(menus.FRAMETWIN_MT_main.draw).operators}
    assert (
        {"sag", "fit", "render", "make_rig", "adapt", "simulate_print", "cancel", "report_bug"}
        < found
        <= set(operators)
    )
    for cls in operators.values():
        assert cls.__doc__ and len(cls.bl_label) < 45


def test_blenders_own_menus_have_the_entries(tab: Any) -> None:
    menus = cases.addon("menus")
    for name, draw in menus.PLACES:
        assert draw in getattr(bpy.types, name)._dyn_ui_initialize()
    assert entries(menus.draw_import).operators[0] == "frametwin.import_frame"
    assert entries(menus.draw_export).operators[0] == "frametwin.export_twin"
    assert entries(menus.draw_add).menus == ["FRAMETWIN_MT_add"]
    assert len(entries(menus.FRAMETWIN_MT_add.draw).operators) == len(FRAMES)
    ops.add_frame(frame="half_bowl")  # as that menu does
    np.testing.assert_array_equal(wireframe_from_curve(tab.plan).edges, named_frame("half_bowl").edges)


def test_files_are_opened_by_what_they_are(tab: Any, small_capture: Path, tmp_path: Path) -> None:
    frame = named_frame("bridge")
    write_frame(tmp_path / "plan.json", frame)
    ops.open_file(filepath=str(tmp_path / "plan.json"))
    assert tab.about_plan.struts == 76 and tab.rig is None
    ops.open_file(filepath=str(small_capture / "transforms.json"))
    assert Path(tab.fit.capture) == small_capture and len(tab.rig.objects) == 3
    assert tab.about_plan.struts == read_capture(small_capture).frame.strut_count
    ops.fit()
    cases.pump_until_done()
    twin = tab.twin
    ops.open_file(filepath=str(Path(twin["frametwin_run"]) / "twin.json"))
    assert tab.twin != twin and tab.twin["frametwin_run"] == twin["frametwin_run"]

    alone = tmp_path / "calibrated"
    alone.mkdir()
    poses = json.loads((small_capture / "transforms.json").read_text())
    poses["frames"] = poses["frames"][:2]
    (alone / "transforms.json").write_text(json.dumps(poses))
    tab.fit.capture = ""
    ops.open_file(filepath=str(alone / "transforms.json"))
    assert len(tab.rig.objects) == 2 and not tab.fit.capture


def test_a_print_job_that_is_dropped_comes_onto_the_timeline(tab: Any, scene: Any) -> None:
    ops.add_frame()
    tab.print.batch_size, tab.print.mode = 40, "adapt"
    ops.simulate_print()
    cases.pump_until_done(300.0)
    job = Path(tab.print.job)
    ops.remove_jobs()
    tab.print.job = ""
    ops.open_file(filepath=str(job / "job.json"))
    assert "batches on the timeline" in cases.pump_until_done() and Path(tab.print.job) == job


def test_files_that_are_none_of_these_are_told_of(tab: Any, tmp_path: Path) -> None:
    before = cases.scene_state()
    (tmp_path / "cut.json").write_text('{"format": "frametwin-twin", "ver')
    (tmp_path / "other.json").write_text('{"format": "frametwin-field", "version": 1}')
    for name in ("cut.json", "other.json", "nowhere.json"):
        assert name in cases.refused(ops.open_file, filepath=str(tmp_path / name))
    assert cases.scene_state() == before and tab.plan is None


def test_the_handlers_of_dropped_files_name_operators_that_take_them(tab: Any) -> None:
    opening = cases.addon("opening")
    for handler in (opening.FRAMETWIN_FH_file, opening.FRAMETWIN_FH_drawing):
        operator = getattr(ops, handler.bl_import_operator.removeprefix("frametwin."))
        assert "filepath" in operator.get_rna_type().properties
        area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
        with bpy.context.temp_override(area=area):
            assert handler.poll_drop(bpy.context)


def test_what_to_do_next_leads_through_the_tab(tab: Any, rich_frame: Wireframe) -> None:
    from test_blender_twins import shifted

    from frametwin.blender.display.twins import show_twin

    next_step = cases.addon("next_step").next_step
    seen = [next_step(bpy.context)]
    ops.add_frame()
    seen.append(next_step(bpy.context))
    ops.make_rig()
    seen.append(next_step(bpy.context))
    tab.fit.capture = "somewhere"
    seen.append(next_step(bpy.context))
    tab.twin = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame).collection
    seen.append(next_step(bpy.context))
    whole = rich_frame.replace(printed=np.ones(18, dtype=bool))
    tab.twin = show_twin(shifted(whole, [0.0, 0.0, 2.0]), whole).collection
    seen.append(next_step(bpy.context))
    assert [words.partition(":")[0] for words in seen] == ["Plan", "Deform", "Render", "Fit", "Adapt", "Twin"]


def test_help_and_bug_reports_without_a_published_page(tab: Any) -> None:
    support = cases.addon("support")
    ops.show_help()
    assert bpy.data.texts[support.PAGE].as_string().startswith("# Blender")
    cases.refused(ops.import_frame, filepath="/nowhere.json")
    ops.report_bug()
    words = bpy.data.texts[support.REPORT].as_string()
    assert bpy.app.version_string in words and "FrameTwin 0." in words and "What I did:" in words
    ops.report_bug()
    assert len([text for text in bpy.data.texts if text.name.startswith(support.REPORT)]) == 1


def test_the_status_bar_tells_how_a_job_ended_until_it_is_dismissed(tab: Any, tmp_path: Path) -> None:
    session, status = cases.addon("session"), cases.addon("status")
    write_frame(tmp_path / "plan.json", named_frame("bridge"))
    ops.import_frame(filepath=str(tmp_path / "plan.json"))
    assert read_frame(tmp_path / "plan.json").strut_count == 76
    tab.print.job = str(tmp_path)
    ops.show_job()
    cases.pump_until_done()
    assert session.runner.status.error and status.notice(session.runner.status).startswith("Print: ")
    assert len(status.notice(session.runner.status)) <= status.LONGEST
    assert cases.addon("steps").end_icon(session.runner.status) == "ERROR"
    assert status.draw_in_status_bar in bpy.types.STATUSBAR_HT_header._dyn_ui_initialize()
    ops.dismiss()
    assert not session.runner.status.message and not session.runner.status.error
    ops.simulate_print()
    assert ops.cancel_by_key.poll() and not ops.dismiss.poll()
    ops.cancel_by_key()
    cases.pump_until_done()
    assert session.runner.status.cancelled and cases.addon("steps").end_icon(session.runner.status) == "CANCEL"
    assert not ops.cancel_by_key.poll()


def test_every_translated_word_is_one_that_the_tab_shows(tab: Any) -> None:
    translations = cases.addon("translations")
    folder = Path(translations.__file__).parent
    code = "\n".join(path.read_text(encoding="utf-8") for path in folder.glob("*.py") if path.name != "translations.py")
    names = {quantity.name for quantity in QUANTITIES.values()}  # of what the colours show
    names |= {bpy.path.display_name(str(path), title_case=False) for path in folder.glob("presets/frametwin/*/*.py")}
    names |= {look.words for look in LOOKS.values()} | {"missing", "no value"}  # and of what else the legend names
    assert not [word for word in translations.WORDS if f'"{word}"' not in code and word not in names]
    for language in translations.catalogue().values():
        assert all(text.strip() and text == text.strip() for text in language.values())
    assert cases.addon("plan").FRAMETWIN_PT_plan.bl_translation_context == translations.CONTEXT
