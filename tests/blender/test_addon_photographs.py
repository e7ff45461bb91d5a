"""From a calibrated rig and photographs to a twin by the sidebar alone."""

from __future__ import annotations

import json
from dataclasses import replace
from math import degrees
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest
from small_frames import tower

pytest.importorskip("cv2", reason="pictures are undistorted and masked with OpenCV")

import cv2

from frametwin.blender.frames.curves import wireframe_from_curve
from frametwin.blender.views.comparisons import KEY
from frametwin.blender.views.rigs import cameras_from_collection
from frametwin.calibration.rig_capture import capture_from_rig
from frametwin.cameras.rig_file import Rig, RigCamera, read_rig, write_rig
from frametwin.cameras.rigs import ring_rig
from frametwin.cameras.standing import standing_at
from frametwin.capture.capture import Capture, read_capture
from frametwin.formats import write_frame
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.verdict import Verdict

ops = bpy.ops.frametwin
FRAME = tower()
BASE = (400.0, -30.0, 12.0, 25.0)


@pytest.fixture
def lab(extension: str, scene: Any, tmp_path: Path) -> Any:
    """The add-on's settings; a plan, a rig in the robot's world and a picture of each camera on the disk."""
    cases.addon("session").runner.close()
    cameras = ring_rig(FRAME, 7, size=(120, 160))
    known = np.diag(np.square([0.3, 0.3, 0.2, 0.2, *5 * [1e-4], *3 * [1e-4], *3 * [0.05]]))
    seen = tuple(RigCamera.of(camera, known) for camera in cameras)
    rig = Rig(seen, world="robot", date="2026-11-20T10:00:00").moved(standing_at(BASE))
    for folder in ("workshop", "shots", "before"):
        (tmp_path / folder).mkdir()
    write_rig(tmp_path / "workshop", rig)
    for camera, picture in zip(cameras, silhouettes(FRAME, cameras), strict=True):
        cv2.imwrite(str(tmp_path / "shots" / f"{camera.name}.png"), picture)
        cv2.imwrite(str(tmp_path / "before" / f"{camera.name}.png"), np.zeros_like(picture))
    write_frame(tmp_path / "plan.json", FRAME)
    settings = scene.frametwin
    settings.render.folder = str(tmp_path / "work")
    ops.use_millimetres()
    settings.pictures.place, settings.pictures.turn = BASE[:3], np.radians(BASE[3])
    return settings


class Lines:
    """A layout that remembers its labels and buttons, and takes only what there is."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.buttons: dict[str, Any] = {}

    def prop(self, data: Any, name: str, **words: Any) -> None:
        assert data.bl_rna.properties[name].description

    def operator(self, name: str, **words: Any) -> Any:
        assert getattr(ops, name.removeprefix("frametwin.")).get_rna_type().description
        return self.buttons.setdefault(name.removeprefix("frametwin."), SimpleNamespace())

    def label(self, text: str = "", **words: Any) -> None:
        self.texts.append(text)

    def column(self, **words: Any) -> Lines:
        return self

    box = row = column


def sidebar(width: int = 260) -> Any:
    """The context of a sidebar that is so many pixels wide; without a window Blender's own has no scale."""
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    return SimpleNamespace(scene=bpy.context.scene, region=SimpleNamespace(width=width), preferences=preferences)


def content_of(capture: Capture) -> dict[str, Any]:
    """What a capture holds, file by file: pictures as pixels, since their metadata may differ."""
    files = [path for path in sorted(capture.root.rglob("*")) if path.is_file()]
    return {
        str(path.relative_to(capture.root)): cv2.imread(str(path), cv2.IMREAD_UNCHANGED).tolist()
        if path.suffix == ".png"
        else json.loads(path.read_text())
        for path in files
    }


