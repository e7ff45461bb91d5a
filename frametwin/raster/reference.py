"""The readable reference: depth-sorted front-to-back alpha blending in plain torch.

Slow, differentiable by autograd, in any floating type. The compiled splatter must agree with it.

References
----------
FrameTwin paper, section V.A. B. Kerbl et al., "3D Gaussian splatting for real-time radiance field rendering",
2023.
"""

from __future__ import annotations

import torch
from torch import Tensor

from frametwin.raster.gaussian import FOOTPRINT_FLOOR, MAX_ALPHA


def pixel_centres(height: int, width: int, dtype: torch.dtype = torch.float64) -> Tensor:
    """(H, W, 2) x and y of the pixel centres, which lie at +0.5."""
    y = torch.arange(height, dtype=dtype) + 0.5
    x = torch.arange(width, dtype=dtype) + 0.5
    return torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1)


def footprint(mean: Tensor, conic: Tensor, pixels: Tensor, floor: float = FOOTPRINT_FLOOR) -> Tensor:
    """Value of one Gaussian at the pixels, taken down by ``floor`` so that it ends without a step.

    Parameters
    ----------
    mean : (2,) pixels.
    conic : (3,) A, B, C of the inverse covariance [[A, B], [B, C]].
    pixels : (..., 2).
    floor : 0 gives the Gaussian itself, without end.

    Returns
    -------
    (...) values in 0..1.
    """
    dx, dy = (pixels - mean).unbind(-1)
    a, b, c = conic.unbind(-1)
    g = torch.exp(-0.5 * (a * dx**2 + 2.0 * b * dx * dy + c * dy**2))
    return torch.clamp((g - floor) / (1.0 - floor), min=0.0)


def blend(
    means: Tensor,
    conics: Tensor,
    opacity: Tensor,
    depth: Tensor,
    size: tuple[int, int],
    *,
    floor: float = FOOTPRINT_FLOOR,
) -> Tensor:
    """Picture of one view: kernels of grey value 1, sorted by depth, blended front to back.

    Parameters
    ----------
    means : (N, 2) pixels.
    conics : (N, 3); zeros for kernels not seen.
    opacity : (N,) 0..1.
    depth : (N,) mm; only the order counts, and with one grey value not even that.
    size : height and width.
    floor : see `footprint`.

    Returns
    -------
    (H, W) grey values: sum_i a_i prod_{j<i} (1 - a_j) with a_i = alpha_i G_i.
    """
    pixels = pixel_centres(*size, dtype=means.dtype)
    image = torch.zeros(size, dtype=means.dtype)
    passed = torch.ones(size, dtype=means.dtype)
    for i in torch.argsort(depth, stable=True).tolist():
        if not bool((conics[i] != 0.0).any()):
            continue
        a = torch.clamp(opacity[i] * footprint(means[i], conics[i], pixels, floor), max=MAX_ALPHA)
        image = image + passed * a
        passed = passed * (1.0 - a)
    return image
