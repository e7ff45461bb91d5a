"""The project's own frames: what their descriptions promise, and the files made from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.parametric import FRAMES, arched_bridge, half_bowl, lattice_tower, named_frame
from frametwin.geometry.wireframe import Wireframe

FOLDER = Path(__file__).resolve().parent.parent / "datasets" / "frames"
COUNTS = {"bridge": 76, "half_bowl": 156, "lattice_tower": 804}
LONGEST_SIDE = {"bridge": 200.0, "half_bowl": 152.0, "lattice_tower": 250.0}
VARIANTS = [
    *(make() for make in FRAMES.values()),
    arched_bridge(4),
    arched_bridge(10),
    half_bowl(5, 1),
    half_bowl(16, 6),
    lattice_tower(1),
    lattice_tower(4),
]


@pytest.fixture(params=VARIANTS, ids=repr)
def frame(request: pytest.FixtureRequest) -> Wireframe:
    return request.param


def test_frames_stand_on_the_ground_and_are_connected(frame: Wireframe) -> None:
    assert frame.components()[0] == 1
    assert frame.degree.min() >= 3
    lowest = frame.vertices[:, 2].min()
    assert lowest == 0.0
    np.testing.assert_array_equal(frame.grounded, frame.vertices[:, 2] == 0.0)
    assert frame.grounded.sum() >= 4


@pytest.mark.parametrize("name", FRAMES)
def test_lengths_can_be_printed(name: str) -> None:
    frame = named_frame(name)
    assert frame.lengths.min() > 14.0 and frame.lengths.max() < 45.0
    assert (frame.radius * 8.0 < frame.lengths).all()


def nearest_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least distance between pairs of polylines (P, S, 3), between points of one and pieces of the other."""
    start, along = b[:, :-1], np.diff(b, axis=1)
    offset = a[:, :, None] - start[:, None]  # (P, S, S - 1, 3)
    share = np.sum(offset * along[:, None], axis=-1) / np.sum(along**2, axis=-1)[:, None]
    gap = offset - np.clip(share, 0.0, 1.0)[..., None] * along[:, None]
    return np.linalg.norm(gap, axis=-1).min(axis=(1, 2))


def test_struts_touch_only_in_joints(frame: Wireframe) -> None:
    i, j = np.triu_indices(frame.strut_count, 1)
    apart = (frame.edges[i][:, :, None] != frame.edges[j][:, None, :]).all(axis=(1, 2))
    middles = frame.control_points.mean(axis=1)
    reach = 0.5 * frame.lengths
    near = np.linalg.norm(middles[i] - middles[j], axis=1) < reach[i] + reach[j] + 10.0
    i, j = i[apart & near], j[apart & near]
    curves = bezier.evaluate(frame.control_points, np.linspace(0.0, 1.0, 21))
    for part in np.array_split(np.arange(i.size), 1 + i.size // 4000):
        # The true gap ends at most half a spacing from a sampled point, so Pythagoras bounds it from below.
        spacing = frame.lengths[i[part]] / 20.0
        gap = nearest_between(curves[i[part]], curves[j[part]]) ** 2 - (spacing / 2.0) ** 2
        assert (gap > (frame.radius[i[part]] + frame.radius[j[part]]) ** 2).all()


def test_batches_can_be_printed_in_order(frame: Wireframe) -> None:
    reached = frame.grounded.copy()
    for batch in range(frame.batch.max() + 1):
        edges = frame.edges[frame.batch == batch]
        assert edges.size
        while len(edges):  # within a batch, whatever touches what is there comes first
            touching = reached[edges].any(axis=1)
            assert touching.any(), f"batch {batch} hangs in the air"
            reached[edges[touching]] = True
            edges = edges[~touching]
    assert reached.all()


@pytest.mark.parametrize("name", FRAMES)
def test_named_frames_have_the_size_they_are_known_for(name: str) -> None:
    frame = named_frame(name)
    assert frame.name == name
    assert frame.strut_count == COUNTS[name]
    np.testing.assert_allclose(frame.extent, LONGEST_SIDE[name], atol=1e-6)
    np.testing.assert_allclose(frame.radius, 0.06 * np.median(frame.lengths), atol=0.0051)


def test_the_bowl_lies_on_a_sphere_and_its_rings_are_round() -> None:
    frame = half_bowl()
    centre = np.array([0.0, 0.0, np.sqrt(76.0**2 - 30.0**2)])
    np.testing.assert_allclose(np.linalg.norm(frame.vertices - centre, axis=1), 76.0, atol=1e-5)
    level = frame.vertices[frame.edges[:, 0], 2] == frame.vertices[frame.edges[:, 1], 2]
    assert level.sum() == 5 * 12 and not frame.is_straight
    rings = bezier.evaluate(frame.control_points[level], np.linspace(0.0, 1.0, 33))
    radius = np.linalg.norm(rings[..., :2], axis=-1)
    # A cubic arc of 30 degrees is round to better than a millionth.
    np.testing.assert_allclose(radius, np.broadcast_to(radius[:, :1], radius.shape), rtol=1e-6)
    assert half_bowl().subset(~level)[0].is_straight


def test_the_bridge_is_the_same_from_both_sides_and_ends() -> None:
    frame = arched_bridge()
    for mirror in ((-1.0, 1.0, 1.0), (1.0, -1.0, 1.0)):
        mirrored = {tuple(v) for v in frame.vertices * mirror}
        assert mirrored == {tuple(v) for v in frame.vertices}
    assert frame.is_straight
    assert sorted(frame.vertices[frame.grounded, 0]) == [-100.0, -100.0, 100.0, 100.0]


@pytest.mark.parametrize("name", FRAMES)
def test_the_files_are_what_the_generators_make(name: str) -> None:
    made, stored = named_frame(name), read_frame(FOLDER / f"{name}.json")
    for field in ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch"):
        np.testing.assert_array_equal(getattr(stored, field), getattr(made, field), err_msg=field)
    assert stored.name == made.name


def test_what_cannot_be_built_is_refused() -> None:
    for make, values in ((arched_bridge, (7, 2, 0)), (half_bowl, (4,)), (lattice_tower, (0, -1))):
        for value in values:
            with pytest.raises(ValueError, match=r"needs"):
                make(value)
    with pytest.raises(InputError, match=r"castle.*bridge, half_bowl, lattice_tower"):
        named_frame("castle")
