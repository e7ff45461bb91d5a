"""Rigid motions, smooth warps and pushed tops, and struts that are missing."""

from __future__ import annotations

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.displacement import largest_displacement
from frametwin.geometry.wireframe import Wireframe
from frametwin.mechanics.deformations import deform, random_rigid_motion, rigid_motion, smooth_warp, tip_load
from frametwin.mechanics.hardening import Hardening
from frametwin.mechanics.sag import SagSettings, sag
from frametwin.simulation.defects import drop_struts

FINE = np.linspace(0.0, 1.0, 401)


def largest(frame: Wireframe, plan: Wireframe) -> float:
    moved = bezier.evaluate(frame.control_points - plan.control_points, FINE)
    return float(np.linalg.norm(moved, axis=2).max())


def test_rigid_motion_turns_and_shifts_every_point(curved_frame: Wireframe) -> None:
    found = rigid_motion(curved_frame, 90.0, (1.0, 2.0, 3.0))
    centre = curved_frame.bounds.mean(axis=0)
    local = bezier.evaluate(curved_frame.control_points, FINE) - centre
    expected = np.stack([-local[..., 1], local[..., 0], local[..., 2]], axis=-1) + centre + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(bezier.evaluate(found.control_points, FINE), expected, atol=1e-9)
    np.testing.assert_allclose(found.lengths, curved_frame.lengths, rtol=1e-12)
    np.testing.assert_array_equal(found.radius, curved_frame.radius)


def test_rigid_motion_about_any_axis(curved_frame: Wireframe) -> None:
    there = rigid_motion(curved_frame, (10.0, -20.0, 5.0), (3.0, 0.0, -1.0))
    distance = np.linalg.norm(there.vertices[:, None] - there.vertices, axis=2)
    before = np.linalg.norm(curved_frame.vertices[:, None] - curved_frame.vertices, axis=2)
    np.testing.assert_allclose(distance, before, atol=1e-9)
    unmoved = rigid_motion(curved_frame)
    np.testing.assert_allclose(unmoved.control_points, curved_frame.control_points, atol=1e-12)


@pytest.mark.parametrize("fields", [{"rotation_deg": (1.0, 2.0)}, {"shift": (np.nan, 0.0, 0.0)}])
def test_rigid_motion_refuses(fields: dict, straight_frame: Wireframe) -> None:
    with pytest.raises(InputError, match=next(iter(fields))):
        rigid_motion(straight_frame, **fields)


def test_warp_has_its_peak_and_holds_the_ground(curved_frame: Wireframe) -> None:
    found = smooth_warp(curved_frame, 2.5, seed=3)
    assert largest(found, curved_frame) == pytest.approx(2.5, rel=1e-5)
    held = curved_frame.grounded
    np.testing.assert_array_equal(found.vertices[held], curved_frame.vertices[held])
    assert np.linalg.norm((found.vertices - curved_frame.vertices)[~held], axis=1).min() > 0.0


def test_warp_is_smooth_and_one_field_for_all(straight_frame: Wireframe) -> None:
    """Struts cut into two halves are warped as the whole ones are, so the field depends on place alone."""
    middle = bezier.evaluate(straight_frame.control_points, [0.5])[:, 0]
    count, edges = straight_frame.vertex_count, straight_frame.edges
    centres = count + np.arange(len(edges))
    halves = Wireframe.create(
        np.concatenate([straight_frame.vertices, middle]),
        np.concatenate([np.stack([edges[:, 0], centres], 1), np.stack([centres, edges[:, 1]], 1)]),
        radius=1.0,
        grounded=np.concatenate([straight_frame.grounded, np.zeros(len(edges), dtype=bool)]),
    )
    whole, cut = smooth_warp(straight_frame, 2.0, seed=1), smooth_warp(halves, 2.0, seed=1)
    np.testing.assert_allclose(cut.vertices[:count], whole.vertices, atol=0.02)
    np.testing.assert_allclose(cut.vertices[count:], bezier.evaluate(whole.control_points, [0.5])[:, 0], atol=0.1)
    stretch = whole.lengths / straight_frame.lengths
    assert 0.7 < stretch.min() < stretch.max() < 1.3


