"""The compiled loops of small systems against the same in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from small_frames import tower

from frametwin.fitting import step_kernels
from frametwin.fitting.elastic import INNER, ElasticFrame

CAMERAS = 20


def elastic_and_terms(seed: int) -> tuple[ElasticFrame, np.ndarray, np.ndarray]:
    """A frame, and curvature (E, 12, 12) and slope (E, 12) as pictures might give them: no strut is told all of."""
    elastic, rng = ElasticFrame(tower()), np.random.default_rng(seed)
    parts = rng.normal(size=(len(elastic.edges), 12, 5))
    return elastic, parts @ parts.transpose(0, 2, 1), rng.normal(size=(len(elastic.edges), 12))


def whole_systems(
    elastic: ElasticFrame, hessian: np.ndarray, gradient: np.ndarray, off: tuple, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(E, 18, 18) and (E, 18) over the freedoms of both joints and each strut's own, nothing eliminated."""
    count = len(elastic.edges)
    moves = np.zeros((count, 12, 18))
    moves[:, :, :12], moves[:, INNER, 12:] = elastic.follow, np.eye(6)
    stiffness = np.zeros((count, 18, 18))
    stiffness[:, :12, :12], stiffness[:, 12:, 12:] = elastic.held_stiffness, elastic.inner_stiffness
    away = np.concatenate(off, axis=1)
    matrix = np.einsum("eai,eab,ebj->eij", moves, hessian, moves) + weights[0] * stiffness
    return matrix, np.einsum("eai,ea->ei", moves, gradient) + weights[1] * np.einsum("eij,ej->ei", stiffness, away)


@pytest.mark.parametrize("seed", range(2))
def test_eliminated_freedoms_are_where_the_whole_system_has_them(seed: int) -> None:
    elastic, hessian, gradient = elastic_and_terms(seed)
    count, rng = len(hessian), np.random.default_rng(seed + 9)
    off, weights = (rng.normal(size=(count, 12)), rng.normal(size=(count, 6))), np.array([0.7, 0.3])
    blocks, slopes = np.empty((count, 12, 12)), np.empty((count, 12))
    follows, own = np.empty((count, 6, 12)), np.empty((count, 6))
    system = (hessian, gradient, elastic.follow, elastic.held_stiffness, elastic.inner_stiffness, *off, weights)
    step_kernels.eliminate(*system, blocks, slopes, follows, own)

    matrix, slope = whole_systems(elastic, hessian, gradient, off, weights)
    joints = rng.normal(size=(count, 12))
    step = np.concatenate([joints, -own - np.einsum("eij,ej->ei", follows, joints)], axis=1)
    there = np.einsum("eij,ej->ei", matrix, step) + slope  # the slope after any step of the joints
    scale = np.abs(matrix).max()
    np.testing.assert_allclose(there[:, 12:], 0.0, atol=1e-11 * scale)
    np.testing.assert_allclose(there[:, :12], np.einsum("eij,ej->ei", blocks, joints) + slopes, atol=1e-11 * scale)

    cameras = rng.normal(size=(count, 12, CAMERAS))
    solved, sides = np.empty((count, 6, 13 + CAMERAS)), np.empty((count, 12, 1 + CAMERAS))
    sums, again = np.zeros((3, CAMERAS, 1 + CAMERAS)), np.empty_like(blocks)
    step_kernels.eliminate_with_cameras(*system, cameras, solved, again, sides, sums)
    np.testing.assert_allclose(again, blocks, atol=1e-11 * scale)
    np.testing.assert_allclose(solved[:, :, :12], follows, atol=1e-11 * np.abs(follows).max())
    np.testing.assert_allclose(solved[:, :, 12], own, atol=1e-11 * np.abs(own).max())
    by_cameras = np.linalg.solve(matrix[:, 12:, 12:], cameras[:, INNER])
    coupling = elastic.follow.transpose(0, 2, 1) @ cameras - matrix[:, :12, 12:] @ by_cameras
    np.testing.assert_allclose(sides[:, :, 0], slopes, atol=1e-11 * scale)
    np.testing.assert_allclose(sides[:, :, 1:], coupling, atol=1e-11 * scale)
    less = np.einsum("eic,eid->cd", cameras[:, INNER], by_cameras)
    np.testing.assert_allclose(sums.sum(axis=0)[:, 1:], less, atol=1e-11 * np.abs(less).max())
    less = np.einsum("eic,ei->c", cameras[:, INNER], own)
    np.testing.assert_allclose(sums.sum(axis=0)[:, 0], less, atol=1e-11 * np.abs(less).max())


def test_motions_are_multiplied_as_by_the_sparse_matrix() -> None:
    elastic = ElasticFrame(tower())
    matrix = elastic.assemble(elastic.stiffness)
    motions = np.random.default_rng(4).normal(size=(6 * elastic.vertex_count, 7)).astype(np.float32)
    found, exact = elastic.in_motions(matrix, motions), matrix @ motions.astype(np.float64)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, exact, atol=1e-5 * np.abs(exact).max())
