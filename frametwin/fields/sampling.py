"""Samples on the planned curves, and the constant map from their displacements to control points.

Strut k is sampled at v_j = j / m; a joint shared by struts is sampled once, so struts stay joined exactly. A
cubic is fitted to the moved samples by least squares with its ends fixed to the moved ends. Both steps are
linear: the displacements of the control points are a constant matrix times those of the samples (paper, Eq.
5-8).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe

if TYPE_CHECKING:
    from scipy import sparse

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CurveSampling:
    """Samples of all struts of a frame.

    Attributes
    ----------
    joints : (V, 3) mm, one sample at each vertex.
    edges : (E, 2) vertices of each strut.
    control_points : (E, 4, 3) mm, the plan.
    intervals : m, at least 3.
    """

    joints: Floats
    edges: NDArray[np.int64]
    control_points: Floats
    intervals: int

    @classmethod
    def of(cls, frame: Wireframe, intervals: int) -> CurveSampling:
        """Sample every strut of a frame with ``intervals`` = m (50 in the paper).

        Raises
        ------
        ValueError
            If there are fewer than three intervals: a cubic is then not determined.
        """
        if intervals < 3:
            raise ValueError(f"a cubic needs 3 sample intervals or more, not {intervals}")
        return cls(frame.vertices.copy(), frame.edges.copy(), frame.control_points.copy(), intervals)

    @cached_property
    def points(self) -> Floats:
        """(V + E (m - 1), 3) mm: the joints, then the inner samples strut by strut."""
        v = np.arange(1, self.intervals) / self.intervals
        inner = bezier.evaluate(self.control_points, v)  # (E, m - 1, 3)
        return np.concatenate([self.joints, inner.reshape(-1, 3)])

    @property
    def refit(self) -> Floats:
        """(4, m + 1) matrix from the samples of one strut to its control points."""
        return bezier.refit_matrix(self.intervals, 3)

    def control(self, displacements: Tensor) -> Tensor:
        """Displacements (E, 4, 3) of control points from those of `points`, in the same order;
        differentiable.

        The first and last control points are those of the joints, bit for bit.
        """
        joints = len(self.joints)
        refit = torch.from_numpy(np.array(self.refit)).to(displacements.dtype)
        ends = displacements[:joints][torch.from_numpy(self.edges)]  # (E, 2, 3)
        inner = displacements[joints:].view(len(self.edges), self.intervals - 1, 3)
        middle = torch.einsum("cj,ejx->ecx", refit[1:3, 1:-1], inner)
        middle = middle + torch.einsum("cj,ejx->ecx", refit[1:3][:, [0, -1]], ends)
        return torch.cat([ends[:, :1], middle, ends[:, 1:]], dim=1)

    @cached_property
    def control_matrix(self) -> sparse.csr_matrix:
        """(4 E, V + E (m - 1)) constant matrix of `control`, rows strut by strut."""
        from scipy import sparse

        struts, inner = len(self.edges), self.intervals - 1
        first = len(self.joints) + inner * np.arange(struts)
        columns = np.column_stack([self.edges[:, 0], first[:, None] + np.arange(inner), self.edges[:, 1]])  # (E, m + 1)
        shape = (struts, 4, self.intervals + 1)
        rows = np.broadcast_to(np.arange(4 * struts).reshape(struts, 4, 1), shape)
        entries = (
            np.broadcast_to(self.refit, shape).ravel(),
            (rows.ravel(), np.broadcast_to(columns[:, None], shape).ravel()),
        )
        matrix = sparse.csr_matrix(entries, shape=(4 * struts, len(self.joints) + struts * inner))
        matrix.eliminate_zeros()
        return matrix
