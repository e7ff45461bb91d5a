"""The as-rigid-as-possible energy: how far a set of nodes is from moving like stiff pieces.

    E = sum_i sum_j w_ij |(q_i - q_j) - R_i (p_i - p_j)|^2

where node i at p_i has come to q_i, j runs over its nearest neighbours, and R_i is the rotation that makes the inner
sum least. As the energy is at its least in R_i, its gradient is that with R_i held, so no derivative of the singular
value decomposition is needed.

References
----------
O. Sorkine and M. Alexa, "As-rigid-as-possible surface modeling", SGP 2007. Y. Huang et al., "SC-GS: sparse-controlled
Gaussian splatting", CVPR 2024 (of control nodes, weights by distance that sum to 1 for each).
"""

from __future__ import annotations

import torch
from torch import Tensor

from frametwin.fields.node_weights import nearest_nodes

NEIGHBOURS = 10
"""Nodes that each is tied to, as published."""


class Rigidity:
    """The energy of one set of nodes.

    Parameters
    ----------
    nodes : (M, 3) tensor
        Where they are before anything moves, in any unit.
    neighbours : int
        To how many others each is tied, at the most.

    Raises
    ------
    ValueError
        If there are fewer than two nodes.
    """

    def __init__(self, nodes: Tensor, neighbours: int = NEIGHBOURS) -> None:
        if len(nodes) < 2:
            raise ValueError("rigidity needs two nodes or more")
        count = min(neighbours, len(nodes) - 1)
        self._others = nearest_nodes(nodes, nodes, count + 1)[:, 1:]  # (M, k); the nearest of all is the node itself
        self._arms = nodes[:, None] - nodes[self._others]
        square = (self._arms**2).sum(-1)
        self.weights = torch.softmax(-square / square.mean().clamp_min(1e-30), dim=-1)  # (M, k)

    def __call__(self, moved: Tensor) -> Tensor:
        """Energy, in squared units of the nodes, of where they are now (M, 3)."""
        arms = moved[:, None] - moved[self._others]
        with torch.no_grad():
            turns = best_rotations(self._arms, arms, self.weights)
        gap = arms - torch.einsum("mij,mkj->mki", turns, self._arms)
        return (self.weights * (gap**2).sum(-1)).sum()


def best_rotations(before: Tensor, after: Tensor, weights: Tensor) -> Tensor:
    """(M, 3, 3) rotations that turn vectors (M, k, 3) into others best, with weights (M, k) (Kabsch's algorithm)."""
    u, _, vh = torch.linalg.svd(torch.einsum("mk,mki,mkj->mij", weights, after, before))
    flip = torch.ones(len(u), 3, dtype=u.dtype)
    flip[:, 2] = torch.sign(torch.linalg.det(u @ vh))  # a rotation, not a reflection
    return (u * flip[:, None]) @ vh
