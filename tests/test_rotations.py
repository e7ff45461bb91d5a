"""Rotations against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from frametwin.geometry.rotations import rotation_matrices, turns_of


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 0.1, 1.0, 2.0, 3.1])
def test_vectors_and_matrices_are_those_of_scipy(angle: float) -> None:
    axes = np.random.default_rng(0).normal(size=(4, 5, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    matrices = rotation_matrices(vectors)
    assert matrices.shape == (4, 5, 3, 3)
    wanted = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(matrices.shape)
    np.testing.assert_allclose(matrices, wanted, atol=1e-15)
    np.testing.assert_allclose(turns_of(matrices), vectors, rtol=1e-13 if angle < 2.5 else 1e-10, atol=1e-16)
