"""Compiled loops of beams, against the same elements written out, and against the deflections of beams."""

from __future__ import annotations

import networkx as nx
import numpy as np
from numpy.polynomial.legendre import leggauss

from frametwin.compiled.kept_loops import KeptLoops
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.mechanics.beams import Sections, displacement_along, element_loads, element_stiffness
from frametwin.mechanics.blocks import BlockPattern
from frametwin.printing.process.creep import BUBBLE

loops = KeptLoops("frametwin.mechanics.beam_kernels")


def some_beams(seed: int) -> tuple[np.ndarray, np.ndarray, Sections, np.ndarray, np.ndarray]:
    """Joints, edges, sections, even loads, and movements of the joints of a frame."""
    rng, frame = np.random.default_rng(seed), named_frame("bridge")
    points = frame.vertices + rng.normal(size=frame.vertices.shape)
    sections = Sections(*(np.exp(rng.normal(size=(3, frame.strut_count))) * np.array([[10.0], [900.0], [700.0]])))
    moved = 0.1 * rng.normal(size=(frame.vertex_count, 6))
    return points, np.array(frame.edges), sections, rng.normal(size=(frame.strut_count, 3)), moved


def bows(points: np.ndarray, edges: np.ndarray, sections: Sections, load: np.ndarray, moved: np.ndarray) -> np.ndarray:
    found = np.empty((len(edges), 2, 3))
    loops.bows(points, edges, sections.bending, load, moved, np.array([BUBBLE]), found)
    return found


def test_the_sum_is_that_of_elements_and_their_loads() -> None:
    points, edges, sections, load, _ = some_beams(0)
    held = 3
    place = np.arange(len(points)) - held  # the first joints are held
    pattern = BlockPattern.of(np.where(place[edges] < 0, -1, place[edges]), len(points) - held)
    entries, force = np.full(36 * len(pattern.rows) + 1, 7.0), np.full(6 * len(points), 7.0)
    parts = np.stack([sections.axial, sections.bending, sections.twisting])
    loops.assemble(points, edges, parts, load, pattern.slots, entries, force)
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    matrix = pattern.summed(element_stiffness(start, end, sections))
    np.testing.assert_allclose(entries[:-1], matrix, atol=1e-12 * np.abs(matrix).max())
    loads = np.zeros((len(points), 6))
    np.add.at(loads, edges, element_loads(start, end, load).reshape(-1, 2, 6))
    np.testing.assert_allclose(force.reshape(-1, 6), loads, atol=1e-12 * np.abs(loads).max())


def test_without_load_a_beam_bows_as_its_ends_turn() -> None:
    """The deflection of an unloaded beam is a cubic, so that a cubic curve has it exactly."""
    points, edges, sections, load, moved = some_beams(1)
    ends = moved[edges]
    share = np.array([0.0, 1.0, 2.0, 3.0])[:, None] / 3.0
    curves = (1.0 - share) * ends[:, :1, :3] + share * ends[:, 1:, :3]
    curves[:, 1:3] += bows(points, edges, sections, 0.0 * load, moved)
    at = np.linspace(0.0, 1.0, 9)
    both = np.broadcast_to(at, (len(edges), 9))
    exact = displacement_along(points[edges], ends.reshape(-1, 12), sections, 0.0 * load, both)
    for curve, deflection in zip(curves, exact, strict=True):
        np.testing.assert_allclose(bezier.evaluate(curve, at), deflection, atol=1e-12)


def test_a_load_bows_a_clamped_beam_like_the_nearest_parabola() -> None:
    """The least squares fit of c x (1 - x) to the deflection across the beam, which is 3 x (1 - x) times the bow."""
    points, edges, sections, load, moved = some_beams(2)
    found = bows(points, edges, sections, load, 0.0 * moved)
    nodes, weights = leggauss(8)
    at, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    axis = points[edges[:, 1]] - points[edges[:, 0]]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    across = load - np.sum(load * axis, axis=1, keepdims=True) * axis
    both = np.broadcast_to(at, (len(edges), 8))
    deflection = displacement_along(points[edges], np.zeros((len(edges), 12)), sections, across, both)
    parabola = 3.0 * at * (1.0 - at)
    nearest = np.einsum("s,s,nsi->ni", weights, parabola, deflection) / np.sum(weights * parabola**2)
    np.testing.assert_allclose(found, np.stack([nearest, nearest], axis=1), atol=1e-9 * np.abs(nearest).max())


def test_what_hangs_in_the_air_is_told_from_what_stands() -> None:
    rng = np.random.default_rng(4)
    for joints, beams in ((1, 0), (2, 1), (12, 8), (60, 40), (60, 55), (200, 230)):
        edges = rng.integers(0, joints, (beams, 2))
        held = rng.uniform(size=joints) < 0.1
        found = np.empty(beams, dtype=bool)
        loops.reached(edges, held, found)
        pieces = nx.Graph()
        pieces.add_nodes_from(range(joints))
        pieces.add_edges_from(edges.tolist())
        standing = set().union(*(piece for piece in nx.connected_components(pieces) if held[list(piece)].any()))
        assert found.tolist() == [int(start) in standing for start, _ in edges]
