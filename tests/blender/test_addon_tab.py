"""A first-time user's way through the tab, by its operators: each does what the function does that it calls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest

from frametwin.blender.display.adapted import find_adapted
from frametwin.blender.display.highlights import highlighted_struts
from frametwin.blender.display.prints import partly_printed, read_print
from frametwin.blender.display.statistics import statistics_of, worst_struts
from frametwin.blender.display.twins import find_twin, is_twin, show_twin
from frametwin.blender.frames.curves import wireframe_from_curve
from frametwin.blender.frames.described import DESCRIBES
from frametwin.blender.frames.plan_objects import plan_summary
from frametwin.blender.frames.strut_curves import read_attribute, recorded_frame
from frametwin.blender.views.captures import capture_parameters
from frametwin.blender.views.rigs import cameras_from_collection, rig_cameras
from frametwin.capture.capture import read_capture
from frametwin.formats import read_frame, write_frame
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.runs import load_run, read_truth

ops = bpy.ops.frametwin


@pytest.fixture
def tab(extension: str, scene: Any, tmp_path: Path) -> Any:
    """The add-on's settings of the scene, with small pictures and a folder for what is written."""
    cases.addon("session").runner.close()
    settings = scene.frametwin
    settings.render.folder = str(tmp_path / "work")
    settings.cameras.width, settings.cameras.height = 400, 300
    return settings


def test_from_nothing_to_an_inspected_twin(tab: Any, scene: Any, tmp_path: Path) -> None:
    ops.use_millimetres()
    ops.add_frame()
    plan = named_frame("bridge")
    np.testing.assert_array_equal(wireframe_from_curve(tab.plan).control_points, plan.control_points)
    assert (tab.about_plan.struts, tab.about_plan.joints) == (76, 32) and not len(tab.about_plan.problems)
    tab.deform.missing = 2
    ops.sag()
    words = cases.pump_until_done()
    assert "76 of 76 struts printed, 2 not whole" in words
    ops.make_rig()
    assert len(cameras_from_collection(tab.rig)) == 8
    ops.render()
    assert "8 pictures" in cases.pump_until_done()
    capture = read_capture(tab.fit.capture)
    assert len(capture.views) == 8 and capture.truth is not None
    real = read_print(tab.plan, tab.print_object)
    np.testing.assert_array_equal(capture.truth.control_points, real.truth.control_points)
    ops.fit()
    words = cases.pump_until_done()
    assert words.startswith("74 of 76 struts found whole, ") and words.endswith("; 2 missing, 0 uncertain")
    shown = find_twin(tab.twin)
    twin, frame = load_run(Path(tab.twin["frametwin_run"]))
    np.testing.assert_array_equal(shown.frame().control_points, twin.control_points)
    assert not shown.twin.select_get() and bpy.context.view_layer.objects.active == shown.twin
    assert (
        statistics_of(shown.values["error"].values).mean < 0.1 * statistics_of(shown.values["displacement"].values).mean
    )
    assert set(capture_defects(tab.fit.capture)) == set(shown.missing.tolist())

    again = show_twin(twin, frame, truth=read_truth(Path(tab.fit.capture), frame))
    for name, column in again.values.items():
        np.testing.assert_array_equal(shown.values[name].values, column.values)
    for name in ("position", "missing", "displacement_max"):
        np.testing.assert_array_equal(read_attribute(shown.twin.data, name), read_attribute(again.twin.data, name))

    tab.view.quantity = "error"
    assert find_twin(tab.twin).legend.quantity == "error"
    tab.view.low, tab.view.high, tab.view.automatic = 0.01, 0.02, False
    legend = find_twin(tab.twin).legend
    assert (legend.low, legend.high) == (pytest.approx(0.01), pytest.approx(0.02))
    check_selection(tab, shown)
    check_export(tab, tmp_path, twin)
    ops.leave_struts()
    ops.remove_twin()
    assert tab.twin is None and not [c for c in bpy.data.collections if is_twin(c) and c != again.collection]


