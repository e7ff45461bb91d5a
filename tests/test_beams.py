"""Beam elements and frames of them, against closed forms and PyNiteFEA."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pynite_oracle import solve_with_pynite

from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.beams import element_loads, loads_along_axes
from frametwin.mechanics.stiffness import (
    PLA,
    FrameBeams,
    Material,
    require_grounded,
)

LENGTH, RADIUS = 80.0, 1.3
AREA, INERTIA = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4.0
BENDING = PLA.young * INERTIA
WEIGHT = PLA.weight * AREA


def frame_of(vertices: list, edges: list, grounded: list[int], **fields: Any) -> Wireframe:
    held = np.zeros(len(vertices), dtype=bool)
    held[grounded] = True
    return Wireframe.create(vertices, edges, radius=RADIUS, grounded=held, **fields)


def cantilever(direction: list[float]) -> Wireframe:
    tip = LENGTH * np.array(direction) / np.linalg.norm(direction)
    return frame_of([[0.0, 0.0, 0.0], list(tip)], [[0, 1]], [0])


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [2.0, 3.0, 0.0]])
def test_level_cantilever_bends_as_in_the_textbook(direction: list[float]) -> None:
    frame = cantilever(direction)
    beams = FrameBeams.build(frame)
    joints = beams.solve()
    x = LENGTH * np.arange(21) / 20
    curve = beams.along_struts(joints, 20)[0]

    assert joints[1, 2] == pytest.approx(-WEIGHT * LENGTH**4 / (8.0 * BENDING), rel=1e-9)
    assert np.linalg.norm(joints[1, 3:]) == pytest.approx(WEIGHT * LENGTH**3 / (6.0 * BENDING), rel=1e-9)
    shape = WEIGHT * x**2 * (6.0 * LENGTH**2 - 4.0 * LENGTH * x + x**2) / (24.0 * BENDING)
    np.testing.assert_allclose(curve[:, 2], -shape, atol=1e-9 * shape.max())
    np.testing.assert_allclose(curve[:, :2], 0.0, atol=1e-9 * shape.max())


def test_slanted_cantilever_takes_its_weight_across_and_along() -> None:
    direction = np.array([3.0, 0.0, 4.0]) / 5.0
    beams = FrameBeams.build(cantilever([3.0, 0.0, 4.0]))
    tip = beams.solve()[1, :3]
    across = np.array([4.0, 0.0, -3.0]) / 5.0
    assert tip @ across == pytest.approx(0.6 * WEIGHT * LENGTH**4 / (8.0 * BENDING), rel=1e-9)
    assert tip @ direction == pytest.approx(-0.8 * WEIGHT * LENGTH**2 / (2.0 * PLA.young * AREA), rel=1e-9)


def test_beam_with_clamped_ends_sags_in_its_middle_only() -> None:
    frame = frame_of([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]], [[0, 1]], [0, 1])
    beams = FrameBeams.build(frame)
    curve = beams.along_struts(beams.solve(), 10)[0]
    x = LENGTH * np.arange(11) / 10
    shape = WEIGHT * x**2 * (LENGTH - x) ** 2 / (24.0 * BENDING)
    np.testing.assert_allclose(curve[:, 2], -shape, atol=1e-9 * shape.max())
    assert curve[5, 2] == pytest.approx(-WEIGHT * LENGTH**4 / (384.0 * BENDING), rel=1e-9)


def test_one_beam_is_as_good_as_five() -> None:
    """The shape inside of a beam is exact: joints put there would move the same way."""
    ends = np.array([[0.0, 0.0, 0.0], [50.0, 30.0, 20.0], [90.0, -10.0, 5.0]])
    whole = frame_of(ends.tolist(), [[0, 1], [1, 2]], [0])
    beams = FrameBeams.build(whole)
    curves = beams.along_struts(beams.solve(), 5)
    points = np.concatenate([bezier.evaluate(whole.control_points, np.arange(5) / 5).reshape(-1, 3), ends[2:]])
    fine = frame_of(points.tolist(), [[i, i + 1] for i in range(10)], [0])
    moved = FrameBeams.build(fine).solve()[:, :3]
    np.testing.assert_allclose(curves[0, :5], moved[:5], atol=1e-9 * np.abs(moved).max())
    np.testing.assert_allclose(curves[1], moved[5:], atol=1e-9 * np.abs(moved).max())


def test_truss_of_two_slender_bars() -> None:
    frame = frame_of([[-60.0, 0.0, 80.0], [60.0, 0.0, 80.0], [0.0, 0.0, 0.0]], [[0, 2], [1, 2]], [0, 1])
    frame = frame.replace(radius=np.full(2, 0.05))
    loads = np.zeros((3, 6))
    loads[2, 2] = -1.0
    moved = FrameBeams.build(frame, weightless=True).solve(loads)[2]
    # P L / (2 E A cos^2): cos = 0.8, L = 100; the bars' bending carries a share of about (r / L)^2.
    expected = -100.0 / (2.0 * PLA.young * np.pi * 0.05**2 * 0.64)
    assert moved[2] == pytest.approx(expected, rel=1e-5)


def test_bracket_twists_and_bends() -> None:
    root, arm = 50.0, 30.0
    frame = frame_of([[0, 0, 0], [root, 0, 0], [root, arm, 0]], [[0, 1], [1, 2]], [0])
    loads = np.zeros((3, 6))
    loads[2, 2] = 0.01
    moved = FrameBeams.build(frame, weightless=True).solve(loads)[2, 2]
    twisting = PLA.shear * 2.0 * INERTIA
    expected = 0.01 * ((root**3 + arm**3) / (3.0 * BENDING) + root * arm**2 / twisting)
    assert moved == pytest.approx(expected, rel=1e-9)


def quarter_circle(radius: float = 60.0) -> Wireframe:
    k = 4.0 / 3.0 * (np.sqrt(2.0) - 1.0)
    curve = radius * np.array([[0.0, 0, 0], [0, 0, k], [1 - k, 0, 1], [1, 0, 1]])
    return frame_of(curve[[0, 3]].tolist(), [[0, 1]], [0], control_points=[curve.tolist()])


def test_curved_strut_converges_to_the_curved_beam() -> None:
    """A quarter ring, clamped below, loaded down at its level end: Castigliano's closed form."""
    frame, load = quarter_circle(), 0.01
    loads = np.zeros((2, 6))
    loads[1, 2] = -load
    expected = load * 60.0 * (np.pi / 4.0) * (60.0**2 / BENDING + 1.0 / (PLA.young * AREA))
    errors = []
    for pieces in (2, 4, 8, 16):
        tip = FrameBeams.build(frame, weightless=True, pieces=pieces).solve(loads)[1, 2]
        errors.append(abs(-tip / expected - 1.0))
    assert errors[1] < 0.035
    assert errors[3] < 0.003
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(ratios[:2] > 3.0)  # second order, until the cubic's own distance from the circle shows


