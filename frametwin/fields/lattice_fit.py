"""A lattice field through scattered displacements: regularised linear least squares in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frametwin.fields.base import checked_points
from frametwin.fields.lattice import FUNCTIONS, Cells, LatticeField, axis_matrix

Floats = NDArray[np.float64]
Term = tuple[tuple[int, int, int], float]

MOST_COEFFICIENTS = 8000
"""The normal equations are solved as a dense matrix; this many take half a gigabyte."""

_RIDGE = 1e-11  # of the mean diagonal: levels overlap, so coefficients alone are not unique
_DENSE = 16  # columns for each number in a row up to which dense products win
_BLOCK = 4096  # rows made dense at once
_SECOND = (
    ((2, 0, 0), 1.0),
    ((0, 2, 0), 1.0),
    ((0, 0, 2), 1.0),
    ((1, 1, 0), 2.0),
    ((1, 0, 1), 2.0),
    ((0, 1, 1), 2.0),
)
_FIRST = (((1, 0, 0), 1.0), ((0, 1, 0), 1.0), ((0, 0, 1), 1.0))


def fit_lattice(
    points: ArrayLike,
    displacements: ArrayLike,
    weights: ArrayLike | None,
    box: ArrayLike,
    resolutions: Sequence[Cells],
    *,
    bending: float = 1e-6,
    stretch: float = 0.0,
) -> LatticeField:
    """The lattice field nearest to given displacements.

    Minimises, with L the longest side of the box,

        sum_i w_i |d(x_i) - d_i|^2 / sum_i w_i + bending L^4 <|grad grad d|^2> + stretch L^2 <|grad d|^2>,

    where <> is the mean over the box (in closed form). The weights of the energies have
    no unit and mean the same for frames of all sizes. Bending leaves affine motions free, stretch only
    translations.

    Parameters
    ----------
    points : (N, 3) mm.
    displacements : (N, 3) mm.
    weights : (N,) not negative, not all zero; None for equal ones.
    box : (2, 3) mm, the domain of the field.
    resolutions : cells (cx, cy, cz) of each level.
    bending, stretch : weights of the energies.

    Raises
    ------
    ValueError
        If shapes do not fit, weights are not usable, or there are more than `MOST_COEFFICIENTS` coefficients.
    """
    field = LatticeField.zeros(box, resolutions)
    where, targets = checked_points(points), checked_points(displacements)
    share = np.ones(len(where)) if weights is None else np.asarray(weights, dtype=np.float64)
    if len(targets) != len(where) or share.shape != (len(where),):
        raise ValueError(f"{len(where)} points, {len(targets)} displacements and weights {share.shape} do not fit")
    if not (np.isfinite(share).all() and share.min(initial=0.0) >= 0.0 and share.sum() > 0.0):
        raise ValueError("weights must be finite, not negative and not all zero")
    size = field.size
    if size > MOST_COEFFICIENTS:
        raise ValueError(f"{size} coefficients are more than {MOST_COEFFICIENTS}; use coarser levels")
    root = np.sqrt(share / share.sum())[:, None]
    normal, right = _normal_equations(field, where, root, targets)
    length = float(np.ptp(field.box, axis=0).max())
    domain = tuple(field.box.ravel().tolist()), tuple(field.resolutions)
    if bending > 0.0:
        normal += bending * length**4 * _energy(*domain, _SECOND)
    if stretch > 0.0:
        normal += stretch * length**2 * _energy(*domain, _FIRST)
    normal[np.diag_indices(size)] += _RIDGE * np.trace(normal) / size
    return field.with_coefficients(np.linalg.solve(normal, right))


def _normal_equations(field: LatticeField, points: Floats, root: Floats, targets: Floats) -> tuple[Floats, Floats]:
    """(C, C) and (C, 3) of the least squares, each point weighted by the square of its ``root`` (N, 1).

    As long as the matrix is not much wider than its filled part, dense blocks are several times faster.
    """
    if field.size > _DENSE * FUNCTIONS * len(field.levels):
        basis = field.basis_matrix(points).multiply(root).tocsr()
        return (basis.T @ basis).toarray(), basis.T @ (root * targets)
    normal, right = np.zeros((field.size, field.size)), np.zeros((field.size, 3))
    for start in range(0, len(points), _BLOCK):
        some = slice(start, start + _BLOCK)
        basis = root[some] * field.dense_matrix(points[some])
        normal += basis.T @ basis
        right += basis.T @ (root[some] * targets[some])
    return normal, right


@lru_cache(maxsize=4)
def _energy(box: tuple[float, ...], resolutions: tuple[Cells, ...], terms: tuple[Term, ...]) -> Floats:
    """(C, C) matrix, read-only, of the mean over a box of a sum of squared derivatives.

    The basis functions are products over the axes, so every entry is a product of integrals along one axis. A twin that
    is followed asks for the same matrix again and again.
    """
    field = LatticeField.zeros(np.reshape(box, (2, 3)), resolutions)
    along = [_axis_products(field, axis) for axis in range(3)]
    levels = range(len(field.levels))
    total = np.zeros((field.size,) * 2)
    for (x, y, z), factor in terms:
        blocks = [
            [np.kron(np.kron(along[0][x, a, b], along[1][y, a, b]), along[2][z, a, b]) for b in levels] for a in levels
        ]
        total += factor * np.block(blocks)
    total.flags.writeable = False
    return total


def _axis_products(field: LatticeField, axis: int) -> dict[tuple[int, int, int], Floats]:
    """Means along one axis of products of two levels' functions, both differentiated equally often.

    Keys are (order, level, level); values (n, n'). Exact: the functions are cubics between the knots.
    """
    ends = field.box[:, axis]
    cells = [resolution[axis] for resolution in field.resolutions]
    knots = np.unique(np.concatenate([np.arange(count + 1) / count for count in cells]))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    gaps = np.diff(knots)[:, None]
    share = (0.5 * gaps * weights).ravel()
    x = ends[0] + (ends[1] - ends[0]) * (knots[:-1, None] + 0.5 * gaps * (nodes + 1.0)).ravel()
    products = {}
    for order in range(3):
        values = [axis_matrix(x, ends, count, order) for count in cells]
        for a, one in enumerate(values):
            for b, other in enumerate(values):
                products[order, a, b] = (one * share[:, None]).T @ other
    return products