def test_a_mesh_file_becomes_the_plan(tab: Any, tmp_path: Path) -> None:
    lines = [f"vertex {x} {y} {z}" for x, y, z in ((0, 0, 0), (30, 0, 0), (0, 40, 5))]
    text = "\n".join(["solid a", "facet normal 0 0 0", "outer loop", *lines, "endloop", "endfacet", "endsolid a"])
    (tmp_path / "corner.stl").write_text(text)
    ops.import_frame(filepath=str(tmp_path / "corner.stl"))
    assert (tab.plan.type, tab.plan.name, tab.about_plan.struts) == ("CURVE", "corner", 3)
    assert [obj.name for obj in bpy.context.selected_objects] == ["corner"]
    assert [obj.name for obj in bpy.data.objects if DESCRIBES not in obj] == ["corner"]  # nothing is left of the import


def test_the_view_suits_millimetres_and_shows_the_rig(tab: Any) -> None:
    space = next(area.spaces.active for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    ops.use_millimetres()
    assert space.overlay.grid_scale_unit == pytest.approx(10.0)  # a centimetre
    ops.add_frame()
    before = space.region_3d.view_distance
    ops.make_rig()
    view = space.region_3d
    middle = np.array(view.view_location)
    farthest = max(np.linalg.norm(camera.centre - middle) for camera in cameras_from_collection(tab.rig))
    assert view.view_distance > max(before, farthest)


def capture_defects(capture: str) -> list[int]:
    import json

    return list(json.loads((Path(capture) / "defects.json").read_text())["struts"])


def selected(obj: bpy.types.Object) -> list[int]:
    obj.update_from_editmode()
    return [i for i, spline in enumerate(obj.data.splines) if spline.bezier_points[0].select_control_point]


def check_selection(tab: Any, shown: Any) -> None:
    tab.view.count = 5
    ops.select_struts(kind="worst")
    worst = worst_struts(shown.values["error"].values, 5)
    twin = find_twin(tab.twin).twin
    assert bpy.context.mode == "OBJECT" and highlighted_struts(twin).tolist() == sorted(worst.tolist())
    ops.select_struts(kind="missing")
    assert highlighted_struts(twin).tolist() == shown.missing.tolist() and not twin.select_get()
    assert not len(shown.uncertain) and "none is uncertain" in cases.refused(ops.select_struts, kind="uncertain")
    for wanted in (*worst, worst[0]):
        ops.step_strut(step=1)
        assert highlighted_struts(twin).tolist() == [wanted]
    ops.step_strut(step=-1)
    assert highlighted_struts(twin).tolist() == [worst[-1]]
    ops.leave_struts()
    assert not len(highlighted_struts(twin)) and tab.view.at == -1


def check_export(tab: Any, folder: Path, twin: Any) -> None:
    find_twin(tab.twin).twin.location.x += 0.05  # what is written is what the run holds
    ops.export_twin(filepath=str(folder / "twin.json"))
    np.testing.assert_array_equal(read_frame(folder / "twin.json").control_points, twin.control_points)
    ops.export_twin(filepath=str(folder / "twin.csv"))
    rows = (folder / "twin.csv").read_text().splitlines()
    assert len(rows) == 77 and rows[0].startswith("strut,displacement_mm,")
    assert "name it .json, .obj or .csv" in cases.refused(ops.export_twin, filepath=str(folder / "twin.stl"))


def test_struts_still_to_be_printed_meet_the_twin(tab: Any) -> None:
    ops.add_frame()
    tab.deform.how, tab.deform.batch = "batch", 3
    plan = partly_printed(named_frame("bridge"), "batch", 3)
    assert 0 < plan.printed.sum() < plan.strut_count
    ops.sag()
    cases.pump_until_done()
    ops.make_rig()
    ops.render()
    cases.pump_until_done()
    np.testing.assert_array_equal(read_capture(tab.fit.capture).frame.printed, plan.printed)
    ops.fit()
    cases.pump_until_done()
    ops.adapt()
    assert "struts to print are moved" in cases.pump_until_done()
    adapted = find_adapted(tab.twin)
    assert adapted is not None
    twin, _ = load_run(Path(tab.twin["frametwin_run"]))
    after = recorded_frame(adapted.struts)
    np.testing.assert_allclose(after.control_points, twin.control_points[~plan.printed], atol=1e-9)
    np.testing.assert_array_equal(
        recorded_frame(adapted.struts, plan=True).control_points, plan.control_points[~plan.printed]
    )
    ops.adapt()
    cases.pump_until_done()
    assert len(tab.twin.children) == 1  # in the place of the first answer
    offered = cases.addon("in_view").can_be_chosen
    curves = {obj for obj in bpy.data.objects if obj.type in ("CURVE", "CURVES")}
    assert {obj for obj in curves if offered(obj)} == {tab.plan, tab.print_object} and len(curves) == 4
    path = Path(tab.render.folder) / "left.json"
    ops.export_adapted(filepath=str(path))
    np.testing.assert_array_equal(read_frame(path).control_points, after.control_points)


def test_a_print_bent_by_hand_is_what_is_rendered(tab: Any) -> None:
    ops.add_frame()
    ops.copy_to_bend()
    bent = tab.print_object
    modifier = bent.modifiers.new("bend", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.angle, modifier.deform_axis = "BEND", 0.2, "Z"
    ops.make_rig()
    real = read_print(tab.plan, bent)
    assert np.abs(real.truth.control_points - real.plan.control_points).max() > 1.0
    ops.render()
    cases.pump_until_done()
    capture = read_capture(tab.fit.capture)
    np.testing.assert_array_equal(capture.truth.control_points, real.truth.control_points)
    np.testing.assert_array_equal(capture.frame.control_points, named_frame("bridge").control_points)


def test_a_capture_of_ones_own(tab: Any, small_capture: Path) -> None:
    tab.fit.capture = str(small_capture)
    ops.open_capture()
    capture = read_capture(small_capture)
    np.testing.assert_array_equal(wireframe_from_curve(tab.plan).control_points, capture.frame.control_points)
    for camera, view in zip(cameras_from_collection(tab.rig), capture.views, strict=True):
        np.testing.assert_array_equal(camera.camera_to_world, view.camera.camera_to_world)
    ops.show_pictures()
    shown = [obj.data.background_images[0].image.filepath for obj in tab.rig.objects]
    assert [Path(bpy.path.abspath(path)) for path in shown] == [view.image.path for view in capture.views]
    tab.cameras.opacity, tab.cameras.front = 0.25, True
    drawn = [obj.data.background_images[0] for obj in tab.rig.objects]
    assert {(picture.alpha, picture.display_depth) for picture in drawn} == {(0.25, "FRONT")}
    ops.hide_pictures()
    assert not any(len(obj.data.background_images) for obj in tab.rig.objects)
    names = [obj.name for obj in tab.rig.objects]
    seen = []
    for _ in names:
        ops.step_camera(step=1)
        seen.append(bpy.context.scene.camera.name)
    assert sorted(seen) == names
    ops.picture_beside()  # there is a window also in the background: that of the start-up file
    editors = [area for area in bpy.context.window.screen.areas if area.type == "IMAGE_EDITOR"]
    assert editors[0].spaces.active.image.filepath == shown[0]
    ops.step_camera(step=1)  # and the picture goes along
    assert editors[0].spaces.active.image.filepath == shown[1]
    ops.picture_beside()
    left = [area for area in bpy.context.window.screen.areas if area.type == "IMAGE_EDITOR"]
    assert not [area for area in left if area.spaces.active.image is not None]
    ops.picture_beside()
    (editor,) = [area for area in bpy.context.window.screen.areas if area.type == "IMAGE_EDITOR"]
    assert editor.spaces.active.image.filepath == shown[1]


def test_outline_and_difference_lie_over_the_cameras_views(tab: Any, small_capture: Path) -> None:
    tab.fit.capture = str(small_capture)
    ops.open_capture()
    assert "fit the capture first" in cases.refused(ops.show_pictures, mode="outline")
    ops.fit()
    cases.pump_until_done()
    ops.show_pictures(mode="outline")
    assert "of the print is not in the twin" in cases.pump_until_done()
    before = tab.twin["frametwin_run"]
    for mode in ("outline", "difference", "picture", "difference"):
        ops.show_pictures(mode=mode)  # the rest is at hand
        assert not cases.addon("session").runner.busy and tab.cameras.overlay == mode
        for camera in tab.rig.objects:
            (shown,) = camera.data.background_images
            assert tuple(shown.image.size) == (160, 120)
            if mode != "picture":
                assert (shown.alpha, shown.display_depth, bool(shown.image.packed_file)) == (1.0, "FRONT", True)
                assert shown.image["frametwin_comparison"]["name"] == camera.name
                clear = np.array(shown.image.pixels[:]).reshape(120, 160, 4)[..., 3] == 0.0
                assert 0.5 < clear.mean() < 1.0
    ops.fit()  # of another twin they are made anew
    cases.pump_until_done()
    assert tab.twin["frametwin_run"] != before
    ops.show_pictures(mode="difference")
    cases.pump_until_done()
    ops.picture_beside()
    ops.show_pictures(mode="outline")
    ops.step_camera(step=1)  # the picture beside goes along all the same, and stays a picture
    (editor,) = [area for area in bpy.context.window.screen.areas if area.type == "IMAGE_EDITOR"]
    assert Path(editor.spaces.active.image.filepath).stem == bpy.context.scene.camera.name
    runs = {image["frametwin_comparison"]["run"] for image in bpy.data.images if "frametwin_comparison" in image}
    assert runs == {tab.twin["frametwin_run"]}


def test_the_rig_is_the_librarys(tab: Any) -> None:
    ops.add_frame()
    tab.cameras.kind, tab.cameras.count, tab.cameras.distance = "dome", 5, 1.5
    ops.make_rig()
    name = tab.rig.name
    frame = named_frame("bridge")
    wanted = rig_cameras(frame, "dome", 1.5, count=5, size=(300, 400), elevation_deg=(20.0, 45.0), fov_deg=40.0)
    for found, camera in zip(cameras_from_collection(tab.rig), wanted, strict=True):
        assert found.name == camera.name
        np.testing.assert_allclose(found.camera_to_world, camera.camera_to_world, atol=1e-4)
    ops.make_rig()
    assert tab.rig.name == name and len(bpy.data.cameras) == 5  # replaced, under the same names
    parameters = capture_parameters(read_print(tab.plan, None), cameras_from_collection(tab.rig), "out")
    assert parameters["scene"]["style"] == "mask" and len(parameters["scene"]["cameras"]) == 5


def test_what_is_wrong_with_a_plan_is_said_and_selected(tab: Any, tmp_path: Path) -> None:
    floating = Wireframe.create(
        [[0, 0, 0], [0, 0, 40], [100, 0, 30], [100, 0, 60]], [[0, 1], [2, 3]], grounded=[True, False, False, False]
    )
    write_frame(tmp_path / "loose.json", floating)
    ops.import_frame(filepath=str(tmp_path / "loose.json"))
    (problem,) = tab.about_plan.problems
    assert problem.kind == "floating" and problem.sentence == plan_summary(tab.plan).problems[0].sentence
    ops.select_culprits(kind="floating")
    assert bpy.context.mode == "EDIT_CURVE" and selected(tab.plan) == [1]
    assert "has no problem" in cases.refused(ops.select_culprits, kind="short")
    ops.add_frame()  # from Edit Mode too
    assert bpy.context.mode == "OBJECT" and not len(tab.about_plan.problems)


def test_a_plan_that_is_scaled_to_nothing_is_not_sound(tab: Any) -> None:
    ops.add_frame()
    assert not len(tab.about_plan.problems)
    tab.plan.scale = (1.0, 0.0, 1.0)
    assert "scale: is zero along Y" in cases.refused(ops.check_plan)
    (problem,) = tab.about_plan.problems
    assert "is zero along Y; give the object a size there" in problem.sentence and not tab.about_plan.struts
    assert "is zero along Y" in cases.refused(ops.sag)
    tab.plan.scale = (1.0, 1.0, 1.0)
    ops.check_plan()
    assert not len(tab.about_plan.problems) and tab.about_plan.struts == 76


def test_a_mesh_that_is_selected_becomes_the_plan(tab: Any, link: Any) -> None:
    assert not ops.use_selected.poll()
    mesh = bpy.data.meshes.new("cross")
    mesh.from_pydata([(0, 0, 0), (0, 0, 0.04), (0.03, 0, 0.04)], [(0, 1), (1, 2)], [])
    bpy.context.view_layer.objects.active = link("cross", mesh)
    ops.use_selected()
    assert tab.plan.name == "cross" and tab.about_plan.struts == 2
    mesh.vertices.add(1)
    mesh.vertices[3].co = (0.03, 0, 0.08)
    mesh.edges.add(1)
    mesh.edges[2].vertices = (2, 3)
    ops.check_plan()
    assert tab.about_plan.struts == 3


def in_view() -> set[str]:
    return {obj.name for obj in bpy.context.view_layer.objects if obj.visible_get()}


def test_another_plan_takes_the_place_of_the_one_in_view(tab: Any, tmp_path: Path) -> None:
    ops.add_frame()
    first = tab.plan
    tab.about_plan.frame = "half_bowl"
    ops.add_frame()
    second = tab.plan
    assert second != first and in_view() == {second.name}
    tab.plan = first  # in the list
    assert in_view() == {first.name}
    ops.sag()
    cases.pump_until_done()
    assert in_view() == {tab.print_object.name}
    write_frame(tmp_path / "third.json", named_frame("lattice_tower"))
    ops.import_frame(filepath=str(tmp_path / "third.json"))
    assert in_view() == {tab.plan.name} and tab.print_object is None
    assert {first.name, second.name} < set(bpy.data.objects.keys())


def test_what_is_hidden_comes_back_as_blenders_users_expect(tab: Any, small_capture: Path) -> None:
    tab.fit.capture = str(small_capture)
    ops.open_capture()
    ops.fit()
    cases.pump_until_done()
    cameras = {camera.name for camera in tab.rig.objects}
    assert in_view() - cameras == {obj.name for obj in tab.twin.objects}
    ops.sag()  # the print takes the place of the twin
    cases.pump_until_done()
    assert in_view() - cameras == {tab.print_object.name}
    assert not any(obj.hide_viewport for obj in bpy.data.objects)  # which would grey the outliner and defeat Alt H
    ops.show_hide(name=tab.print_object.name)
    ops.show_hide(name=tab.twin.name, collection=True)
    assert in_view() - cameras == {obj.name for obj in tab.twin.objects}
    ops.show_hide(name=tab.twin.name, collection=True)
    assert in_view() == cameras
    assert "choose another one" in cases.refused(ops.show_hide, name="nothing")
    area = next(area for area in bpy.context.window.screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(area=area, region=area.regions[-1]):
        bpy.ops.object.hide_view_clear()  # Alt H
    assert in_view() >= {tab.plan.name, tab.print_object.name} | {obj.name for obj in tab.twin.objects}


def test_another_plan_hides_nothing_that_is_the_users_own(tab: Any, link: Any) -> None:
    mesh = bpy.data.meshes.new("cross")
    mesh.from_pydata([(0, 0, 0), (0, 0, 0.04), (0.03, 0, 0.04)], [(0, 1), (1, 2)], [])
    bpy.context.view_layer.objects.active = link("cross", mesh)
    ops.use_selected()
    words = take(tab, named_frame("bridge"))
    assert words.endswith("; cross, of your own, stays in view") and in_view() == {"cross", tab.plan.name}
    bpy.context.view_layer.objects.active = bpy.data.objects["cross"]
    ops.use_selected()
    assert in_view() == {"cross"}
    bpy.data.objects["cross"].hide_set(True)
    assert "stays in view" not in take(tab, named_frame("bridge"))


def test_the_cube_of_the_start_up_file_does_not_hide_the_plan(tab: Any, link: Any) -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 0.0))
    mesh = bpy.data.meshes.new("printer")
    mesh.from_pydata([(x, y, z) for x in (-9, 9) for y in (-9, 9) for z in (-9, 0, 9)], [(0, 1), (2, 3)], [])
    link("printer", mesh)
    words = take(tab, named_frame("bridge"))
    assert "Cube, which stood around it, is hidden" in words and in_view() == {"printer", tab.plan.name}
    bpy.data.objects["Cube"].hide_set(False)
    bpy.data.objects["Cube"].location.x = 2.0
    assert "hidden" not in take(tab, named_frame("bridge")) and "Cube" in in_view()


def take(tab: Any, frame: Wireframe) -> str:
    return str(cases.addon("plan").take_frame(bpy.context, frame))


def test_another_plan_hides_the_twin_but_for_the_capture_it_is_of(
    tab: Any, small_capture: Path, rich_frame: Wireframe
) -> None:
    from test_blender_twins import shifted

    frame = read_capture(small_capture).frame
    shown = show_twin(shifted(frame, [0.0, 0.0, 2.0]), frame)
    tab.twin, tab.fit.capture = shown.collection, str(small_capture)
    both = {shown.twin.name}
    ops.open_capture()  # for its cameras
    assert in_view() - {camera.name for camera in tab.rig.objects} == both
    ops.add_frame()
    assert in_view() - {camera.name for camera in tab.rig.objects} == {tab.plan.name}
    tab.twin = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame).collection
    ops.open_capture()
    assert in_view() - {camera.name for camera in tab.rig.objects} == {tab.plan.name}