def test_stiffness_knows_rigid_motions(curved_frame: Wireframe) -> None:
    frame = curved_frame
    matrix = FrameBeams.build(frame).stiffness()
    assert abs(matrix - matrix.T).max() <= 1e-9 * abs(matrix).max()
    values = np.linalg.eigvalsh(matrix.toarray())
    assert np.all(values[:6] < 1e-8 * values[-1])
    assert values[6] > 1e-8 * values[-1]

    spin, shift = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0])
    motion = np.zeros((frame.vertex_count, 6))
    motion[:, :3] = np.cross(spin, frame.vertices) + shift
    motion[:, 3:] = spin
    assert np.abs(matrix @ motion.ravel()).max() < 1e-9 * abs(matrix).max()
    beams = FrameBeams.build(frame, weightless=True)
    curves = bezier.evaluate(frame.control_points, np.arange(13) / 12)
    np.testing.assert_allclose(beams.along_struts(motion, 12), np.cross(spin, curves) + shift, atol=1e-9)


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("curved", [False, True])
def test_same_as_pynite(curved: bool, straight_frame: Wireframe, curved_frame: Wireframe) -> None:
    frame = curved_frame if curved else straight_frame
    rng = np.random.default_rng(2)
    scale = np.exp(rng.uniform(np.log(0.001), 0.0, frame.strut_count))
    loads = np.zeros((frame.vertex_count, 6))
    loads[-3:] = rng.normal(scale=[1e-3] * 3 + [1e-2] * 3, size=(3, 6))
    beams = FrameBeams.build(frame, scale, axial_scale=np.maximum(scale, 0.1))
    ours, theirs = beams.solve(loads), solve_with_pynite(beams, loads)
    assert theirs is not None
    assert relative(ours[:, :3], theirs[:, :3]) < 1e-6
    assert relative(ours[:, 3:], theirs[:, 3:]) < 1e-6


@pytest.mark.parametrize("name", ["simple_frame.json", "mars_bubble_S1_03-14-2019_w_layer.json"])
def test_same_as_pynite_on_real_frames(name: str, shared_frames: Path) -> None:
    beams = FrameBeams.build(read_frame(shared_frames / "assembly_instances" / name))
    ours, theirs = beams.solve(), solve_with_pynite(beams)
    assert theirs is not None
    assert relative(ours[:, :3], theirs[:, :3]) < 1e-6
    assert relative(ours[:, 3:], theirs[:, 3:]) < 1e-6