def test_a_rig_stands_about_the_plan_under_its_own_name(lab: Any, tmp_path: Path) -> None:
    ops.import_rig(filepath=str(tmp_path / "workshop" / "rig.json"))
    assert lab.rig.name == "workshop" and Path(lab.pictures.rig) == tmp_path / "workshop"
    wanted = ring_rig(FRAME, 7, size=(120, 160))
    for camera, expected in zip(cameras_from_collection(lab.rig), wanted, strict=True):
        assert camera.name == expected.name
        np.testing.assert_allclose(camera.camera_to_world, expected.camera_to_world, atol=1e-3)
    lab.pictures.place, lab.pictures.turn = (0.0, 0.0, 0.0), 0.0
    ops.open_file(filepath=str(tmp_path / "workshop" / "rig.json"))  # as a file that is dropped
    for camera, told in zip(cameras_from_collection(lab.rig), read_rig(tmp_path / "workshop").cameras, strict=True):
        np.testing.assert_allclose(camera.camera_to_world, told.camera_to_world, atol=1e-3)
    assert lab.rig.name == "workshop" and not lab.fit.capture


def test_a_rig_of_an_unknown_world_is_refused(lab: Any, tmp_path: Path) -> None:
    rig = read_rig(tmp_path / "workshop")
    (tmp_path / "loose").mkdir()
    write_rig(tmp_path / "loose", replace(rig, world="camera"))
    before = cases.scene_state()
    assert "frametwin calibrate place" in cases.refused(ops.import_rig, filepath=str(tmp_path / "loose"))
    assert "rig.json" in cases.refused(ops.import_rig, filepath=str(tmp_path / "nowhere"))
    assert cases.scene_state() == before and lab.rig is None and not lab.pictures.rig


def test_pictures_become_the_capture_of_the_scene_and_its_twin(lab: Any, tmp_path: Path) -> None:
    assert not ops.capture_pictures.poll()
    ops.import_frame(filepath=str(tmp_path / "plan.json"))
    ops.import_rig(filepath=str(tmp_path / "workshop"))
    assert cases.addon("next_step").next_step(bpy.context).startswith("Photographs: ")
    (tmp_path / "shots" / "camera_03.png").rename(tmp_path / "elsewhere.png")
    lab.pictures.folder, lab.pictures.before = str(tmp_path / "shots"), str(tmp_path / "before")
    ops.capture_pictures()
    words = cases.pump_until_done()
    assert words.startswith("6 pictures in ") and "no picture of camera_03" in words
    made = read_capture(lab.fit.capture)
    plan = wireframe_from_curve(lab.plan)
    capture_from_rig(
        read_rig(tmp_path / "workshop"),
        tmp_path / "shots",
        plan,
        tmp_path / "wanted",
        base=standing_at([*lab.pictures.place, degrees(lab.pictures.turn)]),
        background=tmp_path / "before",
    )
    assert content_of(made) == content_of(read_capture(tmp_path / "wanted"))
    assert lab.rig.name == "workshop" and [obj.name for obj in lab.rig.objects] == [
        view.camera.name for view in made.views
    ]
    assert cases.addon("next_step").next_step(bpy.context).startswith("Fit: ")
    ops.fit()
    cases.pump_until_done(300.0)
    assert lab.twin is not None and not cases.addon("session").runner.status.error


def test_what_is_printed_is_what_the_panel_says(lab: Any, tmp_path: Path) -> None:
    ops.import_frame(filepath=str(tmp_path / "plan.json"))
    printed_plan = cases.addon("photographs").printed_plan
    np.testing.assert_array_equal(printed_plan(bpy.context).printed, FRAME.printed)
    lab.pictures.how, lab.pictures.height = "height", 0.6 * float(np.ptp(FRAME.vertices[:, 2]))
    top = FRAME.vertices[FRAME.edges, 2].max(axis=1) - FRAME.vertices[:, 2].min()
    printed = printed_plan(bpy.context).printed
    np.testing.assert_array_equal(printed, top <= lab.pictures.height)
    assert 0 < printed.sum() < len(printed)


def test_pictures_that_do_not_fit_are_told_of_and_leave_nothing(lab: Any, tmp_path: Path) -> None:
    ops.import_frame(filepath=str(tmp_path / "plan.json"))
    ops.import_rig(filepath=str(tmp_path / "workshop"))
    lab.pictures.folder = str(tmp_path / "before")
    cv2.imwrite(str(tmp_path / "before" / "camera_01.png"), np.zeros((60, 80), dtype=np.uint8))
    ops.capture_pictures()
    words = cases.pump_until_done()
    assert "camera_01.png" in words and "80 x 60" in words
    assert not lab.fit.capture and not list((tmp_path / "work").glob("capture-*"))
    assert len(lab.rig.objects) == 7


