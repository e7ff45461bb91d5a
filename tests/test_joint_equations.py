"""Equations between joints against a dense solver, on frames and on graphs that fill in while they are eliminated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.joint_equations import JointEquations
from frametwin.fitting.joint_kernels import SIZE
from frametwin.geometry.parametric import named_frame

GRAPHS = {
    "two joints": (np.array([[0, 1]]), 2),
    "a ring": (np.array([[k, (k + 1) % 9] for k in range(9)]), 9),
    "a star and a joint by itself": (np.array([[0, k] for k in range(1, 7)]), 8),
    "all with all": (np.array([[a, b] for a in range(6) for b in range(a)]), 6),
    "at random": (np.unique(np.sort(np.random.default_rng(5).integers(0, 40, (90, 2)), axis=1), axis=0), 40),
}


def matrix_of(edges: np.ndarray, joints: int, seed: int = 0) -> sparse.csc_matrix:
    """A positive definite matrix with a full block for every joint and strut."""
    rng = np.random.default_rng(seed)
    dense = np.zeros((SIZE * joints,) * 2)
    for k in range(joints):
        dense[SIZE * k : SIZE * k + SIZE, SIZE * k : SIZE * k + SIZE] = 2.0 * np.eye(SIZE)
    for a, b in edges:
        own = [*range(SIZE * a, SIZE * a + SIZE), *range(SIZE * b, SIZE * b + SIZE)]
        factor = rng.normal(size=(len(own), 7))
        dense[np.ix_(own, own)] += factor @ factor.T
    return sparse.csc_matrix(dense)


@pytest.mark.parametrize("name", GRAPHS)
def test_solutions_are_those_of_a_dense_solver(name: str) -> None:
    edges, joints = GRAPHS[name]
    edges = edges[edges[:, 0] != edges[:, 1]]
    matrix = matrix_of(edges, joints)
    factor = JointEquations(edges, joints, matrix.indices, matrix.indptr).factor(matrix.data)
    right = np.random.default_rng(1).normal(size=(SIZE * joints, 3))
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(matrix.toarray(), right), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(factor.solve(right[:, 0]), factor.solve(right)[:, 0], rtol=1e-12, atol=1e-14)


def test_a_pattern_serves_matrix_after_matrix() -> None:
    edges, joints = GRAPHS["a ring"]
    first, second = (matrix_of(edges, joints, seed) for seed in (2, 3))
    equations = JointEquations(edges, joints, first.indices, first.indptr)
    early = equations.factor(first.data)
    right = np.ones(SIZE * joints)
    for factor, matrix in ((equations.factor(second.data), second), (early, first)):
        np.testing.assert_allclose(matrix @ factor.solve(right), right, atol=1e-9)


def test_what_is_not_positive_definite_is_refused() -> None:
    edges, joints = GRAPHS["a ring"]
    matrix = matrix_of(edges, joints)
    equations = JointEquations(edges, joints, matrix.indices, matrix.indptr)
    shifted = matrix - sparse.diags(np.full(SIZE * joints, 30.0), format="csc")
    with pytest.raises(ArithmeticError):
        equations.factor(sparse.csc_matrix(shifted).data)


def test_a_frame_whose_matrix_is_indefinite_by_rounding_is_still_solved() -> None:
    elastic = ElasticFrame(named_frame("bridge"))
    matrix = elastic.assemble(elastic.stiffness)
    weak = matrix.copy()
    weak.data *= -1.0
    right = np.random.default_rng(2).normal(size=matrix.shape[0])
    anchored = elastic.anchored(weak)
    np.testing.assert_allclose(anchored @ elastic.solve(weak, right), right, atol=1e-5 * np.abs(right).max())
