"""Fields whose parameters torch can learn: the same interface with tensors beside the one with arrays."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from frametwin.fields.base import DeformationField, checked_points

if TYPE_CHECKING:
    from frametwin.fields.sampling import CurveSampling

Floats = NDArray[np.float64]

_CHUNK = 65536  # points evaluated at once outside of a fit


class TorchField(nn.Module, DeformationField):
    """A field that is a torch module: ``field(points)`` are displacements, both (N, 3) in mm."""

    @abstractmethod
    def forward(self, points: Tensor) -> Tensor:
        """Displacements (N, 3) in mm of the points (N, 3) in mm."""

    @abstractmethod
    def laplacian_of(self, points: Tensor) -> Tensor:
        """Vector Laplacian (N, 3) in 1 / mm, differentiable with respect to the parameters."""

    def prepare(self, sampling: CurveSampling) -> None:
        """Compute what stays the same while the field is fitted to one set of curves."""

    def control_displacements(self, sampling: CurveSampling) -> Tensor:
        """Displacements (E, 4, 3) in mm of the control points: samples moved by the field, then refitted."""
        return sampling.control(self(torch.from_numpy(sampling.points).to(self.dtype)))

    @property
    def dtype(self) -> torch.dtype:
        """Floating type of the parameters."""
        return next(self.parameters()).dtype

    def frozen(self) -> DeformationField:
        """The field as it is to be kept when the fit is over."""
        return self.eval().requires_grad_(False)

    def evaluate(self, points: ArrayLike) -> Floats:
        """Displacements (N, 3) in mm of the points (N, 3)."""
        return self._in_chunks(self, points)

    def laplacian(self, points: ArrayLike) -> Floats:
        """Vector Laplacian (N, 3) in 1 / mm at the points (N, 3)."""
        return self._in_chunks(self.laplacian_of, points)

    def tensors(self) -> dict[str, np.ndarray]:
        """Parameters and buffers."""
        return {name: value.detach().numpy().copy() for name, value in self.state_dict().items()}

    def _in_chunks(self, function: Callable[[Tensor], Tensor], points: ArrayLike) -> Floats:
        where = checked_points(points)
        result = np.empty_like(where)
        with torch.no_grad():
            for start in range(0, len(where), _CHUNK):
                part = torch.from_numpy(where[start : start + _CHUNK]).to(self.dtype)
                result[start : start + _CHUNK] = function(part).numpy()
        return result
