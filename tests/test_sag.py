"""The sag of half-hardened prints: physics in the small, plausibility in the large."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pynite_oracle import solve_with_pynite
from small_frames import interface_vertices

from frametwin.errors import Cancelled, InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.rotations import rotation_matrices
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.finite_rotation import RotatedShape
from frametwin.mechanics.hardening import Hardening, strut_stiffness
from frametwin.mechanics.sag import SagSettings, sag, scaled_shape, simulate_sag
from frametwin.mechanics.stiffness import PLA, FrameBeams
from frametwin.progress import Progress

FINE = np.linspace(0.0, 1.0, 1001)
HARD = Hardening(unhardened_fraction=0.0)


def displacement(frame: Wireframe, plan: Wireframe) -> np.ndarray:
    """Lengths (E, 1001) of the displacement at equal parameters."""
    return np.linalg.norm(bezier.evaluate(frame.control_points - plan.control_points, FINE), axis=2)


def bulge(frame: Wireframe, plan: Wireframe) -> np.ndarray:
    """Largest distance (E,) of each curve's displacement from what its ends did."""
    change = frame.control_points - plan.control_points
    change = change - bezier.straight(change[:, 0], change[:, 3])
    return np.linalg.norm(bezier.evaluate(change, FINE[::20]), axis=2).max(axis=1)


def rod(end: tuple[float, float, float], radius: float = 1.0) -> Wireframe:
    return Wireframe.create([[0.0, 0.0, 0.0], end], [[0, 1]], radius=radius, grounded=[True, False])


def test_peak_is_met(straight_frame: Wireframe, curved_frame: Wireframe) -> None:
    for frame in (straight_frame, curved_frame):
        by_default = sag(frame)
        assert displacement(by_default, frame).max() == pytest.approx(0.07 * frame.extent, rel=1e-5)
        given = sag(frame, SagSettings(peak=1.5))
        assert displacement(given, frame).max() == pytest.approx(1.5, rel=1e-5)
        assert np.array_equal(given.edges, frame.edges)
        np.testing.assert_array_equal(given.vertices[frame.grounded], frame.vertices[frame.grounded])


def test_small_sag_is_the_linear_solution(curved_frame: Wireframe) -> None:
    beams = FrameBeams.build(curved_frame)
    joints = beams.solve()
    linear = beams.along_struts(joints, 30)
    scale = 1e-5 * curved_frame.extent / np.linalg.norm(linear, axis=2).max()
    vertices, moved = RotatedShape.build(beams, joints, 30).at(scale)
    np.testing.assert_allclose(moved, scale * linear, atol=1e-4 * scale * np.abs(linear).max())
    np.testing.assert_allclose(vertices - curved_frame.vertices, scale * joints[:, :3], atol=1e-8)
    refitted = scaled_shape(beams, joints, 1e-5 * curved_frame.extent)
    moved_ends = refitted.vertices - curved_frame.vertices
    ratio = np.linalg.norm(moved_ends) / np.linalg.norm(scale * joints[:, :3])
    np.testing.assert_allclose(moved_ends, ratio * scale * joints[:, :3], atol=1e-8)


def test_cubic_follows_the_closed_form_of_a_cantilever() -> None:
    frame = rod((50.0, 0.0, 0.0))
    found = sag(frame, SagSettings(peak=0.01, hardening=HARD))
    moved = bezier.evaluate(found.control_points - frame.control_points, FINE)[0]
    shape = -0.01 * FINE**2 * (6.0 - 4.0 * FINE + FINE**2) / 3.0
    # A cubic with fixed ends comes within 0.6 % of the tip's sag to this quartic.
    np.testing.assert_allclose(moved[:, 2], shape, atol=0.006 * 0.01)
    np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-12)
    assert found.control_points[0, 1, 2] == pytest.approx(0.0, abs=3e-4)  # clamped: nearly level


