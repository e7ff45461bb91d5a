"""The rig follows its distance, whether the panel sets it or the arrow in the view."""

from __future__ import annotations

from typing import Any

import bpy
import extension_cases as cases
import numpy as np
import pytest

from frametwin.blender.views.rigs import cameras_from_collection, replace_rig
from frametwin.cameras.rigs import ring_rig
from frametwin.geometry.parametric import named_frame

ops = bpy.ops.frametwin


@pytest.fixture
def tab(extension: str, scene: Any) -> Any:
    """The add-on's settings of the scene, in millimetres, with a plan and a rig about it."""
    cases.addon("session").runner.close()
    settings = scene.frametwin
    ops.use_millimetres()
    ops.add_frame()
    settings.cameras.width, settings.cameras.height = 400, 300
    ops.make_rig()
    return settings


def poses(tab: Any) -> np.ndarray:
    return np.array([camera.camera_to_world for camera in cameras_from_collection(tab.rig)])


@pytest.mark.parametrize("kind", ["ring", "dome"])
@pytest.mark.parametrize("distance", [0.75, 2.5, 20.0])
def test_the_rig_stands_where_it_would_have_been_made(tab: Any, kind: str, distance: float) -> None:
    tab.cameras.kind = kind
    ops.make_rig()
    tab.cameras.distance = 3.0
    tab.cameras.distance = distance
    followed = poses(tab)
    ends = [obj.data.clip_end for obj in tab.rig.objects]
    ops.make_rig()
    np.testing.assert_allclose(followed, poses(tab), rtol=0, atol=1e-6)
    corners = np.array(named_frame("bridge").control_points).reshape(-1, 3)
    for camera, end in zip(cameras_from_collection(tab.rig), ends, strict=True):
        assert camera.project(corners)[1].max() < end  # all of the frame is still drawn


def test_a_camera_that_was_moved_by_hand_goes_on_from_there(tab: Any) -> None:
    obj = tab.rig.objects[2]
    before = poses(tab)[2]
    obj.location.z += 50.0
    tab.cameras.distance = 2.0
    depth = float(obj["frametwin_depth"])
    wanted = before[:3, 3] + [0.0, 0.0, 50.0] - depth * before[:3, 2]  # backwards, as far again as it stood
    np.testing.assert_allclose(poses(tab)[2][:3, 3], wanted, atol=1e-3)


def test_calibrated_cameras_stay_where_they_are(tab: Any, scene: Any) -> None:
    tab.rig = replace_rig(tab.rig, ring_rig(named_frame("bridge"), 3, size=(300, 400)), scene)
    before = poses(tab)
    tab.cameras.distance = 4.0
    np.testing.assert_array_equal(poses(tab), before)
    bpy.context.view_layer.objects.active = tab.rig.objects[0]
    tab.rig.objects[0].select_set(True)
    assert cases.addon("rig_gizmo").camera_with_arrow(bpy.context) is None


def test_the_arrow_stands_at_a_camera_that_is_selected_and_sets_the_distance(tab: Any) -> None:
    gizmo = cases.addon("rig_gizmo")
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = tab.plan
    assert gizmo.camera_with_arrow(bpy.context) is None
    tab.rig.objects[3].select_set(True)
    assert gizmo.camera_with_arrow(bpy.context) == tab.rig.objects[3]
    bpy.context.view_layer.update()
    matrix, reach = gizmo.handle_of(tab.rig.objects[3], bpy.context.scene)
    drawn = matrix[:3, 3] + gizmo._offset() * matrix[:3, 2]  # as Blender draws it
    np.testing.assert_allclose(drawn, np.array(tab.rig.objects[3].matrix_world)[:3, 3], rtol=1e-5)
    gizmo._set_offset(1.5 * reach)
    assert tab.cameras.distance == pytest.approx(1.5)
    bpy.context.view_layer.update()
    moved = np.array(tab.rig.objects[3].matrix_world)[:3, 3]
    np.testing.assert_allclose(moved, matrix[:3, 3] + 1.5 * reach * matrix[:3, 2], rtol=1e-4)
    gizmo._set_offset(-5.0)
    assert tab.cameras.distance == 0.5  # the least that the panel allows
