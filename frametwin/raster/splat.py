"""The compiled Gaussian splatter as a differentiable torch function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from frametwin.raster import gaussian


class _Splat(torch.autograd.Function):
    """All views at once, in one flat buffer."""

    @staticmethod
    def forward(ctx: Any, means: Tensor, conics: Tensor, opacity: Tensor, sizes: np.ndarray) -> Tensor:
        buffer = gaussian.transmittance(means.numpy(), conics.numpy(), opacity.numpy(), sizes)
        ctx.save_for_backward(means, conics, opacity)
        ctx.sizes, ctx.buffer = sizes, buffer
        return torch.from_numpy(np.float32(1.0) - buffer)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:
        saved = ctx.saved_tensors
        means, conics, opacity = (x.detach().numpy() for x in saved)
        results = gaussian.gradients(means, conics, opacity, ctx.sizes, ctx.buffer, grad.numpy())
        grads = [torch.from_numpy(g.copy()).to(x.dtype) for g, x in zip(results, saved, strict=True)]
        return grads[0], grads[1], grads[2], None


def splat_flat(means: Tensor, conics: Tensor, opacity: Tensor, sizes: Sequence[tuple[int, int]]) -> Tensor:
    """Pictures of anchored Gaussian kernels of grey value 1, one after another; see `frametwin.raster.gaussian`.

    Parameters
    ----------
    means : (V, N, 2) tensor, pixels
        2D means, centres of pixels at +0.5.
    conics : (V, N, 3) tensor, pixel^-2
        Inverse 2D covariances A, B, C; zeros for kernels that the view does not see.
    opacity : (V, N) tensor, 0..1
    sizes
        Height and width of each of the V views, which may differ.

    Returns
    -------
    pictures : (sum of height x width,) tensor, float32
        Gradients flow to means, conics and opacity.

    Raises
    ------
    ValueError
        If the shapes do not fit each other.
    FloatingPointError
        If an input is not finite.
    """
    shape = (len(sizes), means.shape[1])
    if means.shape != (*shape, 2) or conics.shape != (*shape, 3) or opacity.shape != shape:
        raise ValueError(
            f"{len(sizes)} views need means (V, N, 2), conics (V, N, 3) and opacity (V, N), "
            f"not {tuple(means.shape)}, {tuple(conics.shape)} and {tuple(opacity.shape)}"
        )
    for name, values in (("means", means), ("conics", conics), ("opacity", opacity)):
        if not bool(torch.isfinite(values).all()):
            raise FloatingPointError(f"the {name} of the kernels hold values that are not finite")
    table = np.array(sizes, dtype=np.int64).reshape(-1, 2)
    return _Splat.apply(means, conics, opacity, table)
