"""Plans and prints with named attributes, and that these change nothing of what is read."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from test_collections import simulated

from frametwin.blender.background.stepwise import run_steps
from frametwin.blender.display.prints import copy_to_bend, read_print, show_print_steps
from frametwin.blender.frames.described import DESCRIBES, forget_description, has_guessed_radius
from frametwin.blender.frames.plan_objects import add_plan, plan_summary
from frametwin.blender.frames.plans import plan_from_object
from frametwin.geometry.wireframe import Wireframe

TYPES = {"FLOAT": np.float32, "INT": np.int32, "BOOLEAN": np.bool_}


def drawn(obj: Any) -> dict[str, np.ndarray]:
    """Attributes of the points that Blender draws, by name."""
    bpy.context.view_layer.update()
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    found = {}
    for attribute in mesh.attributes:
        if attribute.domain == "POINT" and attribute.data_type in TYPES:
            found[attribute.name] = np.empty(len(mesh.vertices), dtype=TYPES[attribute.data_type])
            attribute.data.foreach_get("value", found[attribute.name])
    places = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", places.ravel())
    return {**found, "place": places}


def test_points_of_a_plan_know_their_strut(scene: Any, rich_frame: Wireframe) -> None:
    found = drawn(add_plan(rich_frame))
    strut = found["strut"]
    assert sorted(set(strut.tolist())) == list(range(18))
    np.testing.assert_array_equal(found["batch"], np.minimum(rich_frame.batch, 2**31 - 1)[strut])
    np.testing.assert_array_equal(found["printed"], rich_frame.printed[strut])
    np.testing.assert_allclose(found["radius"], rich_frame.radius[strut] / 1000.0, rtol=1e-6)
    assert not found["radius_guessed"].any()
    ends = rich_frame.vertices[rich_frame.edges[strut]] / 1000.0  # (N, 2, 3)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    away = np.linalg.norm(found["place"][:, None] - ends, axis=-1)
    radius = found["radius"]
    assert (away <= 1.1 * length[:, None] + radius[:, None]).all()  # each tube is where its strut is
    at_end = away.min(axis=1) <= 1.001 * radius
    assert np.bincount(strut[at_end], minlength=18).min() >= 4 * 8  # the rings at both ends and the caps upon them


def test_a_radius_that_nobody_gave_is_marked(scene: Any, rich_frame: Wireframe) -> None:
    bare = Wireframe.create(rich_frame.vertices, rich_frame.edges)
    assert has_guessed_radius(bare).all() and drawn(add_plan(bare))["radius_guessed"].all()
    assert not has_guessed_radius(bare.replace(radius=1.01 * bare.radius)).any()


def test_points_of_a_print_know_how_far_it_moved(scene: Any, rich_frame: Wireframe) -> None:
    shift = np.eye(4)
    shift[:3, 3] = [0.0, 3.0, -4.0]
    answer = simulated(rich_frame.transformed(shift))
    answer["present"][5] = [0.0, 0.25]
    obj = run_steps(show_print_steps(rich_frame, answer))
    found = drawn(obj)
    np.testing.assert_allclose(found["displacement_mean"], 5.0, rtol=1e-6)
    np.testing.assert_allclose(found["displacement_max"], 5.0, rtol=1e-6)
    np.testing.assert_array_equal(found["completeness"], np.where(found["strut"] == 5, 0.25, 1.0))


def test_what_is_read_stays_what_it_was(scene: Any, rich_frame: Wireframe, link: Any) -> None:
    plan = add_plan(rich_frame)
    np.testing.assert_array_equal(plan_from_object(plan, evaluated=True).control_points, rich_frame.control_points)
    bent = copy_to_bend(plan)
    assert not drawn(bent)["displacement_max"].any()
    for obj in (plan, bent):
        lattice = link("lattice", bpy.data.lattices.new("lattice"))
        lattice.scale = (1.0, 1.0, 1.0)
        for point in lattice.data.points:
            point.co_deform.z *= 1.5
        modifier = obj.modifiers.new("lattice", "LATTICE")
        modifier.object = lattice
        assert DESCRIBES in obj.modifiers[-1].node_group  # stays the last
    assert "strut" in drawn(bent)
    described = read_print(plan, bent).truth.control_points
    assert np.abs(described - rich_frame.control_points).max() > 1.0
    forget_description(plan)
    forget_description(bent)
    np.testing.assert_array_equal(read_print(plan, bent).truth.control_points, described)
    assert not any(DESCRIBES in each for kind in ("objects", "node_groups") for each in getattr(bpy.data, kind))


def test_an_edited_plan_is_read_as_drawn_and_loses_its_attributes(scene: Any, rich_frame: Wireframe) -> None:
    plan = add_plan(rich_frame)
    plan.data.splines.remove(plan.data.splines[7])
    assert plan_summary(plan).struts == 17
    assert "strut" not in drawn(plan)


def test_objects_of_one_kind_share_their_nodes(scene: Any, rich_frame: Wireframe) -> None:
    plans = [add_plan(rich_frame), add_plan(rich_frame.transformed(np.diag([2.0, 2.0, 2.0, 1.0])))]
    assert plans[0].modifiers[-1].node_group == plans[1].modifiers[-1].node_group
    np.testing.assert_allclose(drawn(plans[1])["radius"].max(), 2.0 * rich_frame.radius.max() / 1000.0, rtol=1e-6)