def test_warp_follows_its_seed(straight_frame: Wireframe) -> None:
    first, again, other = (smooth_warp(straight_frame, 1.0, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(first.control_points, again.control_points)
    assert not np.array_equal(first.control_points, other.control_points)
    with pytest.raises(InputError, match="peak"):
        smooth_warp(straight_frame, 0.0)


@pytest.mark.parametrize("direction", [0.0, 135.0])
def test_pushed_top_leans_the_way_it_is_pushed(direction: float, straight_frame: Wireframe) -> None:
    settings = SagSettings(peak=3.0, hardening=Hardening(unhardened_fraction=0.0))
    found = tip_load(straight_frame, settings, direction_deg=direction)
    assert largest(found, straight_frame) == pytest.approx(3.0, rel=1e-5)
    top = straight_frame.vertices[:, 2] > 39.0
    moved = (found.vertices - straight_frame.vertices)[top].mean(axis=0)
    towards = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    assert moved[:2] @ towards > 0.9 * np.linalg.norm(moved)
    held = straight_frame.grounded
    np.testing.assert_array_equal(found.vertices[held], straight_frame.vertices[held])


def test_pushed_rod_bends_like_a_cantilever_with_an_end_load() -> None:
    rod = Wireframe.create([[0, 0, 0], [0, 0, 60.0]], [[0, 1]], radius=1.0)
    settings = SagSettings(peak=0.01, hardening=Hardening(unhardened_fraction=0.0))
    moved = bezier.evaluate(tip_load(rod, settings).control_points - rod.control_points, FINE)[0]
    np.testing.assert_allclose(moved[:, 0], 0.01 * FINE**2 * (3.0 - FINE) / 2.0, atol=1e-6)


def test_a_top_that_is_held_cannot_be_pushed() -> None:
    arch = Wireframe.create([[0, 0, 0], [0, 0, 9.0]], [[0, 1]], radius=1.0, grounded=[True, True])
    with pytest.raises(InputError, match="grounded"):
        tip_load(arch)


def test_dropped_struts_lose_their_share(curved_frame: Wireframe) -> None:
    present, dropped = drop_struts(curved_frame, 6, seed=1, share=0.5)
    assert present.shape == (curved_frame.strut_count, 2)
    assert len(np.unique(dropped)) == 6
    others = np.setdiff1d(np.arange(curved_frame.strut_count), dropped)
    np.testing.assert_array_equal(present[others], np.tile([0.0, 1.0], (len(others), 1)))
    for k in dropped:
        low, high = present[k]
        assert (low == 0.0) != (high == 1.0)
        piece = bezier.split(curved_frame.control_points[k], low or high)[0 if low == 0.0 else 1]
        assert bezier.arc_length(piece) == pytest.approx(0.5 * curved_frame.lengths[k], rel=1e-3)


def test_dropped_struts_can_be_gone_entirely(straight_frame: Wireframe) -> None:
    present, dropped = drop_struts(straight_frame, 3, share=1.0)
    np.testing.assert_array_equal(present[dropped], 0.0)
    assert len(drop_struts(straight_frame, 0)[1]) == 0


def test_only_printed_struts_are_dropped_and_counted(straight_frame: Wireframe) -> None:
    printed = np.arange(straight_frame.strut_count) % 3 == 0
    frame = straight_frame.replace(printed=printed)
    present, dropped = drop_struts(frame, 5, seed=2)
    assert printed[dropped].all()
    np.testing.assert_array_equal(present[~printed], 0.0)
    with pytest.raises(InputError, match="missing"):
        drop_struts(frame, int(printed.sum()) + 1)
    for share in (0.0, 1.5):
        with pytest.raises(InputError, match="share"):
            drop_struts(frame, 1, share=share)


def test_no_piece_is_left_hanging_in_the_air() -> None:
    star = Wireframe.create([[0, 0, 0], [9, 0, 9], [0, 9, 9], [-9, 0, 9], [0, -9, 9]], [[0, 1], [2, 0], [0, 3], [4, 0]])
    for seed in range(6):
        present, dropped = drop_struts(star, 4, seed=seed, share=0.3)
        np.testing.assert_allclose(present[[0, 2]], [[0.0, 0.7]] * 2, atol=1e-9)
        np.testing.assert_allclose(present[[1, 3]], [[0.3, 1.0]] * 2, atol=1e-9)
        assert dropped.tolist() == [0, 1, 2, 3]


def test_drawing_follows_the_seed(straight_frame: Wireframe) -> None:
    first, again, other = (drop_struts(straight_frame, 4, seed=seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first[0], again[0])
    assert not np.array_equal(first[0], other[0])


def test_deformations_go_by_name(straight_frame: Wireframe) -> None:
    settings = SagSettings(peak=3.0, seed=5)
    for kind, expected in {
        "sag": sag(straight_frame, settings),
        "tip-load": tip_load(straight_frame, settings, direction_deg=30.0),
        "warp": smooth_warp(straight_frame, 3.0, 5),
        "rigid": random_rigid_motion(straight_frame, 3.0, 5),
    }.items():
        found = deform(straight_frame, kind, settings, direction_deg=30.0)
        np.testing.assert_array_equal(found.control_points, expected.control_points)
        assert largest_displacement(found.control_points - straight_frame.control_points) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="not 'melt'"):
        deform(straight_frame, "melt", settings)
