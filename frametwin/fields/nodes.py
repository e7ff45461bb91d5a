"""Sparse control nodes with blended motions, for comparison: what deformation-driven splatting does.

Each node has a rigid motion (translation and rotation vector) and a width; a point follows the motions of its
nearest nodes, blended with Gaussian weights:

    d(x) = sum_i w_i(x) (R_i (x - n_i) + n_i + t_i) - x.

References
----------
Y. Huang et al., "SC-GS: sparse-controlled Gaussian splatting", CVPR 2024, the paper's second comparison.
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


class NodesField(TorchField):
    """Blended rigid motions of sparse nodes.

    Parameters
    ----------
    nodes : (M, 3) mm.
    scale : mm; translations are stored in this unit, so that learning rates mean the same on frames of all
        sizes.
    neighbours : nodes that a point follows.
    """

    kind = "nodes"
    nodes: Tensor
    scale: Tensor

    def __init__(self, nodes: ArrayLike, scale: float = 1.0, neighbours: int = 4) -> None:
        super().__init__()
        points = checked_points(nodes)
        if len(points) < 1 or not scale > 0.0 or neighbours < 1:
            raise ValueError("control nodes need at least one node, a scale above 0 and at least one neighbour")
        self.neighbours = min(neighbours, len(points))
        self.register_buffer("nodes", torch.from_numpy(points.copy()))
        self.register_buffer("scale", torch.tensor(float(scale), dtype=torch.float64))
        self.translations = nn.Parameter(torch.zeros(len(points), 3, dtype=torch.float64))
        self.rotations = nn.Parameter(torch.zeros(len(points), 3, dtype=torch.float64))
        self.log_widths = nn.Parameter(torch.from_numpy(np.log(blending.node_spacing(points))))
        self._index: Tensor | None = None

    @classmethod
    def spread_over(cls, points: ArrayLike, count: int, scale: float, neighbours: int = 4) -> NodesField:
        """Nodes on ``count`` of the points that lie far from each other."""
        where = checked_points(points)
        return cls(where[blending.spread_out(where, count)], scale, neighbours)

    def prepare(self, sampling: CurveSampling) -> None:
        """Find the nodes that each sample follows; they stay the same while motions and widths are learnt."""
        self._index = blending.nearest_nodes(torch.from_numpy(sampling.points), self.nodes, self.neighbours)

    def control_displacements(self, sampling: CurveSampling) -> Tensor:
        """Displacements (E, 4, 3) in mm of the curves' control points."""
        points = torch.from_numpy(sampling.points)
        index = self._index
        if index is None or len(index) != len(points):
            index = blending.nearest_nodes(points, self.nodes, self.neighbours)
        return sampling.control(self._displace(points, index))

    def forward(self, points: Tensor) -> Tensor:
        """Displacements (N, 3) in mm of the points (N, 3) in mm."""
        return self._displace(points, blending.nearest_nodes(points, self.nodes, self.neighbours))

    def laplacian_of(self, points: Tensor) -> Tensor:
        """Vector Laplacian (N, 3) in 1 / mm."""
        index = blending.nearest_nodes(points, self.nodes, self.neighbours)
        away = points[:, None] - self.nodes[index]
        _, slope, bend = blending.weight_derivatives(away, self.log_widths.exp()[index])
        translations, turns = self.motions()
        turn = turns[index]
        moved = torch.einsum("nkij,nkj->nki", turn, away) + self.scale * translations[index]
        return (bend[..., None] * moved).sum(1) + 2.0 * torch.einsum("nkij,nkj->ni", turn, slope)

    def _displace(self, points: Tensor, index: Tensor) -> Tensor:
        return self.carried(points, index, self.motions())[0]

    def carried(self, points: Tensor, index: Tensor, motions: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
        """How points are moved, and what is fixed to them turned.

        Parameters
        ----------
        points : (N, 3) mm.
        index : (N, k) the nodes that each follows.
        motions : of the nodes, as `motions` gives them.

        Returns
        -------
        displacements, turns
            (N, 3) mm and (N, 3, 3), the blend of the nodes' R - I.
        """
        away = points[:, None] - self.nodes[index]  # (N, k, 3)
        w = blending.weights(away, self.log_widths.exp()[index])
        translations, turns = motions
        turn = turns[index]
        turned = torch.einsum("nkij,nkj->nki", turn, away)
        moved = (w[..., None] * (turned + self.scale * translations[index])).sum(1)
        return moved, (w[..., None, None] * turn).sum(1)

    def motions(self) -> tuple[Tensor, Tensor]:
        """Translations (M, 3) in units of the scale, and R - I (M, 3, 3)."""
        return self.translations, turn_matrices(self.rotations)

    def metadata(self) -> dict[str, str]:
        """The number of nodes a point follows."""
        return {"neighbours": str(self.neighbours)}

    @classmethod
    def restore(cls, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> NodesField:
        """Build the field from `tensors` and `metadata`."""
        field = cls(tensors["nodes"], float(tensors["scale"]), int(metadata["neighbours"]))
        field.load_state_dict({name: torch.from_numpy(np.array(value)) for name, value in tensors.items()})
        field.frozen()
        return field


def turn_matrices(vectors: Tensor) -> Tensor:
    """R - I (M, 3, 3) of rotation vectors (M, 3) in radians (Rodrigues); exact at zero, and smooth there."""
    square = (vectors**2).sum(-1)
    small = square < 1e-6
    safe = torch.where(small, torch.ones_like(square), square)
    angle = torch.sqrt(safe)
    first = torch.where(small, 1.0 - square / 6.0, torch.sin(angle) / angle)
    second = torch.where(small, 0.5 - square / 24.0, (1.0 - torch.cos(angle)) / safe)
    x, y, z = vectors.unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).view(-1, 3, 3)
    return first[:, None, None] * cross + second[:, None, None] * (cross @ cross)
