"""Frames as curve objects and back: untouched, bent by hand, by modifiers and shape keys, and cut about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from frametwin.blender.frames.curves import strut_numbers, update_curve, wireframe_from_curve, wireframe_to_curve
from frametwin.blender.frames.joints import Reading
from frametwin.blender.frames.plans import plan_and_deformed, plan_from_object
from frametwin.blender.scene.units import mm_per_unit
from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

FIELDS = ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch")
FINE = 1e-4  # mm


def assert_identical(found: Wireframe, wanted: Wireframe) -> None:
    """The same bits everywhere."""
    assert found.name == wanted.name
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found, field), getattr(wanted, field), err_msg=field)


def assert_moved(found: Wireframe, wanted: Wireframe, matrix: np.ndarray, tolerance: float = FINE) -> None:
    """The same graph and properties, every control point moved by the matrix (mm); loose vertices aside."""
    for field in ("edges", "printed", "grounded", "batch"):
        np.testing.assert_array_equal(getattr(found, field), getattr(wanted, field), err_msg=field)
    moved = wanted.control_points @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(found.control_points, moved, rtol=0, atol=tolerance)
    np.testing.assert_allclose(found.radius, wanted.radius, rtol=1e-6)


def edit(obj: bpy.types.Object) -> None:
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")


def affine() -> np.ndarray:
    """A general affine map: stretch, shear, turn and shift; lengths in mm."""
    matrix = np.array(Matrix.Rotation(0.4, 4, "X") @ Matrix.Rotation(0.3, 4, "Z"))
    matrix[:3, :3] = matrix[:3, :3] @ np.array([[1.1, 0.2, 0.0], [0.0, 0.9, -0.1], [0.05, 0.0, 1.2]])
    matrix[:3, 3] = [4.0, -3.0, 8.0]
    return matrix


def in_units(matrix: np.ndarray, scene: bpy.types.Scene) -> Matrix:
    matrix = matrix.copy()
    matrix[:3, 3] /= mm_per_unit(scene)
    return Matrix(matrix.tolist())


# Untouched


@pytest.mark.parametrize("scale", [1.0, 0.001, 0.0254])
def test_untouched_frames_come_back_with_the_same_bits(scene: Any, rich_frame: Wireframe, scale: float) -> None:
    scene.unit_settings.scale_length = scale
    obj = wireframe_to_curve(rich_frame)
    assert_identical(wireframe_from_curve(obj), rich_frame)
    assert_identical(wireframe_from_curve(obj, evaluated=False), rich_frame)
    assert_identical(plan_from_object(obj), rich_frame)
    plan, deformed = plan_and_deformed(obj)
    assert_identical(plan, rich_frame)
    assert_identical(deformed, rich_frame)


def test_the_object_is_drawn_true_to_scale(scene: Any, rich_frame: Wireframe) -> None:
    scene.unit_settings.scale_length = 0.01
    collection = bpy.data.collections.new("plans")
    scene.collection.children.link(collection)
    obj = wireframe_to_curve(rich_frame, name="plan", collection=collection)
    assert (obj.name, obj.users_collection) == ("plan", (collection,))
    curve = obj.data
    assert len(curve.splines) == rich_frame.strut_count
    for spline, curve_mm, radius in zip(curve.splines, rich_frame.control_points, rich_frame.radius, strict=True):
        first, last = spline.bezier_points
        found = [first.co, first.handle_right, last.handle_left, last.co]
        np.testing.assert_array_equal(np.array(found, dtype=np.float32), (curve_mm / 10.0).astype(np.float32))
        assert {first.handle_left_type, first.handle_right_type, last.handle_left_type} == {"FREE"}
        assert 10.0 * curve.bevel_depth * last.radius == pytest.approx(radius, rel=1e-6)
    bpy.context.view_layer.update()
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    surface = 10.0 * np.array([vertex.co for vertex in mesh.vertices])
    line = bezier.evaluate(rich_frame.control_points, np.linspace(0.0, 1.0, 161))  # (E, 161, 3)
    away = np.linalg.norm(surface[::7, None, None] - line, axis=-1).min(axis=-1) - rich_frame.radius
    assert np.all(np.abs(away).min(axis=-1) < 0.05)  # every point of the surface is a radius from some strut


def test_a_frame_of_4164_struts_goes_in_and_back_to_the_bit(scene: Any, shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeLounge_wireframe.txt")
    assert frame.strut_count == 4164
    obj = wireframe_to_curve(frame)
    assert_identical(wireframe_from_curve(obj), frame)


def test_a_saved_and_opened_file_keeps_everything(scene: Any, rich_frame: Wireframe, tmp_path: Path) -> None:
    wireframe_to_curve(rich_frame, name="plan")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert_identical(wireframe_from_curve(bpy.data.objects["plan"]), rich_frame)


def test_without_the_record_the_splines_alone_are_the_frame(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    del obj.data["frametwin"]
    found = wireframe_from_curve(obj)
    np.testing.assert_allclose(found.control_points, rich_frame.control_points, rtol=0, atol=FINE)
    np.testing.assert_allclose(found.radius, rich_frame.radius, rtol=1e-6)
    assert found.vertex_count == rich_frame.vertex_count - 1  # the loose vertex is not drawn
    assert found.name == obj.name


def test_a_record_of_a_later_version_is_refused(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data["frametwin"]["version"] = 2
    with pytest.raises(InputError, match="version 2, 1 is known here; update FrameTwin"):
        wireframe_from_curve(obj)


def test_a_damaged_record_counts_for_nothing(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data["frametwin"]["printed"] = [1, 0]
    found = wireframe_from_curve(obj)
    assert found.strut_count == rich_frame.strut_count
    assert found.printed.all()


# Moved, scaled, bent by hand


def test_the_place_and_size_of_the_object_count(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    matrix = np.array(Matrix.Rotation(0.7, 4, "Y")) * 1.5
    matrix[:, 3] = [12.0, -5.0, 20.0, 1.0]
    obj.matrix_world = in_units(matrix, scene)
    found = wireframe_from_curve(obj)
    wanted = rich_frame.transformed(matrix)
    np.testing.assert_allclose(found.vertices, wanted.vertices, rtol=0, atol=FINE)  # the loose one as well
    np.testing.assert_allclose(found.control_points, wanted.control_points, rtol=0, atol=FINE)
    np.testing.assert_allclose(found.radius, wanted.radius, rtol=1e-6)


def test_parents_and_constraints_count(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj, parent, target = wireframe_to_curve(rich_frame), link("parent", None), link("target", None)
    obj.parent = parent
    parent.location = (0.01, 0.0, 0.0)
    target.location = (0.0, 0.0, 0.03)
    constraint = obj.constraints.new("COPY_LOCATION")
    constraint.target, constraint.use_x, constraint.use_y = target, False, False
    found = wireframe_from_curve(obj)
    np.testing.assert_allclose(found.vertices - rich_frame.vertices, [[10.0, 0.0, 30.0]] * 13, rtol=0, atol=FINE)


def test_what_is_bent_in_edit_mode_is_read_there_and_after(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    edit(obj)
    bpy.ops.curve.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.0, 0.0, 0.004))
    bpy.ops.transform.resize(value=(1.2, 1.2, 1.2), center_override=(0.0, 0.0, 0.0))
    matrix = np.diag([1.2, 1.2, 1.2, 1.0])
    matrix[2, 3] = 1.2 * 4.0
    assert_moved(wireframe_from_curve(obj), rich_frame, matrix)
    assert bpy.context.mode == "EDIT_CURVE"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_moved(wireframe_from_curve(obj), rich_frame, matrix)


def test_one_strut_bent_leaves_the_digits_of_the_others(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data.splines[4].bezier_points[0].handle_right.x += 0.005
    found = wireframe_from_curve(obj)
    difference = found.control_points - rich_frame.control_points
    assert difference[4, 1, 0] == pytest.approx(5.0, abs=FINE)
    difference[4, 1, 0] = 0.0
    assert not difference.any()


def test_radii_changed_by_hand_are_read(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    for point in obj.data.splines[3].bezier_points:
        point.radius *= 2.0
    obj.data.splines[5].bezier_points[0].radius *= 3.0  # of one end only: the strut gets the mean
    wanted = rich_frame.radius * np.where(np.arange(18) == 3, 2.0, np.where(np.arange(18) == 5, 2.0, 1.0))
    found = wireframe_from_curve(obj).radius
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    np.testing.assert_array_equal(np.delete(found, [3, 5]), np.delete(rich_frame.radius, [3, 5]))
    obj.data.bevel_depth *= 0.5
    np.testing.assert_allclose(wireframe_from_curve(obj).radius, 0.5 * wanted, rtol=1e-6)
    obj.data.bevel_depth = 0.0  # the bevel turned off: thin lines on screen, but the struts are as thick as before
    np.testing.assert_allclose(wireframe_from_curve(obj).radius, wanted, rtol=1e-6)


# Modifiers, shape keys, parents that deform


def lattice(link: Callable[..., Any], matrix: np.ndarray, scene: bpy.types.Scene) -> bpy.types.Object:
    """A lattice of 0.4 units whose points are moved by the map (mm): between them Blender interpolates linearly."""
    data = bpy.data.lattices.new("lattice")
    data.interpolation_type_u = data.interpolation_type_v = data.interpolation_type_w = "KEY_LINEAR"
    obj = link("lattice", data)
    obj.scale = (0.4, 0.4, 0.4)
    world = Matrix.Diagonal((0.4, 0.4, 0.4, 1.0))
    for point in data.points:
        point.co_deform = world.inverted() @ in_units(matrix, scene) @ world @ point.co
    return obj


@pytest.mark.parametrize("on_spline", [True, False])
def test_a_lattice_moves_every_strut_by_its_map(
    scene: Any, link: Callable[..., Any], rich_frame: Wireframe, on_spline: bool
) -> None:
    obj = wireframe_to_curve(rich_frame)
    modifier = obj.modifiers.new("lattice", "LATTICE")
    modifier.object, modifier.use_apply_on_spline = lattice(link, affine(), scene), on_spline
    plan, deformed = plan_and_deformed(obj)
    assert_identical(plan, rich_frame)
    assert_moved(deformed, rich_frame, affine(), 2e-4)
    assert_moved(wireframe_from_curve(obj), rich_frame, affine(), 2e-4)
    assert len(bpy.data.objects) == 2 and len(bpy.data.curves) == 1  # nothing is left behind
    modifier.show_viewport = False
    assert_identical(wireframe_from_curve(obj), rich_frame)


def test_a_lattice_as_parent_deforms_too(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.parent = lattice(link, affine(), scene)
    obj.parent_type = "LATTICE"
    obj.matrix_parent_inverse = obj.parent.matrix_basis.inverted()
    assert_moved(wireframe_from_curve(obj), rich_frame, affine(), 2e-4)


def test_a_bend_of_the_line_is_refitted_with_cubics(scene: Any, rich_frame: Wireframe) -> None:
    """Without *Apply on Spline* the drawn line is bent: its points, not the control points, follow the modifier."""
    obj = wireframe_to_curve(rich_frame)
    modifier = obj.modifiers.new("taper", "SIMPLE_DEFORM")
    modifier.deform_method, modifier.deform_axis, modifier.factor = "TAPER", "Z", 0.3
    found = bezier.evaluate(wireframe_from_curve(obj).control_points, np.linspace(0.0, 1.0, 17))
    before = bezier.evaluate(rich_frame.control_points, np.linspace(0.0, 1.0, 17))
    low, high = before[..., 2].min(), before[..., 2].max()
    wide = np.abs(before[..., :2]).min(axis=-1) > 2.0
    slope = found[wide][:, :2] / before[wide][:, :2]  # a taper scales x and y by a linear function of z
    height = (before[wide][:, 2] - low) / (high - low)
    line = np.polyfit(height, slope.mean(axis=-1), 1)
    assert abs(line[0]) > 0.05
    np.testing.assert_allclose(slope.mean(axis=-1), np.polyval(line, height), atol=0.01)
    np.testing.assert_allclose(found[..., 2], before[..., 2], atol=0.05)


def test_a_hook_moves_what_it_holds(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj, hook = wireframe_to_curve(rich_frame), link("hook", None)
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set(list(range(6 * rich_frame.strut_count)))
    modifier.matrix_inverse = Matrix.Identity(4)
    hook.matrix_world = in_units(affine(), scene)
    # A hook's object has no shear: of the affine map Blender keeps rotation, scale and place.
    bpy.context.view_layer.update()
    matrix = np.array(hook.matrix_world, dtype=np.float64)
    matrix[:3, 3] *= mm_per_unit(scene)
    assert_moved(wireframe_from_curve(obj), rich_frame, matrix)
    assert_identical(wireframe_from_curve(obj, evaluated=False), rich_frame)


def test_a_hook_on_some_ends_of_a_joint_is_refused(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj, hook = wireframe_to_curve(rich_frame), link("hook", None)
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set([0, 1, 2])  # the first end of the first strut with its handles
    hook.location = (0.0, 0.0, 0.01)
    with pytest.raises(InputError, match=r"modifiers: struts 0 and 17 are 10 mm apart where they meet, though"):
        wireframe_from_curve(obj)


@pytest.mark.parametrize("on_spline", [True, False])
@pytest.mark.parametrize("as_parent", [True, False])
def test_an_armature_turns_what_its_bone_holds(
    scene: Any, link: Callable[..., Any], rich_frame: Wireframe, on_spline: bool, as_parent: bool
) -> None:
    obj, data = wireframe_to_curve(rich_frame), bpy.data.armatures.new("bones")
    rig = link("bones", data)
    edit(rig)
    bone = data.edit_bones.new("bone")
    bone.tail, bone.envelope_distance = (0.0, 0.0, 0.05), 10.0
    bpy.ops.object.mode_set(mode="OBJECT")
    if as_parent:
        obj.parent, obj.parent_type = rig, "ARMATURE"
        if on_spline:
            obj.modifiers.new("nothing", "WAVE").use_apply_on_spline = True
            obj.modifiers["nothing"].height = 0.0
    else:
        modifier = obj.modifiers.new("armature", "ARMATURE")
        modifier.object, modifier.use_bone_envelopes, modifier.use_apply_on_spline = rig, True, on_spline
    rig.pose.bones["bone"].matrix = Matrix.Rotation(0.6, 4, "X") @ data.bones["bone"].matrix_local
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, np.cos(0.6), -np.sin(0.6)], [0, np.sin(0.6), np.cos(0.6)]]
    assert_moved(wireframe_from_curve(obj), rich_frame, turn, 2e-4)


def test_shape_keys_deform_the_basis(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="sagged")
    for point in key.data:
        for name in ("co", "handle_left", "handle_right"):
            setattr(point, name, Vector(getattr(point, name)) + Vector((0.0, 0.0, -0.02)))
    key.value = 0.25
    down = np.eye(4)
    down[2, 3] = -5.0
    plan, deformed = plan_and_deformed(obj)
    assert_identical(plan, rich_frame)
    assert_moved(deformed, rich_frame, down)
    obj.active_shape_key_index = 1  # editing a key shows it in the splines; the plan is the basis all the same
    edit(obj)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_moved(wireframe_from_curve(obj), rich_frame, down)
    assert_identical(wireframe_from_curve(obj, evaluated=False), rich_frame)


def test_modifiers_are_read_in_edit_mode_as_well(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    modifier = obj.modifiers.new("lattice", "LATTICE")
    modifier.object, modifier.use_apply_on_spline = lattice(link, affine(), scene), True
    modifier.show_in_editmode = False
    edit(obj)
    bpy.ops.curve.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.002, 0.0, 0.0))
    shift = np.eye(4)
    shift[0, 3] = 2.0
    assert_moved(wireframe_from_curve(obj), rich_frame, affine() @ shift, 2e-4)


def test_modifiers_that_add_struts_are_refused(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.modifiers.new("copies", "ARRAY")
    with pytest.raises(InputError, match=r"object hexagon: modifiers: they make \d+ points of the \d+ on its struts"):
        wireframe_from_curve(obj)
    assert len(bpy.data.objects) == 1 and len(bpy.data.curves) == 1


def test_a_disabled_object_is_named(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.hide_viewport = True
    with pytest.raises(InputError, match="object hexagon: visibility: scene Scene does not evaluate it"):
        wireframe_from_curve(obj)
    assert_identical(wireframe_from_curve(obj, evaluated=False), rich_frame)


# Cut about by the user


def test_deleted_struts_are_gone_and_the_others_keep_what_is_known(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    for index in (12, 3):
        obj.data.splines.remove(obj.data.splines[index])
    keep = np.ones(18, dtype=bool)
    keep[[3, 12]] = False
    np.testing.assert_array_equal(strut_numbers(obj), np.flatnonzero(keep))
    wanted, _ = rich_frame.subset(keep)
    found = wireframe_from_curve(obj)
    np.testing.assert_array_equal(found.control_points, wanted.control_points)
    for field in ("radius", "printed", "batch"):
        np.testing.assert_array_equal(getattr(found, field), getattr(wanted, field), err_msg=field)
    np.testing.assert_array_equal(found.grounded[found.edges], wanted.grounded[wanted.edges])
    np.testing.assert_array_equal(found.vertices[found.edges], wanted.vertices[wanted.edges])


def test_one_strut_deleted_and_another_drawn_is_not_mistaken(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data.splines.remove(obj.data.splines[2])
    spline = obj.data.splines.new("BEZIER")
    spline.bezier_points.add(1)
    for point, end in zip(spline.bezier_points, rich_frame.vertices[[0, 3]] / 1000.0, strict=True):
        point.co, point.handle_left_type, point.handle_right_type, point.radius = end, "VECTOR", "VECTOR", 1.0
    bpy.context.view_layer.update()  # which places the handles
    found = wireframe_from_curve(obj)
    others = np.delete(np.arange(18), 2)
    np.testing.assert_array_equal(strut_numbers(obj), [*others, -1])
    np.testing.assert_array_equal(found.printed, [*rich_frame.printed[others], True])
    np.testing.assert_array_equal(found.control_points[:17], rich_frame.control_points[others])
    np.testing.assert_allclose(found.control_points[17, 0], rich_frame.vertices[0], rtol=0, atol=FINE)


def test_struts_that_share_no_joint_are_not_mistaken_either(scene: Any) -> None:
    places = np.arange(24.0).reshape(8, 3) * [1.0, 7.0, 2.0]
    frame = Wireframe.create(places, [[0, 1], [2, 3], [4, 5], [6, 7]], printed=[False, True, False, True])
    obj = wireframe_to_curve(frame)
    obj.data.splines.remove(obj.data.splines[0])
    spline = obj.data.splines.new("BEZIER")
    spline.bezier_points.add(1)
    spline.bezier_points[1].co = (0.1, 0.1, 0.1)
    for point in spline.bezier_points:
        point.radius = 1.0
    np.testing.assert_array_equal(strut_numbers(obj), [1, 2, 3, -1])
    np.testing.assert_array_equal(wireframe_from_curve(obj).printed, [True, False, True, True])


def test_a_frame_bent_and_cut_at_once_is_refused_rather_than_mistaken(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data.splines.remove(obj.data.splines[2])
    obj.data.splines.new("BEZIER").bezier_points.add(1)
    obj.data.transform(Matrix.Scale(1.01, 4))
    with pytest.raises(InputError, match="apart where they meet; move the ends together in Edit Mode, or read"):
        wireframe_from_curve(obj)
    np.testing.assert_array_equal(strut_numbers(obj), np.full(18, -1))


def test_ends_pulled_apart_are_told_or_opened(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    obj.data.splines[0].bezier_points[1].co.x += 0.002
    with pytest.raises(InputError, match=r"object hexagon: joints: struts 0 and \d+ are 2 mm apart where they meet"):
        wireframe_from_curve(obj)
    found = wireframe_from_curve(obj, reading=Reading(split=True))
    assert found.vertex_count == 13  # twelve joints and the opened one; the loose vertex is not drawn
    np.testing.assert_array_equal(found.batch[1:], rich_frame.batch[1:])
    wide = wireframe_from_curve(obj, reading=Reading(weld=2.5))
    np.testing.assert_array_equal(wide.edges, rich_frame.edges)


def test_struts_of_a_part_keep_the_numbers_of_the_whole(scene: Any, rich_frame: Wireframe) -> None:
    mask = rich_frame.printed & (rich_frame.batch != 2)
    part, _ = rich_frame.subset(mask)
    obj = wireframe_to_curve(part, strut=np.flatnonzero(mask))
    np.testing.assert_array_equal(strut_numbers(obj), np.flatnonzero(mask))
    obj.data.splines.remove(obj.data.splines[0])
    np.testing.assert_array_equal(strut_numbers(obj), np.flatnonzero(mask)[1:])


# Animation of a fit


def test_updated_curves_are_read_back(scene: Any, rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    moved = rich_frame.transformed(affine())
    update_curve(obj, moved.control_points)
    assert_moved(wireframe_from_curve(obj), rich_frame, affine(), 0.0)
    radius = np.linspace(0.5, 2.0, 18)
    update_curve(obj, rich_frame.control_points, radius=radius)
    np.testing.assert_array_equal(wireframe_from_curve(obj).radius, radius)
    assert_moved(wireframe_from_curve(obj), rich_frame.replace(radius=radius), np.eye(4), 0.0)


@pytest.mark.parametrize("parented", [True, False])
def test_updates_go_to_the_world_wherever_the_object_is(
    scene: Any, link: Callable[..., Any], rich_frame: Wireframe, parented: bool
) -> None:
    obj, parent = wireframe_to_curve(rich_frame), link("parent", None)
    obj.location, obj.scale = (0.1, 0.0, -0.2), (2.0, 2.0, 2.0)
    parent.location, parent.rotation_euler = (0.0, 0.3, 0.0), (0.5, 0.0, 0.0)
    if parented:
        obj.parent = parent
    update_curve(obj, rich_frame.control_points, radius=rich_frame.radius)
    assert_moved(wireframe_from_curve(obj), rich_frame, np.eye(4))


def test_updates_of_what_is_no_frame_are_refused(scene: Any, link: Callable[..., Any], rich_frame: Wireframe) -> None:
    obj = wireframe_to_curve(rich_frame)
    with pytest.raises(InputError, match="object hexagon: control_points"):
        update_curve(obj, rich_frame.control_points[:5])
    obj.data.splines.remove(obj.data.splines[0])
    with pytest.raises(InputError, match="object hexagon: splines: are not those of a frame"):
        update_curve(obj, rich_frame.control_points)
    with pytest.raises(InputError, match="object light: type"):
        update_curve(link("light", bpy.data.lights.new("light", "POINT")), rich_frame.control_points)
    keyed = wireframe_to_curve(rich_frame)
    keyed.shape_key_add(name="Basis")
    with pytest.raises(InputError, match="shape keys"):
        update_curve(keyed, rich_frame.control_points)
