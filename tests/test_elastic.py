"""The elastic frame: exact motions, closed forms of beams, and matrices against dense assembly."""

from __future__ import annotations

import numpy as np
import pytest
from small_frames import tower

from frametwin.fitting.elastic import ANCHOR, ElasticFrame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

FRAMES = {"straight": tower(), "curved": tower(curved=True)}


def lone(
    length: float = 20.0, radius: float = 1.0, direction: tuple[float, float, float] = (1.0, 2.0, -2.0)
) -> Wireframe:
    end = length * np.array(direction) / np.linalg.norm(direction)
    return Wireframe.create([[0.0, 0.0, 0.0], end], [[0, 1]], radius=radius)


def energy(elastic: ElasticFrame, joints: np.ndarray) -> float:
    return 0.5 * float(joints.ravel() @ (elastic.assemble(elastic.stiffness) @ joints.ravel()))


def small_motion(vertices: np.ndarray, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(V, 6) freedoms of the joints in a motion by ``shift`` and an infinitesimal turn about the origin."""
    return np.concatenate([shift + np.cross(turn, vertices), np.broadcast_to(turn, vertices.shape)], axis=1)


@pytest.mark.parametrize("name", FRAMES)
def test_rigid_motions_cost_nothing(name: str) -> None:
    elastic = ElasticFrame(FRAMES[name])
    rng = np.random.default_rng(0)
    rigid = small_motion(elastic.frame.vertices, *rng.normal(size=(2, 3)))
    bent = rng.normal(size=rigid.shape) * np.abs(rigid).max()
    assert abs(energy(elastic, rigid)) < 1e-11 * energy(elastic, bent)


@pytest.mark.parametrize("name", FRAMES)
def test_curves_follow_rigid_motions_exactly(name: str) -> None:
    frame = FRAMES[name]
    elastic = ElasticFrame(frame)
    shift, turn = np.random.default_rng(1).normal(size=(2, 3))
    moved = elastic.displaced(
        frame.control_points, small_motion(frame.vertices, shift, turn), np.zeros((frame.strut_count, 6))
    )
    wanted = frame.control_points + shift + np.cross(turn, frame.control_points)
    np.testing.assert_allclose(moved, wanted, atol=1e-11)


def test_a_stretch_moves_the_inner_points_by_thirds() -> None:
    frame = lone()
    elastic = ElasticFrame(frame)
    axis = frame.vertices[1] / 20.0
    joints = np.zeros((2, 6))
    joints[1, :3] = 0.6 * axis
    moved = elastic.displaced(frame.control_points, joints, np.zeros((1, 6)))
    share = np.array([0.0, 1.0, 2.0, 3.0]) / 3.0
    np.testing.assert_allclose(moved[0] - frame.control_points[0], 0.6 * share[:, None] * axis, atol=1e-12)


def test_a_sideways_shift_bends_as_a_clamped_beam_does() -> None:
    frame = lone()
    elastic = ElasticFrame(frame)
    joints = np.zeros((2, 6))
    aside = np.cross(frame.vertices[1], [0.0, 0.0, 1.0])
    joints[1, :3] = aside / np.linalg.norm(aside)
    moved = elastic.displaced(frame.control_points, joints, np.zeros((1, 6)))
    u = np.linspace(0.0, 1.0, 11)
    deflection = bezier.evaluate(moved - frame.control_points, u)[0] @ joints[1, :3]
    np.testing.assert_allclose(deflection, u**2 * (3.0 - 2.0 * u), atol=1e-12)


@pytest.mark.parametrize("radius", [0.5, 1.7])
def test_energies_of_a_lone_strut_are_those_of_beams(radius: float) -> None:
    """The unit is the strut's own: half its sideways stiffness 12 EI / L^3, shifted by one radius, is 1/2."""
    length = 20.0
    frame = lone(length, radius)
    elastic = ElasticFrame(frame)
    axis = frame.vertices[1] / length
    aside = np.cross(axis, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    about = np.cross(axis, aside)  # turning about it moves a point ahead along -aside

    def moved_end(shift: np.ndarray, turn: np.ndarray) -> float:
        joints = np.zeros((2, 6))
        joints[1] = [*shift, *turn]
        return energy(elastic, joints)

    nothing = np.zeros(3)
    assert moved_end(radius * aside, nothing) == pytest.approx(0.5)
    # A free end turns by 3/2 of the shift over the length, and resists with 3 EI / L^3: a quarter.
    slope = 1.5 * radius / length
    free = min(moved_end(radius * aside, slope * sign * about) for sign in (1.0, -1.0))
    assert free == pytest.approx(0.125)
    # Pulling: E A / L against 12 E I / L^3 is L^2 / (3 r^2).
    assert moved_end(radius * axis, nothing) == pytest.approx(0.5 * length**2 / (3.0 * radius**2))
    # Twisting: G J / L with G = E / 2.7 and J = 2 I, by an angle: J / (2.7 I) L^2 / 12 of the shift's square.
    assert moved_end(nothing, 0.1 * axis) == pytest.approx(0.5 * 0.01 * 2.0 / 2.7 * length**2 / 12.0 / radius**2)


def test_the_unit_is_that_of_the_median_strut() -> None:
    vertices = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [30.0, 0.0, 0.0], [70.0, 0.0, 0.0]]
    elastic = ElasticFrame(Wireframe.create(vertices, [[0, 1], [1, 2], [2, 3]], radius=1.5))
    sideways = 1.5**2 * elastic.stiffness[:, 1, 1] / 2.0  # of one end by one radius
    np.testing.assert_allclose(sideways, [0.5 * 8.0, 0.5, 0.5 / 8.0])


@pytest.mark.parametrize("name", FRAMES)
def test_assembly_equals_the_dense_sum(name: str) -> None:
    frame = FRAMES[name]
    elastic = ElasticFrame(frame)
    rng = np.random.default_rng(2)
    blocks = rng.normal(size=(frame.strut_count, 12, 12))
    joint_blocks = rng.normal(size=(frame.vertex_count, 3, 3))
    parts, joint_parts = rng.normal(size=(frame.strut_count, 12)), rng.normal(size=(frame.vertex_count, 3))
    dense, vector = np.zeros((6 * frame.vertex_count,) * 2), np.zeros(6 * frame.vertex_count)
    for k, (a, b) in enumerate(frame.edges):
        own = [*range(6 * a, 6 * a + 6), *range(6 * b, 6 * b + 6)]
        dense[np.ix_(own, own)] += blocks[k]
        vector[own] += parts[k]
    np.testing.assert_allclose(elastic.assemble(blocks).toarray(), dense, atol=1e-12)
    np.testing.assert_allclose(elastic.assemble_vector(parts), vector, atol=1e-12)
    for v in range(frame.vertex_count):
        own = slice(6 * v, 6 * v + 3)
        dense[own, own] += joint_blocks[v]
        vector[own] += joint_parts[v]
    np.testing.assert_allclose(elastic.assemble(blocks, joint_blocks).toarray(), dense, atol=1e-12)
    np.testing.assert_allclose(elastic.assemble_vector(parts, joint_parts), vector, atol=1e-12)


def with_loose_vertex() -> Wireframe:
    frame = lone()
    return Wireframe.create([*frame.vertices, [9.0, 9.0, 9.0]], frame.edges, radius=1.0)


def test_a_vertex_without_struts_stays_where_it_is() -> None:
    elastic = ElasticFrame(with_loose_vertex())
    joint_blocks = np.tile(np.eye(3), (3, 1, 1))
    matrix = elastic.assemble(elastic.stiffness, joint_blocks)
    assert matrix.shape == (18, 18)
    right = np.zeros(18)
    right[6:9] = 1.0
    answer = elastic.solve(matrix, right)
    assert np.isfinite(answer).all()
    assert np.abs(answer[6:9]).max() > 0.1
    assert not answer[12:].any()


def test_the_anchor_is_a_faint_spring_on_every_freedom() -> None:
    elastic = ElasticFrame(FRAMES["straight"])
    matrix = elastic.assemble(elastic.stiffness)
    dense = matrix.toarray()
    faint = ANCHOR * np.diag(dense).mean()
    np.testing.assert_allclose(
        elastic.anchored(matrix).toarray(), dense + faint * np.eye(len(dense)), rtol=1e-12, atol=1e-12
    )
    np.testing.assert_array_equal(matrix.toarray(), dense)  # not changed itself
    right = np.random.default_rng(3).normal(size=len(dense))
    answer = elastic.solve(matrix, right)
    np.testing.assert_allclose((dense + faint * np.eye(len(dense))) @ answer, right, atol=1e-6)


@pytest.mark.parametrize("name", FRAMES)
def test_freedoms_give_back_the_curves_they_were_found_from(name: str) -> None:
    frame = FRAMES[name]
    elastic = ElasticFrame(frame)
    rng = np.random.default_rng(4)
    shift = rng.normal(size=(frame.vertex_count, 3))
    displacement = rng.normal(size=(frame.strut_count, 4, 3))
    displacement[:, [0, 3]] = shift[frame.edges]  # struts stay joined
    joints, inner = elastic.freedoms_of(displacement)
    moved = elastic.displaced(frame.control_points, joints, inner)
    np.testing.assert_allclose(moved, frame.control_points + displacement, atol=1e-9)
    np.testing.assert_array_equal(joints[:, :3], shift)


def test_freedoms_of_a_turned_frame_are_its_turn() -> None:
    frame = FRAMES["straight"]
    elastic = ElasticFrame(frame)
    shift, turn = np.random.default_rng(5).normal(size=(2, 3))
    displacement = shift + np.cross(turn, frame.control_points)
    joints, inner = elastic.freedoms_of(displacement)
    np.testing.assert_allclose(joints[:, 3:], np.tile(turn, (frame.vertex_count, 1)), rtol=0.02, atol=0.01)
    assert np.abs(inner).max() < 0.02 * np.abs(displacement - shift).max()  # little is left for the struts alone


@pytest.mark.parametrize("name", FRAMES)
def test_inner_stiffness_is_symmetric_and_positive(name: str) -> None:
    inner = ElasticFrame(FRAMES[name]).inner_stiffness
    np.testing.assert_allclose(inner, inner.transpose(0, 2, 1), rtol=1e-12, atol=1e-12 * np.abs(inner).max())
    assert np.linalg.eigvalsh(inner).min() > 0.0  # so only no displacement costs nothing


def test_inner_bending_is_that_of_a_clamped_beam() -> None:
    """Both inner points aside by h bend the strut to 3 h u (1 - u): EI / 2 times the integral of 36 h^2 / L^3."""
    length, radius, h = 20.0, 1.0, 0.7
    frame = lone(length, radius)
    aside = np.cross(frame.vertices[1], [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    own = np.tile(h * aside, 2)
    found = 0.5 * own @ ElasticFrame(frame).inner_stiffness[0] @ own
    unit = 12.0 * radius**2  # of EI / L^3
    assert found == pytest.approx(0.5 * 36.0 * h**2 / unit, rel=0.01)


def test_uneven_stretch_costs_more_than_bending() -> None:
    frame = lone()
    stiffness = ElasticFrame(frame).inner_stiffness[0]
    axis = frame.vertices[1] / 20.0
    aside = np.cross(axis, [0.0, 0.0, 1.0])
    along, across = np.tile(axis, 2), np.tile(aside / np.linalg.norm(aside), 2)
    assert along @ stiffness @ along > 20.0 * (across @ stiffness @ across)
    assert along @ stiffness @ across == pytest.approx(0.0, abs=1e-9)


def test_a_strut_that_stands_alone_is_held_against_spinning() -> None:
    """Turning about its own chord costs a round beam nothing, whole or twisted evenly; here it costs its torsion."""
    length, radius = 20.0, 1.0
    elastic = ElasticFrame(lone(length, radius))
    axis = elastic.frame.vertices[1] / length
    spin = np.concatenate([np.zeros(3), axis, np.zeros(3), axis])
    assert spin @ elastic.stiffness[0] @ spin == pytest.approx(0.0, abs=1e-9)
    torsion = (1.0 / 2.7) * 2.0 * length**2 / (12.0 * radius**2)  # GJ / L by 12 EI R^2 / L^3
    assert spin @ elastic.spin_stiffness[0] @ spin == pytest.approx(2.0 * torsion, rel=0.01)
    aside = np.cross(axis, [0.0, 0.0, 1.0])
    tilt = np.concatenate([aside, aside, -aside, aside])
    assert tilt @ elastic.spin_stiffness[0] @ tilt == pytest.approx(0.0, abs=1e-9)
