"""The B-spline lattice with coefficients that torch can learn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from frametwin.fields.lattice import LatticeField
from frametwin.fields.torch_field import TorchField

if TYPE_CHECKING:
    from scipy import sparse

    from frametwin.fields.sampling import CurveSampling


class _Product(torch.autograd.Function):
    """Constant sparse matrix times a tensor; scipy's product is several times faster than torch's here."""

    @staticmethod
    def forward(ctx: Any, values: Tensor, matrix: sparse.csr_matrix) -> Tensor:
        ctx.matrix = matrix
        return torch.from_numpy(matrix @ values.detach().numpy())

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        return torch.from_numpy(ctx.matrix.T @ grad.numpy()), None


class TrainableLattice(TorchField):
    """A `LatticeField` while it is fitted.

    Parameters
    ----------
    lattice : the field to begin with.
    scale : mm; coefficients are stored in this unit, so that learning rates mean the same on frames of all
        sizes.
    """

    kind = "lattice"

    def __init__(self, lattice: LatticeField, scale: float = 1.0) -> None:
        super().__init__()
        if not scale > 0.0:
            raise ValueError("the scale of a lattice must be above 0")
        self.lattice, self.scale = lattice, float(scale)
        self.coefficients = nn.Parameter(torch.from_numpy(lattice.coefficients / scale))
        self._control: sparse.csr_matrix | None = None

    def prepare(self, sampling: CurveSampling) -> None:
        """Reduce sampling, lattice and refit to one constant matrix from coefficients to control points."""
        self._control = sampling.control_matrix @ self.lattice.basis_matrix(sampling.points)

    def control_displacements(self, sampling: CurveSampling) -> Tensor:
        """Displacements (E, 4, 3) in mm of the curves' control points."""
        if self._control is None:
            self.prepare(sampling)
        return self._times(self._control).view(-1, 4, 3)

    def forward(self, points: Tensor) -> Tensor:
        """Displacements (N, 3) in mm of the points (N, 3) in mm."""
        return self._times(self.lattice.basis_matrix(points.detach().numpy()))

    def laplacian_of(self, points: Tensor) -> Tensor:
        """Vector Laplacian (N, 3) in 1 / mm."""
        return self._times(self.lattice.laplacian_matrix(points.detach().numpy()))

    def frozen(self) -> LatticeField:
        """The lattice with the coefficients learnt so far."""
        return self.lattice.with_coefficients(self.scale * self.coefficients.detach().numpy())

    def tensors(self) -> dict[str, np.ndarray]:
        """Those of the lattice."""
        return self.frozen().tensors()

    def metadata(self) -> dict[str, str]:
        """That of the lattice."""
        return self.lattice.metadata()

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> TrainableLattice:
        """Build the field from `tensors` and `metadata`."""
        return cls(LatticeField.restore(tensors, metadata))

    def _times(self, matrix: sparse.csr_matrix) -> Tensor:
        return self.scale * _Product.apply(self.coefficients, matrix)
