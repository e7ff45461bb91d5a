"""Smooth blends of what a few nearby nodes say, with exact first and second derivatives.

A point x listens to its k nearest nodes n_i with weights w = softmax(-|x - n_i|^2 / 2 rho_i^2): Gaussians
normalised to a sum of 1, written so that far away from all nodes nothing underflows. Where the set of nearest
nodes changes, the blend has a step of the size of the smallest weight.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Floats = NDArray[np.float64]


def nearest_nodes(points: Tensor, nodes: Tensor, count: int) -> Tensor:
    """(N, k) indices of the ``count`` nodes nearest to each of the points (N, 3)."""
    from scipy.spatial import cKDTree

    tree = cKDTree(nodes.detach().numpy())
    _, index = tree.query(points.detach().numpy(), k=np.arange(1, count + 1))
    return torch.from_numpy(np.asarray(index, dtype=np.int64).reshape(len(points), count))


def node_spacing(nodes: Floats) -> Floats:
    """(N,) mm: distance from each node to its nearest neighbour; the mean of all where nodes coincide."""
    from scipy.spatial import cKDTree

    if len(nodes) < 2:
        return np.ones(len(nodes))
    distance = cKDTree(nodes).query(nodes, k=2)[0][:, 1]
    fallback = float(distance.mean()) or 1.0
    return np.where(distance > 1e-3 * fallback, distance, fallback)


def spread_out(points: Floats, count: int) -> NDArray[np.int64]:
    """Indices of ``count`` points that lie far from each other (farthest-point sampling from the first)."""
    count = min(count, len(points))
    chosen = np.zeros(count, dtype=np.int64)
    distance = np.full(len(points), np.inf)
    for i in range(1, count):
        distance = np.minimum(distance, ((points - points[chosen[i - 1]]) ** 2).sum(axis=1))
        chosen[i] = int(np.argmax(distance))
    return chosen


def weights(offsets: Tensor, widths: Tensor) -> Tensor:
    """Weights (N, k) of nodes at offsets x - n_i (N, k, 3) with widths rho_i (N, k)."""
    return torch.softmax(-0.5 * (offsets**2).sum(-1) / widths**2, dim=-1)


def weight_derivatives(offsets: Tensor, widths: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Weights (N, k), their gradients (N, k, 3) and their Laplacians (N, k) with respect to x."""
    w = weights(offsets, widths)
    slope = -offsets / (widths**2)[..., None]  # gradients of the exponents
    bend = -3.0 / widths**2  # their Laplacians
    away = slope - (w[..., None] * slope).sum(1, keepdim=True)
    gradient = w[..., None] * away
    spread = (gradient * slope).sum(-1) + w * bend
    laplacian = w * ((away**2).sum(-1) + bend - spread.sum(1, keepdim=True))
    return w, gradient, laplacian
