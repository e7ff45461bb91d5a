"""Image losses with structural similarity, as codes that grew out of 3D Gaussian splatting have them.

References
----------
Z. Wang et al., "Image quality assessment: from error visibility to structural similarity", IEEE TIP 13(4), 2004.
B. Kerbl et al., "3D Gaussian splatting for real-time radiance field rendering", 2023 (L1 with a fifth of 1 - SSIM).
Z. Gao et al., "Curve-aware Gaussian splatting for 3D parametric curve reconstruction", ICCV 2025 (squares that are
weighed by class, with a tenth of 1 - SSIM).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor

WINDOW, SIGMA = 11, 1.5
"""Width and standard deviation of the window in pixels."""

STEADY = (0.01**2, 0.03**2)
"""What keeps the two quotients finite, for values of 0 to 1."""

WHITE, WHITE_WEIGHT = 0.1, 5.0
"""Above which grey value a pixel counts as white, and how much more white ones weigh, as published."""


class _Windowed(torch.autograd.Function):
    """Means over the window around each pixel of pictures (N, H, W), black beyond their rim.

    The window is even and what is outside counts as zero, so the gradient is windowed in the same way. OpenCV does it
    ten times faster than torch's convolution on a CPU.
    """

    @staticmethod
    def forward(ctx: Any, maps: Tensor) -> Tensor:
        return _windowed(maps)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        return _windowed(grad)


def _windowed(maps: Tensor) -> Tensor:
    window = cv2.getGaussianKernel(WINDOW, SIGMA)
    arrays = [
        cv2.sepFilter2D(one, -1, window, window, borderType=cv2.BORDER_CONSTANT) for one in maps.contiguous().numpy()
    ]
    return torch.from_numpy(np.stack(arrays))


def ssim(image: Tensor, target: Tensor) -> Tensor:
    """Mean structural similarity of two pictures (H, W); 1 where they are the same."""
    x, y = image, target
    mean_x, mean_y, xx, yy, xy = _Windowed.apply(torch.stack([x, y, x * x, y * y, x * y])).unbind(0)
    c1, c2 = STEADY
    likeness = (2.0 * mean_x * mean_y + c1) * (2.0 * (xy - mean_x * mean_y) + c2)
    size = (mean_x**2 + mean_y**2 + c1) * (xx - mean_x**2 + yy - mean_y**2 + c2)
    return (likeness / size).mean()


def absolute_ssim(image: Tensor, target: Tensor) -> Tensor:
    """0.8 of the mean absolute difference and 0.2 of 1 - SSIM."""
    return 0.8 * (image - target).abs().mean() + 0.2 * (1.0 - ssim(image, target))


def balanced_ssim(image: Tensor, target: Tensor) -> Tensor:
    """0.9 of the mean square, in which white pixels weigh the more the fewer they are, and 0.1 of 1 - SSIM."""
    white = target > WHITE
    count, total = int(white.sum()), target.numel()
    weights = torch.where(white, WHITE_WEIGHT * (total - count + 1) / total, (count + 1) / total)
    return 0.9 * (weights * (image - target) ** 2).mean() + 0.1 * (1.0 - ssim(image, target))


SIMILARITIES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "absolute-ssim": absolute_ssim,
    "balanced-ssim": balanced_ssim,
}
"""Losses of one view by name."""


def similarity_loss(images: Sequence[Tensor], targets: Sequence[Tensor], kind: str) -> Tensor:
    """Sum over views of one of `SIMILARITIES`; pictures are (H, W)."""
    return torch.stack([SIMILARITIES[kind](a, b) for a, b in zip(images, targets, strict=True)]).sum()
