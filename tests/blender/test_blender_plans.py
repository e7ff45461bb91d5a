"""Plans out of meshes and curves that users draw, and out of their .blend files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from frametwin.blender.frames.curves import wireframe_to_curve
from frametwin.blender.frames.joints import Reading
from frametwin.blender.frames.mesh_files import read_mesh_file
from frametwin.blender.frames.plans import plan_and_deformed, plan_from_object, read_blend
from frametwin.blender.frames.welding import weld
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

Link = Callable[[str, Any], bpy.types.Object]
FINE = 1e-4  # mm

CUBE = [(x, y, z) for z in (0.0, 0.1) for y in (0.0, 0.1) for x in (0.0, 0.1)]
CUBE_EDGES = [(a, b) for a in range(8) for b in range(a) if sum(np.not_equal(CUBE[a], CUBE[b])) == 1]


def mesh_object(link: Link, vertices: Any = CUBE, edges: Any = CUBE_EDGES, faces: Any = ()) -> bpy.types.Object:
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(vertices, edges, faces)
    return link("drawing", mesh)


def curve_object(link: Link, *splines: tuple[str, list[tuple[float, float, float]], bool]) -> bpy.types.Object:
    """A curve with splines of the given kind through the points, Bezier ones with automatic handles."""
    curve = bpy.data.curves.new("curve", "CURVE")
    curve.dimensions = "3D"
    for kind, points, cyclic in splines:
        spline = curve.splines.new(kind)
        spline.use_cyclic_u = cyclic
        made = spline.bezier_points if kind == "BEZIER" else spline.points
        made.add(len(points) - 1)
        for point, place in zip(made, points, strict=True):
            point.co = place if kind == "BEZIER" else (*place, 1.0)
            if kind == "BEZIER":
                point.handle_left_type = point.handle_right_type = "AUTO"
    return link("drawing", curve)


# Mesh files


STL = """solid corner
facet normal 0 0 0
outer loop
vertex 0 0 0
vertex 30 0 0
vertex 0 40 5
endloop
endfacet
endsolid corner
"""
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
30 0 0
0 40 5
3 0 1 2
"""


@pytest.mark.parametrize(("name", "text"), [("corner.stl", STL), ("corner.PLY", PLY)])
@pytest.mark.parametrize("unit", [1.0, 0.001])
def test_mesh_files_are_in_millimetres_and_leave_nothing_behind(
    scene: Any, link: Link, tmp_path: Path, name: str, text: str, unit: float
) -> None:
    scene.unit_settings.scale_length = unit
    drawn = mesh_object(link)
    bpy.context.view_layer.objects.active = drawn
    (tmp_path / name).write_text(text)
    before = len(bpy.data.objects), len(bpy.data.meshes)
    frame = read_mesh_file(tmp_path / name, scene)
    assert frame.name == "corner" and frame.strut_count == 3
    np.testing.assert_allclose(frame.bounds, [[0.0, 0.0, 0.0], [30.0, 40.0, 5.0]], atol=FINE)
    lengths = np.linalg.norm(np.diff(frame.vertices[frame.edges], axis=1), axis=2).ravel()
    np.testing.assert_allclose(sorted(lengths), [30.0, np.hypot(40.0, 5.0), np.sqrt(900.0 + 1625.0)], atol=FINE)
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before
    assert bpy.context.view_layer.objects.active == drawn


@pytest.mark.parametrize(("name", "text"), [("cut.stl", "x" * 50), ("cut.ply", PLY[:60]), ("none.ply", "")])
def test_mesh_files_that_are_damaged(scene: Any, tmp_path: Path, name: str, text: str) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_mesh_file(tmp_path / name)
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=rf"{name}: file: (Blender cannot read it|holds no edges)"):
        read_mesh_file(tmp_path / name)
    assert not bpy.data.objects and not bpy.data.meshes


# Scale


