"""The wireframe: what it fills in, what it refuses, and what it computes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe, straight_control_points

TRIANGLE = ([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 40.0, 0.0]], [[0, 1], [1, 2], [2, 0]])


def test_defaults() -> None:
    frame = Wireframe.create(*TRIANGLE)
    np.testing.assert_array_equal(frame.radius, 0.06 * 40.0)  # lengths 30, 40, 50
    assert frame.printed.all() and frame.printed.dtype == bool
    assert frame.batch.tolist() == [0, 0, 0] and frame.batch.dtype == np.int64
    assert frame.edges.dtype == np.int64
    np.testing.assert_allclose(frame.control_points[0], [[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0]], atol=1e-13)
    assert frame.is_straight
    assert (frame.strut_count, frame.vertex_count, frame.name) == (3, 3, "frame")


@pytest.mark.parametrize(
    ("heights", "grounded"),
    [
        ([0.0, 0.4, 0.6, 100.0], [True, True, False, False]),  # half a millimetre
        ([-0.01, 0.4, 2.9, 1000.0], [True, True, True, False]),  # 0.3 % of the height
        ([7.0, 7.0, 7.0, 8.0], [True, True, True, False]),
    ],
)
def test_grounded_by_default(heights: list[float], grounded: list[bool]) -> None:
    vertices = [[10.0 * i, 0.0, z] for i, z in enumerate(heights)]
    frame = Wireframe.create([*vertices, [0, 0, -500]], [[0, 1], [1, 2], [2, 3]])  # the last one is unused
    assert frame.grounded[:4].tolist() == grounded


def test_arrays_are_copied_and_read_only() -> None:
    vertices = np.array(TRIANGLE[0])
    frame = Wireframe.create(vertices, TRIANGLE[1])
    vertices[0] = 99.0
    assert frame.vertices[0].tolist() == [0.0, 0.0, 0.0]
    for name in ("vertices", "edges", "control_points", "radius", "printed", "grounded", "batch"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(frame, name)[0] = 0


def test_curve_ends_are_snapped_to_the_vertices() -> None:
    frame = Wireframe.create(*TRIANGLE)
    curves = frame.control_points + 1e-8
    assert np.array_equal(frame.replace(control_points=curves).control_points[:, [0, 3]], frame.vertices[frame.edges])


BAD = {
    "nan": ({"vertices": [[0, 0, 0], [30, float("nan"), 0], [0, 40, 0]]}, "vertices[1][1]"),
    "infinite": ({"vertices": [[0, 0, 0], [30, 0, 0], [0, float("inf"), 0]]}, "vertices[2][1]"),
    "flat vertices": ({"vertices": [[0, 0], [30, 0], [0, 40]]}, "vertices"),
    "ragged vertices": ({"vertices": [[0, 0, 0], [30, 0], [0, 40, 0]]}, "vertices"),
    "text": ({"vertices": "vertices"}, "vertices"),
    "no vertices": ({"vertices": None}, "vertices"),
    "empty vertices": ({"vertices": []}, "vertices"),
    "index too large": ({"edges": [[0, 1], [1, 3]]}, "edges[1]"),
    "index negative": ({"edges": [[0, 1], [-1, 2]]}, "edges[1]"),
    "index beyond 64 bits": ({"edges": [[0, 10**20]]}, "edges"),
    "index not whole": ({"edges": [[0, 1.5]]}, "edges"),
    "index a boolean": ({"edges": [[0, True]]}, "edges"),
    "self-loop": ({"edges": [[0, 1], [2, 2]]}, "edges[1]"),
    "duplicate": ({"edges": [[0, 1], [1, 2], [0, 1]]}, "edges[2]"),
    "duplicate the other way": ({"edges": [[0, 1], [1, 2], [1, 0]]}, "edges[2]"),
    "no strut": ({"edges": []}, "edges"),
    "no length": ({"vertices": [[0, 0, 0], [30, 0, 0], [0, 0, 0]]}, "edges[2]"),
    "radius zero": ({"radius": [1.0, 0.0, 1.0]}, "radius[1]"),
    "radius negative": ({"radius": -1.0}, "radius[0]"),
    "radius ragged": ({"radius": [1.0, [1.0], 1.0]}, "radius"),
    "radius too few": ({"radius": [1.0, 1.0]}, "radius"),
    "radius a boolean": ({"radius": True}, "radius"),
    "printed numbers": ({"printed": [1, 0, 1]}, "printed"),
    "printed too many": ({"printed": [True] * 4}, "printed"),
    "grounded too few": ({"grounded": [True]}, "grounded"),
    "batch not whole": ({"batch": [0.5, 1.0, 2.0]}, "batch"),
    "curves too few": ({"control_points": np.zeros((2, 4, 3))}, "control_points"),
    "curves off the vertices": ({"control_points": np.zeros((3, 4, 3))}, "control_points[0][3]"),
    "name": ({"name": " "}, "name"),
}


@pytest.mark.parametrize(("change", "field"), BAD.values(), ids=BAD.keys())
def test_refused(change: dict, field: str) -> None:
    arguments = {"vertices": TRIANGLE[0], "edges": TRIANGLE[1], "source": "plan.json", **change}
    with pytest.raises(InputError) as caught:
        Wireframe.create(**arguments)
    message = str(caught.value)
    assert message.startswith(f"plan.json: {field}: ")
    assert message.endswith(".") and "\n" not in message


def test_lengths_of_curves(straight_frame: Wireframe) -> None:
    np.testing.assert_allclose(straight_frame.lengths, straight_frame.chord_lengths, rtol=1e-12)
    # A quarter of a circle by the usual cubic: radial error 2.7e-4, so the length is right to about as much.
    k = 4.0 / 3.0 * (np.sqrt(2.0) - 1.0)
    curve = 10.0 * np.array([[[1, 0, 0], [1, k, 0], [k, 1, 0], [0, 1, 0]]])
    arc = Wireframe.create(curve[0, [0, 3]], [[0, 1]], control_points=curve)
    assert arc.lengths[0] == pytest.approx(10.0 * np.pi / 2.0, rel=3e-4)
    assert arc.chord_lengths[0] == pytest.approx(10.0 * np.sqrt(2.0))
    assert arc.radius[0] == pytest.approx(0.06 * arc.lengths[0])
    assert not arc.is_straight


def test_bounds_and_degree(straight_frame: Wireframe) -> None:
    assert straight_frame.bounds.tolist() == [[0, 0, 0], [20, 20, 40]]
    assert straight_frame.extent == 40.0
    assert straight_frame.degree.sum() == 2 * straight_frame.strut_count
    assert straight_frame.degree[:4].tolist() == [2, 2, 2, 2]


def test_subset_keeps_what_belongs_to_the_struts(curved_frame: Wireframe) -> None:
    rng = np.random.default_rng(0)
    frame = curved_frame.replace(
        radius=rng.uniform(1, 2, curved_frame.strut_count), batch=rng.integers(0, 9, curved_frame.strut_count)
    )
    mask = rng.random(frame.strut_count) < 0.4
    part, vertex_ids = frame.subset(mask)
    assert np.array_equal(vertex_ids[part.edges], frame.edges[mask])
    assert np.array_equal(part.vertices, frame.vertices[vertex_ids])
    for name in ("control_points", "radius", "batch"):
        assert np.array_equal(getattr(part, name), getattr(frame, name)[mask])
    assert part.degree.min() >= 1
    with pytest.raises(InputError, match="no strut"):
        frame.subset(np.zeros(frame.strut_count, dtype=bool))


def test_print_state(straight_frame: Wireframe) -> None:
    lower = straight_frame.vertices[straight_frame.edges, 2].max(axis=1) <= 20.0
    frame = straight_frame.replace(printed=lower)
    part, edge_ids, vertex_ids = frame.printed_part()
    assert part.printed.all() and np.array_equal(edge_ids, np.flatnonzero(lower))
    assert np.array_equal(vertex_ids, np.flatnonzero(frame.vertices[:, 2] <= 20.0))
    assert np.array_equal(frame.printed_vertices(), frame.vertices[:, 2] <= 20.0)
    with pytest.raises(InputError, match="printed"):
        frame.replace(printed=np.zeros(frame.strut_count, dtype=bool)).printed_part()


def test_components_against_a_search_by_hand() -> None:
    rng = np.random.default_rng(1)
    vertices = rng.random((120, 3))
    pairs = np.array(list(itertools.combinations(range(120), 2)))
    frame = Wireframe.create(vertices, pairs[rng.choice(len(pairs), 70, replace=False)])
    count, labels = frame.components()

    neighbours: dict[int, set[int]] = {v: set() for v in range(120)}
    for a, b in frame.edges.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    parts = set()
    for start in range(120):
        part, stack = {start}, [start]
        while stack:
            fresh = neighbours[stack.pop()] - part
            part |= fresh
            stack += fresh
        if len(part) > 1:
            parts.add(frozenset(part))
    found = {frozenset(np.flatnonzero(labels == label).tolist()) for label in range(count)}
    assert found == parts
    assert np.array_equal(labels < 0, frame.degree == 0)


def test_components_of_a_long_chain() -> None:
    order = np.random.default_rng(2).permutation(500)  # the worst order of roots that chance finds
    vertices = np.random.default_rng(3).random((500, 3))
    assert Wireframe.create(vertices, np.column_stack([order[:-1], order[1:]])).components()[0] == 1


def test_transformed_by_a_similarity(curved_frame: Wireframe) -> None:
    rng = np.random.default_rng(4)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 2.5 * rotation, [1.0, -2.0, 3.0]
    moved = curved_frame.transformed(matrix)
    np.testing.assert_allclose(moved.lengths, 2.5 * curved_frame.lengths, rtol=1e-12)
    np.testing.assert_allclose(moved.radius, 2.5 * curved_frame.radius, rtol=1e-12)
    back = moved.transformed(np.linalg.inv(matrix))
    np.testing.assert_allclose(back.control_points, curved_frame.control_points, atol=1e-12)
    for bad in (np.zeros((4, 4)), np.diag([1.0, 1.0, 0.0, 1.0]), np.eye(3), np.full((4, 4), np.nan)):
        with pytest.raises(InputError, match="matrix"):
            curved_frame.transformed(bad)


def test_replace_checks_again(straight_frame: Wireframe) -> None:
    with pytest.raises(InputError, match="control_points"):
        straight_frame.replace(vertices=straight_frame.vertices + 1.0)
    moved = straight_frame.vertices + 1.0
    frame = straight_frame.replace(vertices=moved, control_points=straight_control_points(moved, straight_frame.edges))
    assert frame.is_straight and frame.bounds[0].tolist() == [1.0, 1.0, 1.0]