def test_another_twin_takes_the_place_of_plan_print_and_twin(tab: Any, small_capture: Path) -> None:
    tab.fit.capture = str(small_capture)
    ops.open_capture()
    ops.sag()
    cases.pump_until_done()
    for camera in list(tab.rig.objects):
        bpy.data.objects.remove(camera)
    runs = []
    for _ in range(2):
        ops.fit()
        cases.pump_until_done()
        runs.append(tab.twin)
        assert in_view() == {obj.name for obj in tab.twin.objects}
    tab.twin = runs[0]  # in the list
    assert in_view() == {obj.name for obj in runs[0].objects}
    tab.plan.hide_set(False)
    ops.import_run(directory=find_twin(runs[1]).collection["frametwin_run"])
    assert tab.twin not in runs and in_view() == {obj.name for obj in tab.twin.objects}
    tab.view.quantity, tab.view.automatic, tab.view.low, tab.view.high = "radius", False, 0.5, 1.5
    ops.fit()
    cases.pump_until_done()
    legend = find_twin(tab.twin).legend
    assert (legend.quantity, legend.low, legend.high) == ("radius", 0.5, 1.5)
    ops.add_frame()
    assert in_view() == {tab.plan.name}
    ops.select_struts(kind="worst")
    assert find_twin(tab.twin).twin.name in in_view() and bpy.context.mode == "OBJECT"