def test_masks_lie_over_the_views_and_spoilt_ones_are_named(lab: Any, tmp_path: Path) -> None:
    assert not ops.show_masks.poll()
    rig = read_rig(tmp_path / "workshop")
    cv2.imwrite(str(tmp_path / "shots" / "camera_02.png"), np.zeros((120, 160), dtype=np.uint8))
    capture_from_rig(rig, tmp_path / "shots", FRAME, tmp_path / "capture", base=standing_at(BASE))
    lab.fit.capture = str(tmp_path / "capture")
    ops.show_masks()  # there is no rig: the capture's cameras come along
    assert len(lab.rig.objects) == 7 and lab.cameras.overlay == "picture"
    words = cases.pump_until_done()
    assert words.startswith("6 of 7 views can be used; camera_02 not used: "), words
    assert lab.cameras.overlay == "mask"
    for camera, view in zip(lab.rig.objects, read_capture(tmp_path / "capture").views, strict=True):
        (shown,) = camera.data.background_images
        assert shown.image[KEY]["name"] == camera.name and bool(shown.image.packed_file)
        assert tuple(shown.image.size) == (160, 120)
        pixels = np.array(shown.image.pixels[:]).reshape(120, 160, 4)[::-1, :, :3]
        print_ = cv2.imread(str(view.image.path), cv2.IMREAD_GRAYSCALE) > 127
        reddish = pixels[..., 0] - pixels[..., 2]
        if camera.name == "camera_02":
            assert np.abs(reddish).max() < 0.1
        else:  # what is print is tinted, what is none stays as it was taken
            assert reddish[print_].mean() > 0.2 > reddish[~print_].mean()
    ops.show_pictures()
    assert lab.cameras.overlay == "picture"
    lab.fit.capture = str(tmp_path / "nowhere")
    assert "nowhere" in cases.refused(ops.show_masks)


def test_masks_leave_out_what_the_panel_says(lab: Any, tmp_path: Path) -> None:
    capture_from_rig(
        read_rig(tmp_path / "workshop"), tmp_path / "shots", FRAME, tmp_path / "capture", base=standing_at(BASE)
    )
    lab.fit.capture, lab.fit.ignore = str(tmp_path / "capture"), str(tmp_path / "arm")
    (tmp_path / "arm").mkdir()
    ops.show_masks()
    words = cases.pump_until_done()
    assert words.startswith(f"{tmp_path / 'arm'}: Leave Out: holds no picture")
    assert cases.addon("session").runner.status.error
    cv2.imwrite(str(tmp_path / "arm" / "camera_04.png"), np.full((120, 160), 255, dtype=np.uint8))
    ops.show_masks()
    cases.pump_until_done()
    tinted = {}
    for camera in lab.rig.objects:
        pixels = np.array(camera.data.background_images[0].image.pixels[:]).reshape(-1, 4)
        tinted[camera.name] = bool((pixels[:, 0] - pixels[:, 2] > 0.2).any())
    assert [name for name, seen in tinted.items() if not seen] == ["camera_04"]


def test_a_fit_is_asked_for_what_the_panel_says_of_photographs(lab: Any, tmp_path: Path) -> None:
    capture_from_rig(
        read_rig(tmp_path / "workshop"), tmp_path / "shots", FRAME, tmp_path / "capture", base=standing_at(BASE)
    )
    lab.fit.capture = str(tmp_path / "capture")
    asked = cases.addon("fit").fit_job(bpy.context).parameters
    assert (asked["mask"], asked["changes"], "ignore" in asked) == ("auto", {}, False)
    lab.fit.mask, lab.fit.ignore, lab.fit.cameras, lab.fit.anchor = "paper", str(tmp_path / "shots"), "exact", "feet"
    asked = cases.addon("fit").fit_job(bpy.context).parameters
    assert (asked["mask"], asked["ignore"]) == ("paper", tmp_path / "shots")
    assert asked["changes"] == {"cameras": "exact", "hold": "feet"}  # as the command line does
    for job in (
        cases.addon("masks").masks_job(bpy.context),
        cases.addon("overlay").compare_job(bpy.context, "outline"),
    ):
        assert (job.parameters["mask"], job.parameters["ignore"]) == ("paper", tmp_path / "shots")
        job.clear()
    lab.fit.anchor = "plate"
    assert "markers" in cases.refused(ops.fit)
    lab.fit.preset = "paper"
    assert cases.addon("fit").camera_changes(bpy.context, read_capture(tmp_path / "capture")) == {}