def test_pynite_inside_of_a_strut_too() -> None:
    from Pynite import FEModel3D

    model = FEModel3D()
    model.add_material("m", PLA.young, PLA.shear, PLA.poisson, PLA.weight)
    model.add_section("s", AREA, INERTIA, INERTIA, 2.0 * INERTIA)
    model.add_node("a", 0, 0, 0)
    model.add_node("b", 30, 40, 20)
    model.add_member("ab", "a", "b", "m", "s")
    model.def_support("a", *[True] * 6)
    model.add_member_self_weight("FZ", -1.0)
    model.analyze_linear()
    member = model.members["ab"]
    local = np.array([[member.deflection(d, x * member.L()) for d in ("dx", "dy", "dz")] for x in (0.25, 0.6)])
    expected = local @ member.T()[:3, :3]

    beams = FrameBeams.build(frame_of([[0, 0, 0], [30, 40, 20]], [[0, 1]], [0]))
    found = beams.along_struts(beams.solve(), 20)[0, [5, 12]]
    # PyNite leaves the weight's own stretch between the ends out, a millionth of the sag here.
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_pynite_that_would_weld_is_not_believed() -> None:
    frame = frame_of([[0, 0, 0], [40, 0, 0], [20, 0, 0], [20, 30, 0]], [[0, 1], [2, 3]], [0, 3])
    assert solve_with_pynite(FrameBeams.build(frame)) is None


def test_loads_add_up(curved_frame: Wireframe) -> None:
    frame = curved_frame
    weight = np.sum(PLA.weight * np.pi * frame.radius**2 * frame.lengths)
    loads = FrameBeams.build(frame, pieces=64).loads()  # the chords' weight comes near the curve's
    assert -loads[:, 2].sum() == pytest.approx(weight, rel=1e-3)
    np.testing.assert_allclose(loads[:, :2].sum(axis=0), 0.0, atol=1e-9 * weight)


def test_unprinted_struts_do_not_carry(straight_frame: Wireframe) -> None:
    printed = np.arange(straight_frame.strut_count) < straight_frame.strut_count // 2
    frame = straight_frame.replace(printed=printed)
    part, _, vertex_ids = frame.printed_part()
    whole, alone = FrameBeams.build(frame).solve(), FrameBeams.build(part).solve()
    np.testing.assert_allclose(whole[vertex_ids], alone, atol=1e-12 * np.abs(alone).max())
    rest = np.setdiff1d(np.arange(frame.vertex_count), vertex_ids)
    assert np.all(whole[rest] == 0.0)


def test_what_hangs_in_the_air_is_refused() -> None:
    frame = frame_of([[0, 0, 0], [9, 0, 0], [0, 5, 9], [9, 5, 9], [4, 5, 2]], [[0, 1], [2, 3], [3, 4]], [0])
    with pytest.raises(InputError, match="2 printed struts have no connection .* not printed"):
        require_grounded(frame)
    require_grounded(frame.replace(printed=np.array([True, False, False])))
    with pytest.raises(InputError, match="grounded: no printed strut ends on a grounded vertex"):
        require_grounded(frame.replace(printed=np.array([False, True, True])))


@pytest.mark.parametrize("scale", [np.ones(3), np.zeros(1), np.array([np.nan])])
def test_bad_stiffness_is_refused(scale: np.ndarray) -> None:
    with pytest.raises(InputError, match="stiffness_scale"):
        FrameBeams.build(cantilever([1.0, 0.0, 0.0]), scale)


@pytest.mark.parametrize("fields", [{"young": 0.0}, {"density": np.nan}, {"poisson": 0.5}])
def test_bad_material_is_refused(fields: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(fields))):
        Material(**fields)


def test_loads_along_the_axes_are_those_of_three_loads() -> None:
    rng = np.random.default_rng(5)
    start, end, load = rng.normal(size=(7, 3)), rng.normal(size=(7, 3)) + 3.0, rng.uniform(0.1, 2.0, 7)
    along = loads_along_axes(start, end, load)
    for axis, unit in enumerate(np.eye(3)):
        np.testing.assert_allclose(along[:, :, axis], element_loads(start, end, load[:, None] * unit), atol=1e-14)


def test_an_even_load_is_half_of_it_at_each_end_and_a_twelfth_of_its_moment() -> None:
    """A beam of 6 mm along x under 2 N/mm downwards: q L / 2 at each end, q L^2 / 12 about y."""
    found = element_loads(np.zeros((1, 3)), np.array([[6.0, 0.0, 0.0]]), np.array([[0.0, 0.0, -2.0]]))[0]
    np.testing.assert_allclose(found, [0, 0, -6, 0, 6, 0, 0, 0, -6, 0, -6, 0], atol=1e-14)
