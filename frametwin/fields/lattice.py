"""A deformation field of cubic B-splines on regular lattices, several resolutions summed.

Each level divides the box into cells (cx, cy, cz) and has (cx + 3)(cy + 3)(cz + 3) coefficients in mm, so one
level of one cell already holds every polynomial displacement up to the cube. Displacements are linear in the
coefficients: the matrices here give values, gradients and Laplacians of all levels side by side.

Outside of the box, every one-dimensional basis function goes on along its tangent. The field is then
continuous with its gradient everywhere, constants and rotations carry on unchanged, and its growth stays
linear along each axis.

References
----------
T. Sederberg, S. Parry, "Free-form deformation of solid geometric models", 1986. S. Lee, G. Wolberg, S. Shin,
"Scattered data interpolation with multilevel B-splines", IEEE TVCG 3(3), 1997.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.fields.base import DeformationField, checked_box, checked_points

if TYPE_CHECKING:
    from scipy import sparse

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]
Orders = tuple[int, int, int]

FUNCTIONS = 64
"""Of each level that reach a point."""

_BLOCK = 4096  # points that are evaluated at once

# Cubic B-spline pieces: coefficients of 1, s, s^2, s^3 of the four functions that meet in a cell, s in 0..1.
_PIECES = np.array([[1.0, -3.0, 3.0, -1.0], [4.0, 0.0, -6.0, 3.0], [1.0, 3.0, 3.0, -3.0], [0.0, 0.0, 0.0, 1.0]]) / 6.0


def even_cells(box: ArrayLike, longest: int) -> Cells:
    """Cells of nearly equal sides: ``longest`` along the longest side of the box, at least one along each."""
    sides = np.ptp(checked_box(box), axis=0)
    x, y, z = np.maximum(1, np.round(longest * sides / sides.max())).astype(int)
    return int(x), int(y), int(z)


class LatticeField(DeformationField):
    """Sum of cubic B-spline lattices over one box.

    Parameters
    ----------
    box : (2, 3) mm.
    levels : one array (nx, ny, nz, 3) of coefficients in mm for each level, with n = cells + 3 >= 4 along
        each axis.

    Raises
    ------
    ValueError
        If a shape is wrong or a value is not finite.
    """

    kind = "lattice"

    def __init__(self, box: ArrayLike, levels: Sequence[ArrayLike]) -> None:
        self.box = checked_box(box)
        self.levels = tuple(np.array(level, dtype=np.float64) for level in levels)
        if not self.levels:
            raise ValueError("a lattice field needs at least one level")
        for level in self.levels:
            if level.ndim != 4 or level.shape[3] != 3 or min(level.shape[:3]) < 4:
                raise ValueError(f"a level needs the shape (nx, ny, nz, 3), n >= 4, not {level.shape}")
            if not np.isfinite(level).all():
                raise ValueError("a coefficient is not finite")
            level.setflags(write=False)

    @classmethod
    def zeros(cls, box: ArrayLike, resolutions: Sequence[Cells]) -> LatticeField:
        """A field of no displacement with these cells (cx, cy, cz) in each level."""
        return cls(box, [np.zeros((*(c + 3 for c in cells), 3)) for cells in resolutions])

    @property
    def resolutions(self) -> tuple[Cells, ...]:
        """Cells of each level."""
        return tuple((n[0] - 3, n[1] - 3, n[2] - 3) for n in (level.shape for level in self.levels))

    @property
    def coefficients(self) -> Floats:
        """(C, 3) coefficients of all levels one after another, in the order of the matrices' columns."""
        return np.concatenate([level.reshape(-1, 3) for level in self.levels])

    @property
    def size(self) -> int:
        """How many coefficients C all levels have."""
        return sum(level.size // 3 for level in self.levels)

    def with_coefficients(self, coefficients: ArrayLike) -> LatticeField:
        """The field with other coefficients (C, 3), in the order of `coefficients`."""
        values = np.asarray(coefficients, dtype=np.float64)
        ends = np.cumsum([level.size // 3 for level in self.levels])
        if values.shape != (ends[-1], 3):
            raise ValueError(f"the lattice has {ends[-1]} coefficients (C, 3), not {values.shape}")
        parts = np.split(values, ends[:-1])
        return LatticeField(self.box, [p.reshape(level.shape) for p, level in zip(parts, self.levels, strict=True)])

    def evaluate(self, points: ArrayLike) -> Floats:
        """Displacements (N, 3) in mm of the points (N, 3)."""
        where, coefficients = checked_points(points), self.coefficients
        result = np.empty((len(where), 3))
        for start in range(0, len(where), _BLOCK):
            weights, columns = self._weights(where[start : start + _BLOCK], (0, 0, 0))
            result[start : start + _BLOCK] = np.matmul(weights[:, None, :], coefficients[columns])[:, 0]
        return result

    def laplacian(self, points: ArrayLike) -> Floats:
        """Vector Laplacian (N, 3) in 1 / mm at the points (N, 3)."""
        return self.laplacian_matrix(points) @ self.coefficients

    def basis_matrix(self, points: ArrayLike) -> sparse.csr_matrix:
        """(N, C) matrix: displacements = matrix @ coefficients."""
        return self.derivative_matrix(points, (0, 0, 0))

    def gradient_matrix(self, points: ArrayLike, axis: int) -> sparse.csr_matrix:
        """(N, C) matrix of the derivative along one axis (0, 1, 2)."""
        orders = [0, 0, 0]
        orders[axis] = 1
        return self.derivative_matrix(points, (orders[0], orders[1], orders[2]))

    def laplacian_matrix(self, points: ArrayLike) -> sparse.csr_matrix:
        """(N, C) matrix of the Laplacian."""
        second = [self.derivative_matrix(points, orders) for orders in ((2, 0, 0), (0, 2, 0), (0, 0, 2))]
        return second[0] + second[1] + second[2]

    def derivative_matrix(self, points: ArrayLike, orders: Orders) -> sparse.csr_matrix:
        """(N, C) matrix of a partial derivative.

        Parameters
        ----------
        points : (N, 3) mm, inside of the box or not.
        orders : how often to differentiate along x, y and z; 0, 1 or 2 each.
        """
        from scipy import sparse  # takes a fifth of a second to load, and the fast fit needs none of it

        weights, columns = self._weights(checked_points(points), orders)
        ends = np.arange(len(weights) + 1) * weights.shape[1]
        return sparse.csr_matrix((weights.ravel(), columns.ravel(), ends), shape=(len(weights), self.size))

    def dense_matrix(self, points: ArrayLike, orders: Orders = (0, 0, 0)) -> Floats:
        """(N, C) array, as `derivative_matrix`: quicker where a lattice has few coefficients."""
        where, parts = checked_points(points), []
        for cells in self.resolutions:
            x, y, z = (axis_matrix(where[:, a], self.box[:, a], cells[a], orders[a]) for a in range(3))
            plane = (x[:, :, None] * y[:, None, :]).reshape(len(where), -1)
            parts.append((plane[:, :, None] * z[:, None, :]).reshape(len(where), -1))
        return np.concatenate(parts, axis=1)

    def _weights(self, where: Floats, orders: Orders) -> tuple[Floats, NDArray[np.int64]]:
        """Weights (N, K) of the functions that reach each point (N, 3), and which coefficients (N, K) these have."""
        count, data, columns, before = len(where), [], [], 0
        for cells, level in zip(self.resolutions, self.levels, strict=True):
            weights, first = zip(
                *(_axis_weights(where[:, a], self.box[:, a], cells[a], orders[a]) for a in range(3)),
                strict=True,
            )
            plane = (weights[0][:, :, None] * weights[1][:, None, :]).reshape(count, 16)
            data.append((plane[:, :, None] * weights[2][:, None, :]).reshape(count, FUNCTIONS))
            steps = [f[:, None] + np.arange(4) for f in first]  # three of (N, 4)
            ny, nz = level.shape[1:3]
            index = (steps[0][:, :, None, None] * ny + steps[1][:, None, :, None]) * nz + steps[2][:, None, None, :]
            columns.append(index.reshape(count, FUNCTIONS) + before)
            before += level.size // 3
        return np.concatenate(data, axis=1), np.concatenate(columns, axis=1)

    def tensors(self) -> dict[str, np.ndarray]:
        """The box and every level, as float64."""
        return {"box": np.array(self.box), **{f"level{i}": np.array(c) for i, c in enumerate(self.levels)}}

    def metadata(self) -> dict[str, str]:
        """The number of levels."""
        return {"levels": str(len(self.levels))}

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> LatticeField:
        """Build the field from `tensors` and `metadata`."""
        return cls(tensors["box"], [tensors[f"level{i}"] for i in range(int(metadata["levels"]))])


def axis_matrix(x: Floats, ends: Floats, cells: int, order: int) -> Floats:
    """(N, cells + 3) values at x (N,) of the functions along one axis, differentiated ``order`` times."""
    weights, first = _axis_weights(x, ends, cells, order)
    matrix = np.zeros((len(x), cells + 3))
    np.put_along_axis(matrix, first[:, None] + np.arange(4), weights, axis=1)
    return matrix


def _axis_weights(x: Floats, ends: Floats, cells: int, order: int) -> tuple[Floats, NDArray[np.int64]]:
    """Weights (N, 4) of four functions along an axis, differentiated ``order`` times; the first's index."""
    step = (ends[1] - ends[0]) / cells
    t = (x - ends[0]) / step
    inside = np.clip(t, 0.0, cells)
    first = np.minimum(inside.astype(np.int64), cells - 1)
    s = (inside - first)[:, None]
    values = _PIECES[:, 0] + s * (_PIECES[:, 1] + s * (_PIECES[:, 2] + s * _PIECES[:, 3]))
    slopes = _PIECES[:, 1] + s * (2.0 * _PIECES[:, 2] + s * 3.0 * _PIECES[:, 3])
    beyond = (t - inside)[:, None]
    if order == 0:
        return values + beyond * slopes, first
    if order == 1:
        return slopes / step, first
    bends = 2.0 * _PIECES[:, 2] + s * 6.0 * _PIECES[:, 3]
    return np.where(beyond == 0.0, bends, 0.0) / step**2, first