def test_long_turns_keep_lengths() -> None:
    """Half of its length down, a linear cantilever would be 16 % longer than it was."""
    frame = rod((50.0, 0.0, 0.0))
    found = sag(frame, SagSettings(peak=25.0, hardening=HARD))
    assert found.chord_lengths[0] == pytest.approx(50.0, rel=1e-3)
    assert found.lengths[0] == pytest.approx(50.0, rel=0.04)


@pytest.mark.parametrize("degrees", [5.0, 60.0, 170.0])
def test_a_linear_turn_becomes_the_full_turn(degrees: float, curved_frame: Wireframe) -> None:
    frame = curved_frame.replace(grounded=np.arange(curved_frame.vertex_count) == 0)
    beams = FrameBeams.build(frame, weightless=True)
    spin = np.radians(degrees) * np.array([2.0, -1.0, 2.0]) / 3.0
    pivot = frame.vertices[0]
    joints = np.zeros((frame.vertex_count, 6))
    joints[:, :3] = np.cross(spin, frame.vertices - pivot)
    joints[:, 3:] = spin
    vertices, moved = RotatedShape.build(beams, joints, 12).at(1.0)
    turn = rotation_matrices(spin)
    np.testing.assert_allclose(vertices, (frame.vertices - pivot) @ turn.T + pivot, atol=1e-9)
    curves = bezier.evaluate(frame.control_points, np.arange(13) / 12)
    np.testing.assert_allclose(curves + moved, (curves - pivot) @ turn.T + pivot, atol=1e-9)


def test_struts_of_one_joint_turn_together() -> None:
    """Three struts in a line, clamped at both ends: the tangents at the joints stay common."""
    frame = Wireframe.create(
        [[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [45.0, 0.0, 0.0], [80.0, 0.0, 0.0]],
        [[0, 1], [1, 2], [2, 3]],
        radius=1.0,
        grounded=[True, False, False, True],
    )
    found = sag(frame, SagSettings(peak=2.0, hardening=HARD))
    tangents = bezier.derivative(found.control_points, np.array([0.0, 1.0]))
    tangents /= np.linalg.norm(tangents, axis=2, keepdims=True)
    for k in (0, 1):
        assert tangents[k, 1] @ tangents[k + 1, 0] > np.cos(np.radians(1.0))


def test_rotations_are_rotations() -> None:
    vectors = np.random.default_rng(0).normal(size=(20, 3))
    vectors[0] = 0.0
    turns = rotation_matrices(vectors)
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", turns, vectors), vectors, atol=1e-12)
    quarter = rotation_matrices(np.array([0.0, 0.0, np.pi / 2.0]))
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)


def test_seed_decides_everything(straight_frame: Wireframe) -> None:
    first, again, other = (sag(straight_frame, SagSettings(seed=seed)) for seed in (4, 4, 5))
    assert np.array_equal(first.control_points, again.control_points)
    assert not np.array_equal(first.control_points, other.control_points)


def test_the_wanted_share_is_unhardened(straight_frame: Wireframe) -> None:
    result = simulate_sag(straight_frame, SagSettings(hardening=Hardening(unhardened_fraction=0.5)))
    assert result.unhardened.sum() == round(0.5 * straight_frame.strut_count)
    assert np.all(result.stiffness[result.unhardened] < 1.0)
    assert np.all(result.stiffness[~result.unhardened] == 1.0)
    assert result.stiffness.min() >= 1e-3