@pytest.mark.parametrize("kind", ["mesh", "curve", "frame"])
def test_what_is_scaled_to_nothing_is_no_plan(scene: Any, link: Link, kind: str) -> None:
    obj = {
        "mesh": lambda: mesh_object(link),
        "curve": lambda: curve_object(link, ("POLY", CUBE, False)),
        "frame": lambda: wireframe_to_curve(Wireframe.create(1000.0 * np.array(CUBE), CUBE_EDGES)),
    }[kind]()
    obj.scale = (1.0, 1.0, 0.0)
    with pytest.raises(InputError, match=f"object {obj.name}: scale: is zero along Z; give the object a size there"):
        plan_from_object(obj)
    obj.scale = (0.0, -1.0, 0.0)
    with pytest.raises(InputError, match="scale: is zero along X, Z; "):
        plan_and_deformed(obj)
    obj.scale = (1e-3, -1e-3, 2e-3)
    assert plan_from_object(obj).strut_count
    parent = link("parent", None)
    parent.scale, obj.rotation_euler, obj.parent = (0.0, 1.0, 1.0), (0.4, 0.5, 0.6), parent
    with pytest.raises(InputError, match="scale: that of its parents makes it flat; "):
        plan_from_object(obj)


# Meshes


@pytest.mark.parametrize("how", ["restricted", "eye"])
@pytest.mark.parametrize("parent", [False, True])
def test_what_is_hidden_is_read_as_it_would_be_shown(scene: Any, link: Link, how: str, parent: bool) -> None:
    obj = wireframe_to_curve(Wireframe.create(1000.0 * np.array(CUBE), CUBE_EDGES))
    mover = obj
    if parent:
        mover = link("parent", None)
        obj.parent, obj.location = mover, (0.5, 0.0, 0.0)
    bpy.context.view_layer.update()
    for each in {obj, mover}:
        each.hide_viewport = how == "restricted"
        each.hide_set(how == "eye")
    bpy.context.view_layer.update()
    mover.scale, mover.rotation_euler.z, mover.location = (3.0, 3.0, 3.0), 0.4, (0.1, 0.2, 0.3)
    hidden = plan_from_object(obj)
    low, high = hidden.bounds
    assert high[2] - low[2] == pytest.approx(300.0, abs=FINE)
    for each in {obj, mover}:
        each.hide_viewport = False
        each.hide_set(False)
    np.testing.assert_allclose(hidden.vertices, plan_from_object(obj).vertices, atol=10 * FINE)


def test_the_edges_of_a_mesh_are_straight_struts(scene: Any, link: Link) -> None:
    obj = mesh_object(link, [*CUBE, (9.0, 9.0, 9.0)])
    plan = plan_from_object(obj)
    np.testing.assert_allclose(plan.vertices, 1000.0 * np.array(CUBE), rtol=0, atol=FINE)
    np.testing.assert_array_equal(plan.edges, CUBE_EDGES)
    assert plan.is_straight
    assert (plan.name, plan.printed.all(), plan.grounded.sum()) == ("drawing", True, 4)
    np.testing.assert_array_equal(plan.radius, Wireframe.create(plan.vertices, plan.edges).radius)
    np.testing.assert_array_equal(plan_from_object(obj, reading=Reading(radius=1.25)).radius, np.full(12, 1.25))


def test_position_rotation_scale_and_units_apply_to_meshes(scene: Any, link: Link) -> None:
    scene.unit_settings.scale_length = 0.001
    obj = mesh_object(link)
    obj.matrix_world = Matrix.Translation((5.0, 6.0, 7.0)) @ Matrix.Rotation(0.5, 4, "Z") @ Matrix.Scale(-200.0, 4)
    wanted = 1.0 * np.array([obj.matrix_world @ Vector(place) for place in CUBE])
    np.testing.assert_allclose(plan_from_object(obj).vertices, wanted, rtol=0, atol=FINE)


@pytest.mark.parametrize("domain", ["POINT", "EDGE"])
def test_the_attribute_radius_of_a_mesh_is_the_struts(scene: Any, link: Link, domain: str) -> None:
    obj = mesh_object(link)
    values = np.linspace(0.001, 0.003, 8 if domain == "POINT" else 12)
    obj.data.attributes.new("radius", "FLOAT", domain).data.foreach_set("value", values.astype(np.float32))
    obj.scale = (2.0, 2.0, 2.0)
    wanted = 2000.0 * (values if domain == "EDGE" else values[np.array(CUBE_EDGES)].mean(axis=1))
    np.testing.assert_allclose(plan_from_object(obj).radius, wanted, rtol=1e-6)