def test_two_scenes_have_settings_of_their_own(tab: Any, scene: Any) -> None:
    ops.add_frame()
    other = bpy.data.scenes.new("other")
    assert other.frametwin.plan is None
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        assert not ops.make_rig.poll()
    tab.plan.name = "renamed"
    assert ops.make_rig.poll()
    bpy.data.objects.remove(tab.plan)  # the user deletes it
    assert tab.plan is None and not ops.make_rig.poll() and not ops.sag.poll()


def test_everything_survives_saving_and_opening(tab: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    from test_blender_twins import shifted

    shown = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame)
    tab.twin = shown.collection
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    settings = bpy.context.scene.frametwin
    assert settings.twin.name == "hexagon twin" and find_twin(settings.twin).missing.tolist() == [3]
    settings.view.quantity = "confidence"
    assert find_twin(settings.twin).legend.quantity == "confidence"
    settings.view.quantity = "error"
    assert "no truth.json" in cases.addon("session").last_words
    assert find_twin(settings.twin).legend.quantity == "confidence"


def test_a_twin_without_truth_takes_the_place_of_one_with(tab: Any, small_capture: Path) -> None:
    tab.fit.capture = str(small_capture)
    ops.fit()
    cases.pump_until_done()
    tab.view.quantity = "error"
    ops.step_strut(step=1)
    assert tab.view.at_words
    (small_capture / "truth.json").unlink()
    ops.fit()
    assert "struts found" in cases.pump_until_done()
    assert tab.view.quantity == "displacement" and find_twin(tab.twin).legend.quantity == "displacement"
    assert tab.view.at == -1 and not tab.view.at_words
    assert len([found for found in bpy.data.collections if is_twin(found)]) == 2


def test_a_linked_twin_can_be_looked_at(tab: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    from test_blender_twins import shifted

    name = show_twin(shifted(rich_frame, [0.0, 0.0, 2.0]), rich_frame).collection.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.collections = [name]
    linked, scene = bpy.data.collections[name], bpy.context.scene
    scene.collection.children.link(linked)
    scene.frametwin.twin = linked
    scene.frametwin.view.quantity = "confidence"
    assert "make it local" in cases.refused(ops.select_struts, kind="worst")
    assert "make it local" in cases.refused(ops.step_strut, step=1)
    ops.leave_struts()
    ops.export_twin(filepath=str(tmp_path / "twin.csv"))
