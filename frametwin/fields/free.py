"""Free control points, for comparison: what curve-driven splatting does.

Every joint and every inner control point moves on its own, tied to nothing but the strut it belongs to; or each strut
even has ends of its own, as the published method has them. Between and away from them the field blends the
displacements of the nearest ones.

References
----------
Z. Gao et al., ICCV 2025 (curve-driven Gaussian splatting), the paper's first comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from frametwin.fields import node_weights as blending
from frametwin.fields.base import checked_points
from frametwin.fields.torch_field import TorchField

if TYPE_CHECKING:
    from frametwin.fields.sampling import CurveSampling

NEIGHBOURS = 8
"""Control points that a point in space listens to."""


class FreeField(TorchField):
    """Independent displacements of anchors.

    Parameters
    ----------
    anchors : (N, 3) mm: the joints, then two inner control points for each strut (see `FreeField.on_curves`),
        or all four of each strut, or any other points when only `evaluate` is needed.
    scale : mm; parameters are stored in this unit, so that learning rates mean the same on frames of all
        sizes.
    """

    kind = "free"
    share_ends = True
    anchors: Tensor
    widths: Tensor
    scale: Tensor

    def __init__(self, anchors: ArrayLike, scale: float = 1.0) -> None:
        super().__init__()
        points = checked_points(anchors)
        if len(points) < 1 or not scale > 0.0:
            raise ValueError("free control points need at least one anchor and a scale above 0")
        self.register_buffer("anchors", torch.from_numpy(points.copy()))
        self.register_buffer("widths", torch.from_numpy(blending.node_spacing(points)))
        self.register_buffer("scale", torch.tensor(float(scale), dtype=torch.float64))
        self.offsets = nn.Parameter(torch.zeros(len(points), 3, dtype=torch.float64))

    @classmethod
    def on_curves(cls, sampling: CurveSampling, scale: float, share_ends: bool = True) -> FreeField:
        """One anchor at each joint and at each inner control point of the plan; or one at each control point."""
        if not share_ends:
            field = cls(sampling.control_points.reshape(-1, 3), scale)
            field.share_ends = False
            return field
        inner = sampling.control_points[:, 1:3].reshape(-1, 3)
        return cls(np.concatenate([sampling.joints, inner]), scale)

    def control_displacements(self, sampling: CurveSampling) -> Tensor:
        """Displacements (E, 4, 3) in mm of the control points, which are the parameters themselves."""
        joints = len(sampling.joints)
        moved = self.scale * self.offsets
        if not self.share_ends:
            return moved.view(-1, 4, 3)
        inner = moved[joints:].view(-1, 2, 3)
        ends = moved[:joints][torch.from_numpy(sampling.edges)]  # (E, 2, 3)
        return torch.cat([ends[:, :1], inner, ends[:, 1:]], dim=1)

    def forward(self, points: Tensor) -> Tensor:
        """Displacements (N, 3) in mm: blends of the nearest control points'."""
        index, away = self._around(points)
        w = blending.weights(away, self.widths[index])
        return self.scale * (w[..., None] * self.offsets[index]).sum(1)

    def laplacian_of(self, points: Tensor) -> Tensor:
        """Vector Laplacian (N, 3) in 1 / mm of the blend."""
        index, away = self._around(points)
        _, _, bend = blending.weight_derivatives(away, self.widths[index])
        return self.scale * (bend[..., None] * self.offsets[index]).sum(1)

    def _around(self, points: Tensor) -> tuple[Tensor, Tensor]:
        index = blending.nearest_nodes(points, self.anchors, min(NEIGHBOURS, len(self.anchors)))
        return index, points[:, None] - self.anchors[index]

    def metadata(self) -> dict[str, str]:
        """Whether struts have ends of their own; else nothing is needed beside the arrays."""
        return {} if self.share_ends else {"ends": "own"}

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> FreeField:
        """Build the field from `tensors` and `metadata`."""
        field = cls(tensors["anchors"], float(tensors["scale"]))
        field.share_ends = metadata.get("ends") != "own"
        field.load_state_dict({name: torch.from_numpy(np.array(value)) for name, value in tensors.items()})
        field.frozen()
        return field