def test_vertices_at_the_same_place_are_one_joint_and_double_edges_one_strut(scene: Any, link: Link) -> None:
    square = [(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)]
    other = [(0.1, 0, 0.000002), (0.2, 0, 0), (0.2, 0.1, 0), (0.1, 0.1, 0)]  # shares a side, 2 micrometres off
    obj = mesh_object(link, square + other, [], [(0, 1, 2, 3), (4, 5, 6, 7)])
    plan = plan_from_object(obj)
    assert (plan.vertex_count, plan.strut_count) == (6, 7)
    apart = plan_from_object(obj, reading=Reading(weld=0.0001))
    assert (apart.vertex_count, apart.strut_count) == (7, 8)


def test_modifiers_may_complete_a_mesh(scene: Any, link: Link) -> None:
    obj = mesh_object(link)
    obj.modifiers.new("other half", "MIRROR").use_mirror_merge = True
    assert plan_from_object(obj).strut_count == 12
    whole = plan_from_object(obj, evaluated=True)
    assert (whole.vertex_count, whole.strut_count) == (12, 20)
    assert whole.bounds[0, 0] == pytest.approx(-100.0, abs=FINE)
    with pytest.raises(InputError, match=r"object drawing: modifiers: they make \d+ edges of the 12"):
        plan_and_deformed(obj)


def test_a_mesh_in_edit_mode_is_read_as_it_is_there(scene: Any, link: Link) -> None:
    obj = mesh_object(link)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.0, 0.0, 0.05))
    plan, deformed = plan_and_deformed(obj)
    for frame in (plan, deformed, plan_from_object(obj, evaluated=True)):
        np.testing.assert_allclose(frame.bounds[:, 2], [50.0, 150.0], rtol=0, atol=FINE)


def test_shape_keys_and_modifiers_deform_a_mesh(scene: Any, link: Link) -> None:
    obj = mesh_object(link)
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="up")
    for point in key.data:
        point.co = 1.5 * point.co
    key.value = 1.0
    obj.location.x = 0.3
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = link("hook", None)
    modifier.object.location = (0.0, 0.02, 0.0)
    modifier.vertex_indices_set(list(range(8)))
    modifier.matrix_inverse = Matrix.Translation(obj.location)
    plan, deformed = plan_and_deformed(obj)
    places = 1000.0 * np.array(CUBE)
    np.testing.assert_allclose(plan.vertices, places + np.array([300.0, 0.0, 0.0]), rtol=0, atol=FINE)
    np.testing.assert_allclose(deformed.vertices, 1.5 * places + [300.0, 20.0, 0.0], rtol=0, atol=2 * FINE)
    np.testing.assert_array_equal(deformed.edges, plan.edges)
    np.testing.assert_array_equal(deformed.radius, plan.radius)


def test_welded_vertices_that_a_modifier_parts_are_named(scene: Any, link: Link) -> None:
    obj = mesh_object(link, [(0, 0, 0), (0.1, 0, 0), (0.1, 0, 0), (0.2, 0, 0.1)], [(0, 1), (2, 3)])
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = link("hook", None)
    modifier.object.location.z = 0.005
    modifier.vertex_indices_set([2])
    with pytest.raises(InputError, match="object drawing: modifiers: struts 0 and 1 are 5 mm apart where they meet"):
        plan_and_deformed(obj)


# Curves


def test_every_segment_of_a_curve_is_a_strut(scene: Any, link: Link) -> None:
    ring = [(0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (-0.05, 0.0, 0.0), (0.0, -0.05, 0.0)]
    chain = [(0.05, 0.0, 0.0), (0.05, 0.0, 0.04), (0.0, 0.05, 0.08), (0.0, 0.0, 0.1)]
    obj = curve_object(
        link, ("BEZIER", ring, True), ("POLY", chain, False), ("BEZIER", [chain[3], (0.01, 0.0, 0.13)], False)
    )
    plan = plan_from_object(obj)
    np.testing.assert_array_equal(plan.edges, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [4, 5], [5, 6], [6, 7]])
    joints = 1000.0 * np.array([*ring, *chain[1:], (0.01, 0.0, 0.13)])
    np.testing.assert_allclose(plan.vertices, joints, rtol=0, atol=FINE)