def test_unhardened_strut_sags_by_the_share_that_was_drawn() -> None:
    """A level strut between two grounded joints, beside a hard cantilever that moves the most."""
    frame = Wireframe.create(
        [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 20.0, 0.0], [60.0, 20.0, 0.0]],
        [[0, 1], [2, 3]],
        radius=1.0,
        grounded=[True, True, True, False],
    )
    wanted = Hardening(
        unhardened_fraction=0.5,
        unhardened_sag=(0.05, 0.05),
        unhardened_stiffness=(1e-6, 1.0),
        longest_span=9.0,
    )
    seed = next(seed for seed in range(99) if wanted.draw(frame, seed)[0].tolist() == [True, False])
    result = simulate_sag(frame, SagSettings(peak=9.0, hardening=wanted, seed=seed))
    # The cubic nearest to x^2 (1 - x)^2 between fixed ends is 3/14 x (1 - x), whose middle is 6/7 as high.
    assert bulge(result.frame, frame)[0] == pytest.approx(6.0 / 7.0 * 0.05 * 40.0, rel=0.01)
    assert result.stiffness[1] == 1.0


def test_stiffness_and_scale_agree(shared_frames: Path) -> None:
    """At the stiffness that was found, the scaled weight gives the sag that was asked for."""
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    hardening = Hardening(unhardened_stiffness=(1e-6, 1.0))
    peak = 0.07 * frame.extent
    stiffness, unhardened = strut_stiffness(frame, hardening, peak=peak, seed=0, material=PLA)
    beams = FrameBeams.build(frame, stiffness, axial_scale=hardening.axial(stiffness))
    scale = peak / np.linalg.norm(beams.along_struts(beams.solve(), 10), axis=2).max()
    load = PLA.weight * np.pi * frame.radius**2
    own = scale * load * frame.lengths**4 / (384.0 * stiffness * PLA.young * np.pi * frame.radius**4 / 4.0)
    share = own[unhardened] / frame.lengths[unhardened]
    assert 0.0199 < share.min() < share.max() < 0.0801


REAL = {
    "Femur": "rl3dp/NodeFemur_wireframe.txt",
    "Coral": "rl3dp/NodeCoral_wireframe.txt",
    "fertility": "assembly_instances/fertility.json",
    "klein": "assembly_instances/klein_bottle_S1.5.json",
    "mars": "assembly_instances/mars_bubble_S1_03-14-2019_w_layer.json",
    "simple": "assembly_instances/simple_frame.json",
}


@pytest.mark.parametrize("name", REAL)
def test_real_frames_sag_as_a_whole_and_strut_by_strut(name: str, shared_frames: Path) -> None:
    frame = read_frame(shared_frames / REAL[name])
    result = simulate_sag(frame, SagSettings())
    lengths = displacement(result.frame, frame)[:, ::50]
    peak = lengths.max()
    assert peak == pytest.approx(0.07 * frame.extent, rel=0.01)
    assert np.median(lengths) > 0.1 * peak, "one strut has the whole displacement to itself"
    stretch = result.frame.lengths / frame.lengths
    assert 0.75 < stretch.min() < stretch.max() < 1.3
    moved = result.frame.vertices - frame.vertices
    assert moved[~frame.grounded, 2].mean() < 0.0
    own = bulge(result.frame, frame) / frame.lengths
    soft = result.unhardened & (result.stiffness < 0.5)
    assert soft.any()
    assert np.median(own[soft]) > 2.0 * np.median(own[~soft])
    assert np.median(own[soft]) > 0.01


def test_a_span_that_is_far_too_long_would_take_all_of_the_sag(shared_frames: Path) -> None:
    """What `longest_span` is for: fertility has struts of up to twelve median lengths."""
    frame = read_frame(shared_frames / REAL["fertility"])
    left_alone = sag(frame, SagSettings(hardening=Hardening(longest_span=1e6)))
    lengths = displacement(left_alone, frame)[:, ::50]
    assert frame.lengths[lengths.max(axis=1).argmax()] > 4.0 * np.median(frame.lengths)
    assert np.median(lengths) < 0.1 * lengths.max()