def test_the_paper_rule_loses_what_is_in_the_shade(lab: Any, tmp_path: Path) -> None:
    lit = [obj for obj in (tmp_path / "shots").glob("*.png")]
    for path in lit:  # photographs: matte struts before blue, dark below the middle
        mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 127
        (tmp_path / "before" / path.name).unlink()
        empty = np.full((*mask.shape, 3), (120, 60, 30), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / "before" / path.name), empty)
        shade = np.where(np.arange(mask.shape[0]) < mask.shape[0] // 2, 210, 90)[:, None, None]
        cv2.imwrite(str(path), np.where(mask[..., None], shade, empty).astype(np.uint8))
    made = tmp_path / "capture"
    capture_from_rig(
        read_rig(tmp_path / "workshop"), tmp_path / "shots", FRAME, made,
        base=standing_at(BASE), background=tmp_path / "before",
    )  # fmt: skip
    lab.fit.capture = str(made)
    shares = {}
    for mask in ("auto", "paper"):
        lab.fit.mask = mask
        ops.show_masks()
        cases.pump_until_done()
        image = lab.rig.objects[0].data.background_images[0].image
        pixels = np.array(image.pixels[:]).reshape(120, 160, 4)[:60, :, :3]  # below the middle
        shares[mask] = float(((pixels[..., 0] - pixels[..., 2]) > 0.15).mean())
    assert shares["auto"] > 0.02 and shares["paper"] < 0.2 * shares["auto"], shares


def test_too_few_views_are_told(extension: str) -> None:
    views = [{"name": f"cam_{i}", "used": i < 5, "figures": "not used: shows nothing"} for i in range(8)]
    words = cases.addon("masks").words_of({"views": views, "needed": 6})
    assert words.startswith("5 of 8 views can be used, and a fit needs 6; cam_5 not used: shows nothing; cam_6 ")
    whole = cases.addon("masks").words_of({"views": views[:5], "needed": 5})
    assert whole == "All 5 views can be used"


def test_the_reasons_of_a_verdict_are_read_in_the_sidebar(lab: Any) -> None:
    touched = "cam_4 stands 2.1 degrees and 3.4 mm from where the rig has it (17 sigma): calibrate its pose again"
    seen = "cam_1 and cam_6 show too few markers of the plate to tell where they are: clear the plate first"
    verdict = Verdict.of([touched], [seen, "strut 3 is torn", "a fourth"], ["a fifth"])
    panel, lines = cases.addon("twin").FRAMETWIN_PT_twin, Lines()
    panel._draw_verdict(None, lines, sidebar(), verdict)
    whole = " ".join(line for line in lines.texts if line)
    assert f"{touched[0].upper()}{touched[1:]}." in whole and f"{seen[0].upper()}{seen[1:]}." in whole
    assert whole.endswith("2 more in twin.json of the run.")
    assert max(len(line) for line in lines.texts) * cases.addon("layouts").CHARACTER < 260


def test_the_panel_leads_from_the_rig_to_the_masks(lab: Any, tmp_path: Path) -> None:
    panel = cases.addon("photographs").FRAMETWIN_PT_photographs

    def drawn() -> Lines:
        lines = Lines()
        owner = SimpleNamespace(layout=lines)
        owner._draw_pictures = lambda *given: panel._draw_pictures(owner, *given)
        owner._draw_masks = lambda *given: panel._draw_masks(owner, *given)
        panel.draw(owner, sidebar())
        return lines

    empty = drawn()
    assert set(empty.buttons) == {"import_rig", "capture_pictures"} and empty.buttons["import_rig"].filepath == ""
    assert "import the rig" in " ".join(empty.texts)
    ops.import_rig(filepath=str(tmp_path / "workshop"))
    lab.pictures.how, lab.fit.capture = "batch", str(tmp_path)
    full = drawn()
    assert set(full.buttons) == {"import_rig", "capture_pictures", "show_masks"}
    assert Path(full.buttons["import_rig"].filepath) == tmp_path / "workshop"  # read again where the plan stands now