def test_bezier_segments_are_what_blender_draws(scene: Any, link: Link) -> None:
    ring = [(0.05, 0.0, 0.0), (0.0, 0.05, 0.01), (-0.05, 0.0, 0.0), (0.0, -0.05, 0.03)]
    obj = curve_object(link, ("BEZIER", ring, True))
    obj.data.resolution_u = 8
    obj.matrix_world = Matrix.Translation((0.1, 0.2, 0.3)) @ Matrix.Rotation(1.0, 4, "X") @ Matrix.Scale(2.0, 4)
    bpy.context.view_layer.update()
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    drawn = 1000.0 * np.array([obj.matrix_world @ vertex.co for vertex in mesh.vertices])
    points = bezier.evaluate(plan_from_object(obj).control_points, np.arange(8) / 8.0)
    np.testing.assert_allclose(points.reshape(-1, 3), drawn, rtol=0, atol=2e-4)


def test_poly_splines_and_vector_handles_make_struts_straight_to_the_last_bit(scene: Any, link: Link) -> None:
    chain = [(0.0123, 0.0, 0.0), (0.05, 0.0217, 0.04), (0.0, 0.05, 0.0831)]
    obj = curve_object(link, ("POLY", chain, False), ("BEZIER", [chain[0], (0.3, 0.1, 0.2), chain[2]], False))
    for point in obj.data.splines[1].bezier_points:
        point.handle_left_type = point.handle_right_type = "VECTOR"
    obj.rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    assert plan_from_object(obj).is_straight


def test_the_bevel_of_a_curve_is_the_radius(scene: Any, link: Link) -> None:
    obj = curve_object(link, ("POLY", [(0, 0, 0), (0.1, 0, 0), (0.1, 0, 0.1)], False))
    default = plan_from_object(obj).radius
    np.testing.assert_allclose(default, 6.0)
    obj.data.bevel_depth = 0.002
    obj.data.splines[0].points[2].radius = 2.0
    obj.scale = (3.0, 3.0, 3.0)
    np.testing.assert_allclose(plan_from_object(obj).radius, [6.0, 9.0], rtol=1e-6)


def test_a_strut_drawn_twice_counts_once_and_a_different_one_is_refused(scene: Any, link: Link) -> None:
    line = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]
    obj = curve_object(link, ("POLY", line, False), ("POLY", line[::-1], False))
    assert plan_from_object(obj).strut_count == 1
    bent = curve_object(link, ("POLY", line, False), ("BEZIER", line, False))
    bent.data.splines[1].bezier_points[0].handle_right_type = "FREE"
    bent.data.splines[1].bezier_points[0].handle_right.z += 0.05
    with pytest.raises(InputError, match=r"segment 1: joins the same two joints as segment 0; remove one of the two"):
        plan_from_object(bent)


def test_points_without_length_are_left_out_and_loops_refused(scene: Any, link: Link) -> None:
    corner = (0.1, 0.0, 0.0)
    obj = curve_object(link, ("POLY", [(0, 0, 0), corner, corner, (0.1, 0.1, 0)], False), ("POLY", [(5, 5, 5)], False))
    assert plan_from_object(obj).strut_count == 2
    loop = curve_object(link, ("BEZIER", [corner, corner], False))
    for point, reach in zip(loop.data.splines[0].bezier_points, (0.1, -0.1), strict=True):
        point.handle_left_type = point.handle_right_type = "FREE"
        point.handle_right = point.handle_left = (0.1, reach, 0.1)
    with pytest.raises(InputError, match="segment 0: begins and ends on the same joint; subdivide it"):
        plan_from_object(loop)


