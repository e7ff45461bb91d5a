"""Block matrices of frames and their factors, against dense matrices and those of numpy and scipy."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
from scipy import sparse

from frametwin.fitting.elastic import ElasticFrame
from frametwin.geometry.parametric import named_frame
from frametwin.mechanics.beams import assemble, factorise
from frametwin.mechanics.block_kernels import TASKS
from frametwin.mechanics.blocks import ALL, LAST, BlockMatrix, BlockPattern


def graph(kind: str) -> tuple[np.ndarray, int]:
    """Edges (N, 2) between so many joints."""
    graphs = {
        "lone joint": nx.empty_graph(1),
        "no struts": nx.empty_graph(4),
        "one strut": nx.path_graph(2),
        "chain": nx.path_graph(30),
        "star": nx.star_graph(20),
        "ring": nx.cycle_graph(17),
        "two pieces": nx.disjoint_union(nx.cycle_graph(5), nx.star_graph(4)),
        "grid": nx.convert_node_labels_to_integers(nx.grid_graph([5, 4, 6])),
        "all with all": nx.complete_graph(14),
        "tangle": nx.gnm_random_graph(60, 300, seed=4),
    }
    made = graphs[kind]
    edges = np.array(made.edges(), dtype=np.int64).reshape(-1, 2)
    rng = np.random.default_rng(3)
    renamed = rng.permutation(made.number_of_nodes())[edges]
    turned = rng.random(len(edges)) < 0.5
    return np.where(turned[:, None], renamed[:, ::-1], renamed), made.number_of_nodes()


KINDS = (
    "lone joint",
    "no struts",
    "one strut",
    "chain",
    "star",
    "ring",
    "two pieces",
    "grid",
    "all with all",
    "tangle",
)


def elements_of(count: int, seed: int = 0) -> np.ndarray:
    """(N, 12, 12) positive semi-definite matrices."""
    root = np.random.default_rng(seed).normal(size=(count, 12, 7))
    return root @ root.transpose(0, 2, 1)


def dense(elements: np.ndarray, edges: np.ndarray, count: int) -> np.ndarray:
    """(6V, 6V): the sum, entry by entry."""
    result = np.zeros((6 * count, 6 * count))
    for element, ends in zip(elements, edges, strict=True):
        rows = [6 * joint + k if joint >= 0 else -1 for joint in ends for k in range(6)]
        for a, row in enumerate(rows):
            for b, column in enumerate(rows):
                if row >= 0 and column >= 0:
                    result[row, column] += element[a, b]
    return result


def by_columns(pattern: BlockPattern, entries: np.ndarray) -> sparse.csc_matrix:
    """As scipy has it."""
    return sparse.csc_matrix(BlockMatrix(pattern, entries).toarray())


@pytest.mark.parametrize("kind", KINDS)
def test_sums_elements(kind: str) -> None:
    edges, count = graph(kind)
    pattern, elements = BlockPattern.of(edges, count), elements_of(len(edges))
    matrix = BlockMatrix(pattern, pattern.summed(elements))
    np.testing.assert_allclose(matrix.toarray(), dense(elements, edges, count), atol=1e-12)
    np.testing.assert_array_equal(np.diagonal(matrix.toarray()), matrix.diagonal)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sides", [None, 1, 9])
def test_multiplies(kind: str, sides: int | None) -> None:
    edges, count = graph(kind)
    rng = np.random.default_rng(5)
    pattern, elements = BlockPattern.of(edges, count), rng.normal(size=(len(edges), 12, 12))  # not symmetric
    right = rng.normal(size=6 * count if sides is None else (6 * count, sides))
    matrix, shift = BlockMatrix(pattern, pattern.summed(elements)), rng.normal(size=6 * count)
    whole = dense(elements, edges, count)
    np.testing.assert_allclose(matrix @ right, whole @ right, atol=1e-11)
    np.testing.assert_allclose(np.float64(0.5) * matrix @ right, 0.5 * (whole @ right), atol=1e-11)
    both = matrix.plus_diagonal(shift) + matrix
    np.testing.assert_allclose(both @ right, (2.0 * whole + np.diag(shift)) @ right, atol=1e-11)
    short = matrix @ right.astype(np.float32)
    assert short.dtype == np.float32
    np.testing.assert_allclose(short, whole @ right, atol=1e-4)


def test_leaves_out_ends_that_are_held() -> None:
    edges = np.array([[0, 1], [-1, 0], [1, -1], [-1, -1]])
    pattern, elements = BlockPattern.of(edges, 2), elements_of(4)
    whole = dense(elements, edges, 2)
    np.testing.assert_allclose(BlockMatrix(pattern, pattern.summed(elements)).toarray(), whole, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sides", [None, 1, 9])
def test_solves(kind: str, sides: int | None) -> None:
    edges, count = graph(kind)
    pattern, elements = BlockPattern.of(edges, count), elements_of(len(edges))
    entries = pattern.summed(elements)
    entries[pattern.diagonal] += 0.5
    matrix = BlockMatrix(pattern, entries).toarray()
    right = np.random.default_rng(1).normal(size=6 * count if sides is None else (6 * count, sides))
    found = pattern.elimination.factorise(entries).solve(right)
    assert found.shape == right.shape
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("pivot", [0.5, np.nan])
def test_one_thread_finds_the_very_factors_that_several_find(kind: str, pivot: float) -> None:
    edges, count = graph(kind)
    pattern = BlockPattern.of(edges, count)
    entries = pattern.summed(elements_of(len(edges)))
    entries[pattern.diagonal] += 0.5
    entries[pattern.own[0, 0, 0]] += pivot
    if np.isfinite(pivot):
        one, several = (BlockMatrix(pattern, entries).factorise(alone) for alone in (True, False))
        np.testing.assert_array_equal(one.pivots, several.pivots)
        right = np.ones(6 * count)
        np.testing.assert_array_equal(one.solve(right), several.solve(right))
        return
    for alone in (True, False):
        with pytest.raises(RuntimeError, match="singular"):
            pattern.elimination.factorise(entries, alone)


@pytest.mark.parametrize("kind", KINDS)
def test_tasks_share_whole_subtrees_of_fronts(kind: str) -> None:
    edges, count = graph(kind)
    order = BlockPattern.of(edges, count).elimination
    fronts = order.fronts[: order.sizes[0]]
    assert [*ALL] == [*range(TASKS), *LAST]
    for parent, task in fronts[:, [2, 4]]:
        assert -1 <= task < TASKS
        assert parent < 0 or order.fronts[parent, 4] in (task, -1)


def test_is_as_exact_as_superlu_where_stiffnesses_differ_by_ten_orders() -> None:
    elastic = ElasticFrame(named_frame("half_bowl"))
    pattern = BlockPattern.of(elastic.edges, elastic.vertex_count)
    factor = 10.0 ** np.random.default_rng(2).uniform(-5.0, 5.0, len(elastic.edges))
    entries = pattern.summed(factor[:, None, None] * elastic.stiffness)
    entries[pattern.diagonal] += 1e-6 * entries[pattern.diagonal].mean()
    matrix, right = by_columns(pattern, entries), np.random.default_rng(3).normal(size=6 * elastic.vertex_count)
    ours = pattern.elimination.factorise(entries).solve(right)
    theirs = factorise(matrix).solve(right)
    off, bound = (np.abs(matrix @ x - right).max() for x in (ours, theirs))
    assert off <= 10.0 * bound
    np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-8 * np.abs(theirs).max())


def test_needs_no_positive_pivots() -> None:
    edges, count = graph("grid")
    pattern = BlockPattern.of(edges, count)
    entries = -pattern.summed(elements_of(len(edges)))
    entries[pattern.diagonal] -= 0.5
    right = np.ones(6 * count)
    found = pattern.elimination.factorise(entries).solve(right)
    np.testing.assert_allclose(BlockMatrix(pattern, entries) @ found, right, atol=1e-9)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_tells_of_a_pivot_that_cannot_be_divided_by(value: float) -> None:
    edges, count = graph("two pieces")
    pattern = BlockPattern.of(edges, count)
    entries = pattern.summed(elements_of(len(edges)))
    entries[pattern.diagonal] += 1.0
    entries[pattern.own[3]] = 0.0
    entries[pattern.own[3, 2, 2]] = value
    with pytest.raises(RuntimeError, match="singular"):
        pattern.elimination.factorise(entries)


def test_no_joints_have_factors_too() -> None:
    pattern = BlockPattern.of(np.zeros((0, 2), dtype=np.int64), 0)
    found = pattern.elimination.factorise(pattern.summed(np.zeros((0, 12, 12)))).solve(np.zeros(0))
    assert found.shape == (0,)


@pytest.mark.parametrize("kind", ["chain", "star", "grid", "tangle"])
def test_fills_in_no_more_than_superlu(kind: str) -> None:
    edges, count = graph(kind)
    pattern, elements = BlockPattern.of(edges, count), elements_of(len(edges))
    entries = pattern.summed(elements)
    entries[pattern.diagonal] += 1.0
    ours = np.count_nonzero(pattern.elimination.factorise(entries).factors)
    theirs = factorise(by_columns(pattern, entries)).L.nnz
    assert ours < 1.35 * theirs  # of blocks on the diagonal both triangles are kept


def test_sums_what_beams_sum() -> None:
    edges, count = graph("tangle")
    pattern, elements = BlockPattern.of(edges, count), elements_of(len(edges))
    ours = by_columns(pattern, pattern.summed(elements))
    assert abs(ours - assemble(elements, edges, count)).max() < 1e-12
