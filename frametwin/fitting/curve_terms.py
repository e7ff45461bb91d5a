"""What curve-driven splatting asks of its curves beside the pictures.

Lengths are in units of half the longest side of the domain, as everywhere in a fit.

References
----------
Z. Gao et al., "Curve-aware Gaussian splatting for 3D parametric curve reconstruction", ICCV 2025, and the figures of
its published code.
"""

from __future__ import annotations

import torch
from torch import Tensor

WIDEST = 0.005
"""Width above which curves are made thinner."""

REACH = 0.05
"""Ends of different curves that are nearer than this are drawn together."""

LATE = 0.7
"""Share of the steps after which they are."""

FAINT = 0.5
"""Square of the opacity around which faint curves are made fainter."""


def smoothness(tangents: Tensor) -> Tensor:
    """Mean of 1 - |cos| between the unit tangents (E, K, 3) of neighbouring kernels; 0 for straight curves."""
    cosine = (tangents[:, 1:] * tangents[:, :-1]).sum(-1)
    return (1.0 - cosine.abs()).mean()


def sparsity(opacity: Tensor) -> Tensor:
    """Mean of log(1 + alpha^2 / 0.5) of opacities (N,)."""
    return torch.log1p(opacity**2 / FAINT).mean()


def excess_width(width: Tensor) -> Tensor:
    """Mean of what widths (E,) have above `WIDEST`, of those that have any."""
    wide = width > WIDEST
    return (width[wide] - WIDEST).mean() if bool(wide.any()) else width.sum() * 0.0


def connection(ends: Tensor) -> Tensor:
    """Mean distance between ends (E, 2, 3) of different curves that are nearer than `REACH`."""
    from scipy.spatial import cKDTree

    points = ends.reshape(-1, 3)
    pairs = torch.from_numpy(cKDTree(points.detach().numpy()).query_pairs(REACH, output_type="ndarray"))
    pairs = pairs[pairs[:, 0] // 2 != pairs[:, 1] // 2]
    if not len(pairs):
        return points.sum() * 0.0
    gap = points[pairs[:, 0]] - points[pairs[:, 1]]
    return torch.sqrt((gap**2).sum(-1) + 1e-24).mean()