@pytest.mark.parametrize("on_spline", [True, False])
def test_curves_of_all_kinds_are_deformed_as_drawn(scene: Any, link: Link, on_spline: bool) -> None:
    ring = [(0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (-0.05, 0.0, 0.0), (0.0, -0.05, 0.0)]
    up = [(0.05, 0.0, 0.0), (0.05, 0.0, 0.06), (0.0, 0.05, 0.1)]
    above = [(x, y, 0.1) for x, y, _ in ring]
    obj = curve_object(
        link, ("POLY", ring[::-1], True), ("POLY", [(1, 1, 1)], False), ("BEZIER", up, False), ("BEZIER", above, True)
    )
    obj.data.bevel_depth = 0.002
    for point in obj.data.splines[2].bezier_points:
        point.handle_left_type = point.handle_right_type = "VECTOR"
    data = bpy.data.lattices.new("lattice")
    data.interpolation_type_u = data.interpolation_type_v = data.interpolation_type_w = "KEY_LINEAR"
    modifier = obj.modifiers.new("lattice", "LATTICE")
    modifier.object, modifier.use_apply_on_spline = link("lattice", data), on_spline
    modifier.object.scale = (4.0, 4.0, 4.0)
    for point in data.points:  # x' = x + 0.5 z
        point.co_deform = point.co + Vector((0.5 * point.co.z, 0.0, 0.0))
    plan, deformed = plan_and_deformed(obj)
    assert plan.strut_count == 4 + 2 + 4
    shear = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(deformed.control_points, plan.control_points @ shear.T, rtol=0, atol=5e-4)
    np.testing.assert_array_equal(deformed.edges, plan.edges)
    np.testing.assert_allclose(plan.radius, 2.0, rtol=1e-6)


def test_nurbs_are_refused_in_words(scene: Any, link: Link) -> None:
    obj = curve_object(link, ("NURBS", [(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0)], False))
    with pytest.raises(InputError, match=r"object drawing: splines\[0\]: is a NURBS spline.*set the spline type"):
        plan_from_object(obj)


# What is no plan


def test_what_is_no_plan_is_refused_in_words(scene: Any, link: Link) -> None:
    cases = {
        "text": (link("text", bpy.data.curves.new("t", "FONT")), "type: FONT objects have no struts; convert it"),
        "empty": (link("empty", None), "type: EMPTY objects have no struts; select a mesh or a curve object"),
        "surface": (link("surface", bpy.data.curves.new("s", "SURFACE")), "type: SURFACE objects have no struts"),
        "hollow": (link("hollow", bpy.data.curves.new("h", "CURVE")), "splines: the curve holds no segment"),
        "bare": (link("bare", bpy.data.meshes.new("m")), "edges: the mesh holds none; draw an edge"),
        "dots": (mesh_object(link, CUBE, []), "edges: the mesh holds none"),
        "point": (mesh_object(link, [(0, 0, 0), (0, 0, 0)], [(0, 1)]), "geometry: holds no edge or segment"),
        "flat": (mesh_object(link), "scale: is zero along X, Y, Z; give the object a size"),
    }
    cases["flat"][0].scale = (0.0, 0.0, 0.0)
    for obj, words in cases.values():
        with pytest.raises(InputError) as refusal:
            plan_from_object(obj)
        assert str(refusal.value).startswith(f"object {obj.name}: {words}")


def test_welding_is_by_distance_in_chains() -> None:
    rng = np.random.default_rng(3)
    places = rng.uniform(-100.0, 100.0, size=(300, 3))
    group = rng.integers(300, size=2000)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = places[group] + directions * rng.uniform(0.0, 0.004, size=(2000, 1))
    labels = weld(points, 0.01)
    _, first, wanted = np.unique(group, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=int)
    rank[np.argsort(first)] = np.arange(len(first))
    np.testing.assert_array_equal(labels, rank[wanted])
    line = np.column_stack([np.arange(50) * 0.009, np.zeros(50), np.zeros(50)])[rng.permutation(50)]
    assert not weld(line, 0.01).any()
    assert len(set(weld(line, 0.008))) == 50
    assert len(set(weld(np.array([[0.0, 0, 0], [-0.0, 0, 0], [1.0, 0, 0]]), 0.0))) == 2


# Time, and files


def animated(link: Link, frame: Wireframe) -> bpy.types.Object:
    """A frame that a hook lifts by 1 mm a frame of the animation."""
    obj, hook = wireframe_to_curve(frame, name="bent"), link("hook", None)
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set(list(range(6 * frame.strut_count)))
    for number in (0, 100):
        hook.location.z = 0.001 * number
        hook.keyframe_insert("location", frame=number)
    return obj  # the keys are eased, and meet a linear rise at both ends and in the middle


def test_the_deformed_state_is_that_of_the_frame_asked_for(scene: Any, link: Link, rich_frame: Wireframe) -> None:
    obj = animated(link, rich_frame)
    scene.frame_set(7)
    for number, height in ((0, 0.0), (50, 50.0), (100, 100.0)):
        plan, deformed = plan_and_deformed(obj, number)
        np.testing.assert_array_equal(plan.control_points, rich_frame.control_points)
        rise = deformed.control_points - plan.control_points
        np.testing.assert_allclose(rise, np.broadcast_to([0.0, 0.0, height], rise.shape), rtol=0, atol=2e-4)
    assert scene.frame_current == 7


def test_an_object_of_a_file_is_read(scene: Any, link: Link, rich_frame: Wireframe, tmp_path: Path) -> None:
    animated(link, rich_frame)
    file = tmp_path / "user's own.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    plan, deformed = read_blend(file, "bent", 100)
    for field in ("vertices", "control_points", "radius", "printed", "batch"):
        np.testing.assert_array_equal(getattr(plan, field), getattr(rich_frame, field))
    assert np.ptp((deformed.control_points - plan.control_points)[..., 2]) < 2e-4
    assert deformed.bounds[0, 2] - plan.bounds[0, 2] == pytest.approx(100.0, abs=2e-4)


def test_an_object_of_another_scene_has_its_units_and_time(scene: Any, link: Link, tmp_path: Path) -> None:
    other = bpy.data.scenes.new("other")
    other.unit_settings.scale_length = 0.001
    obj = mesh_object(link)
    scene.collection.objects.unlink(obj)
    other.collection.objects.link(obj)
    modifier = obj.modifiers.new("hook", "HOOK")
    modifier.object = bpy.data.objects.new("hook", None)
    other.collection.objects.link(modifier.object)
    modifier.vertex_indices_set(list(range(8)))
    modifier.object.location.z = 0.25
    file = tmp_path / "two scenes.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    plan, deformed = read_blend(file, "drawing")
    assert plan.extent == pytest.approx(0.1, rel=1e-6)
    assert deformed.bounds[0, 2] == pytest.approx(0.25, rel=1e-6)


def test_time_passes_in_the_scene_of_the_object(scene: Any, rich_frame: Wireframe) -> None:
    """Bent as a line, so that the copy for reading is made in that scene too."""
    other = bpy.data.scenes.new("other")
    other.unit_settings.scale_length = 0.01
    obj = wireframe_to_curve(rich_frame, scene=other)
    modifier = obj.modifiers.new("wave", "WAVE")
    modifier.use_x, modifier.use_y, modifier.height, modifier.speed, modifier.width = True, False, 0.5, 0.5, 4.0
    modifier.use_apply_on_spline = False
    found = [plan_and_deformed(obj, number) for number in (1, 10, 20)]
    for plan, _ in found:
        np.testing.assert_array_equal(plan.control_points, rich_frame.control_points)
    heights = [float(np.abs(deformed.control_points - rich_frame.control_points).max()) for _, deformed in found]
    assert len(set(heights)) == 3 and max(heights) > 0.5
    assert (other.frame_current, scene.frame_current) == (1, 1)
    assert len(bpy.data.objects) == len(bpy.data.curves) == 1


def test_scripts_of_a_file_do_not_run(scene: Any, link: Link, tmp_path: Path) -> None:
    mesh_object(link)
    witness = tmp_path / "witness.txt"
    text = bpy.data.texts.new("harm.py")
    text.write(f"open({str(witness)!r}, 'w').write('ran')\n")
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    read_blend(tmp_path / "a.blend", "drawing")
    assert not witness.exists()


def test_files_that_cannot_be_read_are_refused_in_words(scene: Any, link: Link, tmp_path: Path) -> None:
    mesh_object(link)
    link("light", bpy.data.lights.new("light", "POINT"))
    good, damaged = tmp_path / "good.blend", tmp_path / "damaged.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(good))
    damaged.write_bytes(b"BLENDER-v405RENDER" + bytes(100))
    cases = [
        (tmp_path / "none.blend", "drawing", "file: the file does not exist; check the name"),
        (damaged, "drawing", "file: Blender cannot open it"),
        (good, "plan", "object 'plan': is not in the file; give one of drawing."),
        (good, "light", "object light: type: LIGHT objects have no struts"),
    ]
    for file, name, words in cases:
        with pytest.raises(InputError) as refusal:
            read_blend(file, name)
        assert str(refusal.value).startswith(f"{file}: {words}")