@pytest.mark.parametrize("name", ["klein", "mars", "simple"])
def test_the_sag_is_that_of_pynite(name: str, shared_frames: Path) -> None:
    frame = read_frame(shared_frames / REAL[name])
    settings = SagSettings(seed=3)
    found = simulate_sag(frame, settings)
    axial = settings.hardening.axial(found.stiffness)
    beams = FrameBeams.build(frame, found.stiffness, axial_scale=axial, pieces=settings.pieces)
    joints = solve_with_pynite(beams)
    assert joints is not None
    theirs = scaled_shape(beams, joints, settings.peak_of(frame))
    np.testing.assert_allclose(found.frame.control_points, theirs.control_points, atol=1e-7)


def test_struts_that_pass_a_joint_are_not_welded_to_it() -> None:
    vertices = [[0.0, 0, 0], [40.0, 0, 0], [20.0, 0, 0], [20.0, 30, 0]]
    grounded = np.array([True, True, False, True])
    both = Wireframe.create(vertices, [[0, 1], [2, 3]], radius=1.0, grounded=grounded)
    beams = FrameBeams.build(both)
    alone = FrameBeams.build(both.replace(printed=np.array([False, True])))
    np.testing.assert_allclose(beams.solve()[2], alone.solve()[2], rtol=1e-12)


def test_unprinted_struts_follow_what_is_printed(curved_frame: Wireframe) -> None:
    top = curved_frame.vertices[:, 2] > 30.0
    printed = ~top[curved_frame.edges].any(axis=1)
    plan = curved_frame.replace(printed=printed)
    found = sag(plan)
    assert displacement(found, plan)[printed].max() == pytest.approx(0.07 * plan.printed_part()[0].extent, rel=1e-5)
    np.testing.assert_array_equal(found.vertices[top], plan.vertices[top])
    change = found.control_points - plan.control_points
    blend = bezier.straight(change[:, 0], change[:, 3])
    np.testing.assert_allclose(change[~printed], blend[~printed], atol=1e-9)
    untouched = top[plan.edges].all(axis=1)
    np.testing.assert_array_equal(found.control_points[untouched], plan.control_points[untouched])
    joints = interface_vertices(plan) & ~plan.grounded
    assert np.all(np.linalg.norm((found.vertices - plan.vertices)[joints], axis=1) > 0.0)


def test_progress_is_told_and_can_stop(straight_frame: Wireframe) -> None:
    seen: list[Progress] = []
    sag(straight_frame, progress=lambda p: seen.append(p))
    assert [p.iteration for p in seen] == [0, 1, 2, 3]
    with pytest.raises(Cancelled):
        sag(straight_frame, progress=lambda p: p.iteration < 1)


def test_loose_struts_are_counted() -> None:
    frame = Wireframe.create([[0, 0, 0], [9, 0, 5], [0, 9, 9], [9, 9, 9]], [[0, 1], [2, 3]], name="plan.json")
    with pytest.raises(InputError, match=r"plan\.json: edges: 1 printed struts have no connection"):
        sag(frame)
    with pytest.raises(InputError, match="grounded"):
        sag(frame.replace(grounded=np.zeros(4, dtype=bool)))


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: SagSettings(peak=-1.0), "peak"),
        (lambda: SagSettings(peak=float("nan")), "peak"),
        (lambda: SagSettings(peak_fraction=0.0), "peak_fraction"),
        (lambda: SagSettings(pieces=0), "pieces"),
        (lambda: SagSettings(seed=-1), "seed"),
        (lambda: Hardening(unhardened_fraction=1.5), "unhardened_fraction"),
        (lambda: Hardening(unhardened_sag=(0.2, 0.1)), "unhardened_sag"),
        (lambda: Hardening(unhardened_stiffness=(0.0, 0.1)), "unhardened_stiffness"),
        (lambda: Hardening(softest_axial=0.0), "softest_axial"),
        (lambda: Hardening(longest_span=-2.0), "longest_span"),
        (lambda: sag(rod((50.0, 0.0, 0.0)), SagSettings(peak=1e4)), "peak"),
    ],
)
def test_bad_settings_are_refused(build: Callable[[], object], field: str) -> None:
    with pytest.raises(InputError, match=field):
        build()
