"""Ends of struts that hang free: found by the fit, told in the twin, kept by its files."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from frametwin.errors import InputError
from frametwin.fields.lattice import LatticeField
from frametwin.fitting.api import fit_views
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.judgement import torn_ends
from frametwin.fitting.motion import covariance_between, joint_system
from frametwin.fitting.part_fit import PartFit
from frametwin.formats import find_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.rods import Terms
from frametwin.raster.silhouette import silhouettes
from frametwin.simulation.simulate import SimulationSettings, simulate
from frametwin.twin.twin import Twin, read_twin, write_twin

APART = 5.0
END = (15, 1)
"""A strut of the half bowl, and which of its ends is torn off."""


def torn_off(truth: Wireframe, strut: int, side: int) -> Wireframe:
    """The strut turned about its other end, so that this one is `APART` mm from its joint."""
    curves = np.array(truth.control_points)
    pivot = curves[strut, 3 - 3 * side].copy()
    arm = curves[strut, 3 * side] - pivot
    axis = np.cross(arm, [0.3, 0.5, 0.8])
    angle = 2.0 * np.arcsin(0.5 * APART / np.linalg.norm(arm))
    rotation = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).as_matrix()
    curves[strut] = pivot + (curves[strut] - pivot) @ rotation.T
    curves[strut, 3 - 3 * side] = pivot
    return truth.detached(np.array([[strut, side]]), control_points=curves)


@pytest.fixture(scope="module")
def torn_print() -> tuple[Wireframe, Wireframe, Twin]:
    """Plan, truth and twin of a bowl with one torn joint."""
    made = simulate(find_frame("half_bowl"), SimulationSettings(size=(600, 800), seed=0))
    truth = torn_off(made.truth, *END)
    masks = [mask / np.float32(255) for mask in silhouettes(truth, made.cameras)]
    return made.frame, truth, fit_views(made.frame, made.cameras, masks).twin


def test_a_torn_end_is_found_and_nothing_else_is_called_torn(torn_print):
    _, truth, twin = torn_print
    assert [tuple(end) for end in np.argwhere(~twin.attached).tolist()] == [END]
    assert twin.gap[END] == pytest.approx(APART, abs=0.5)
    assert twin.gap.sum() == twin.gap[END]
    strut, side = END
    assert np.linalg.norm(twin.control_points[strut, 3 * side] - truth.control_points[strut, 3 * side]) < 1.0
    assert any(f"strut {strut} at its end" in reason for reason in twin.verdict.reasons)


def test_torn_struts_of_a_part_are_called_as_in_the_whole_frame():
    count, gap = 3, np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 6.0]])
    whole = np.ones((count, 5))
    field = LatticeField.zeros(np.array([[0.0] * 3, [1.0] * 3]), [(1, 1, 1)])
    part = PartFit(
        np.zeros((count, 4, 3)),
        np.zeros((4, 3)),
        whole,
        whole,
        np.ones(count),
        field,
        [],
        {},
        attached=gap == 0.0,
        gap=gap,
    )
    assert torn_ends(part, np.array([7, 40, 205])) == [
        "torn off their joints: strut 205 at its end by 6.0 mm; strut 40 at its start by 4.0 mm"
    ]


def test_the_joint_stays_where_the_other_struts_hold_it(torn_print):
    frame, truth, twin = torn_print
    joint = frame.edges[END]
    assert np.linalg.norm(twin.vertices[joint] - truth.vertices[joint]) < 0.15


def test_whole_prints_have_no_torn_ends():
    made = simulate(find_frame("bridge"), SimulationSettings(size=(600, 800), seed=3))
    twin = fit_views(made.frame, made.cameras, [image / np.float32(255) for image in made.images]).twin
    assert twin.attached.all() and not twin.gap.any()


def test_a_missing_strut_is_missing_and_not_torn():
    made = simulate(find_frame("half_bowl"), SimulationSettings(size=(600, 800), seed=2, missing=2))
    twin = fit_views(made.frame, made.cameras, [image / np.float32(255) for image in made.images]).twin
    assert twin.attached.all()


def test_looking_for_torn_ends_can_be_turned_off(torn_print):
    frame, truth, _ = torn_print
    made = simulate(find_frame("half_bowl"), SimulationSettings(size=(300, 400), seed=0))
    masks = [mask / np.float32(255) for mask in silhouettes(truth, made.cameras)]
    assert fit_views(frame, made.cameras, masks, changes={"learn_torn": False}).twin.attached.all()


def test_files_keep_torn_ends_and_those_without_are_still_read(torn_print, tmp_path):
    *_, twin = torn_print
    again = read_twin(write_twin(tmp_path, twin))
    np.testing.assert_array_equal(again.attached, twin.attached)
    np.testing.assert_array_equal(again.gap, twin.gap)
    data = json.loads((tmp_path / "twin.json").read_text())
    del data["attached"], data["gap"]
    (tmp_path / "twin.json").write_text(json.dumps(data))
    assert read_twin(tmp_path).attached is None
    data["attached"] = [[True]]
    (tmp_path / "twin.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="attached"):
        read_twin(tmp_path)


def test_a_twin_as_a_frame_gives_each_torn_end_a_vertex(torn_print):
    frame, _, twin = torn_print
    shown = twin.as_wireframe(frame)
    assert shown.vertex_count == frame.vertex_count + 1
    np.testing.assert_array_equal(shown.control_points, twin.control_points)
    whole = replace_attached(twin).as_wireframe(frame)
    assert whole.vertex_count == frame.vertex_count


def replace_attached(twin: Twin) -> Twin:
    """The twin with the end back at its joint."""
    curves, (strut, side) = np.array(twin.control_points), END
    frame = find_frame("half_bowl")
    curves[strut, 3 * side] = twin.vertices[frame.edges[END]]
    return twin.replace(control_points=curves, attached=np.ones_like(twin.attached), gap=np.zeros_like(twin.gap))


def test_covariance_between_joints_is_that_of_the_whole_system():
    """Against the dense system, in which the struts' own freedoms are kept."""
    rng, frame = np.random.default_rng(5), find_frame("bridge")
    elastic = ElasticFrame(frame)
    factors = rng.normal(size=(frame.strut_count, 12, 12))
    zeros = np.zeros((frame.vertex_count, 3, 3))
    terms = Terms(
        0.0, factors @ factors.transpose(0, 2, 1), np.zeros((frame.strut_count, 12)), zeros, zeros[..., 0], *2 * [zeros]
    )
    weight, pair = 0.3, np.array([[2, 9]])
    found = covariance_between(elastic, terms, weight, pair)[0]
    size, own = 6 * frame.vertex_count, 6 * frame.strut_count
    dense = np.zeros((size + own, size + own))
    matrix, _ = joint_system(elastic, terms)
    dense[:size, :size] = (matrix + weight * elastic.assemble(elastic.stiffness + elastic.spin_stiffness)).toarray()
    for e in range(frame.strut_count):
        rows = size + 6 * e + np.arange(6)
        mixed = elastic.follow[e].T @ terms.hessian[e][:, 3:9]
        np.add.at(dense, (elastic.freedoms[e][:, None], rows[None, :]), mixed)
        dense[rows[:, None], elastic.freedoms[e][None, :]] += mixed.T
        dense[rows[:, None], rows[None, :]] += terms.hessian[e][3:9, 3:9] + weight * elastic.inner_stiffness[e]
    held = 300.0 * weight / np.median(frame.radius) ** 2
    for joint in np.flatnonzero(frame.grounded):
        dense[6 * joint + np.arange(3), 6 * joint + np.arange(3)] += held
    apart = np.zeros((size + own, 3))
    apart[12:15], apart[54:57] = np.eye(3), -np.eye(3)
    np.testing.assert_allclose(found, apart.T @ np.linalg.solve(dense, apart), rtol=2e-3)


def test_what_hangs_loose_does_not_lead_the_field(torn_print):
    """Struts still to be printed move with the field: at the torn joint it goes where the joint went."""
    frame, truth, _ = torn_print
    made = simulate(find_frame("half_bowl"), SimulationSettings(size=(600, 800), seed=0))
    masks = [mask / np.float32(255) for mask in silhouettes(truth, made.cameras)]
    result = fit_views(frame, made.cameras, masks)
    joint = frame.edges[END]
    moved = result.field.evaluate(frame.vertices[[joint]])[0]
    wanted = truth.vertices[joint] - frame.vertices[joint]
    loose = truth.vertices[-1] - frame.vertices[joint]
    assert np.linalg.norm(moved - wanted) < 0.1 * np.linalg.norm(loose - wanted)
