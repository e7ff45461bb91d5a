"""From kernels in space to kernels in pictures: elliptical weighted averaging (EWA) and the pixels' low-pass.

A Gaussian is projected by the perspective's first-order expansion at its mean, with the Jacobian

    J = [[fx / z, 0, -fx x / z^2], [0, fy / z, -fy y / z^2]],    Sigma' = J W Sigma W^T J^T.

References
----------
M. Zwicker et al., "EWA splatting", IEEE TVCG 8(3), 2002. Z. Yu et al., "Mip-Splatting", CVPR 2024 (low-pass
with compensated opacity).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from frametwin.cameras import Camera, packed
from frametwin.raster.kernels import AnchoredKernels

PIXEL_VARIANCE = 1.0 / 12.0
"""Variance of a square pixel of side 1, in pixel^2."""

NEAR = 1.0
"""Depth in mm below which a kernel counts as behind the camera."""

_MARGIN = 0.3  # share of the picture beyond its rim where the first-order expansion is still fair


@dataclass(frozen=True, eq=False)
class Views:
    """Pinhole cameras as tensors.

    Attributes
    ----------
    rotation, translation : (V, 3, 3) and (V, 3) mm, world to camera (x right, y down, z forward).
    focal, centre : (V, 2) pixels.
    sizes : height and width of each view.
    """

    rotation: Tensor
    translation: Tensor
    focal: Tensor
    centre: Tensor
    sizes: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, cameras: Sequence[Camera], dtype: torch.dtype = torch.float64) -> Views:
        """Pack cameras; their distortion is left out (pictures are undistorted when they are read)."""
        rows = torch.from_numpy(packed(cameras)).to(dtype)
        return cls(
            rotation=rows[:, :9].reshape(-1, 3, 3),
            translation=rows[:, 9:12],
            focal=rows[:, 12:14],
            centre=rows[:, 14:16],
            sizes=tuple((camera.height, camera.width) for camera in cameras),
        )

    def only(self, chosen: Sequence[int]) -> Views:
        """Some of the views, by number."""
        rows = list(chosen)
        return Views(
            rotation=self.rotation[rows],
            translation=self.translation[rows],
            focal=self.focal[rows],
            centre=self.centre[rows],
            sizes=tuple(self.sizes[i] for i in rows),
        )


@dataclass(frozen=True, eq=False)
class Projected:
    """Kernels in the pictures, before the low-pass.

    Attributes
    ----------
    means : (V, N, 2) pixels.
    covariances : (V, N, 3) pixel^2, as xx, xy, yy.
    depth : (V, N) mm along the viewing direction.
    visible : (V, N) bool; False behind the camera and far beside the picture, where values mean nothing.
    """

    means: Tensor
    covariances: Tensor
    depth: Tensor
    visible: Tensor


def project_anchored(kernels: AnchoredKernels, thickness: Tensor, views: Views) -> Projected:
    """Project kernels of equal spread across; the short cut for the paper's kernels.

    With M = J W, the covariance is tau^2 J J^T + (sigma_t^2 - tau^2) (M t)(M t)^T, as W is a rotation.

    Parameters
    ----------
    kernels : N kernels.
    thickness : (N,) tau in mm.
    views : V cameras of the same floating type.
    """
    means, j, depth, visible = _expand(kernels.means, views)
    axis = torch.einsum("vij,nj->vni", views.rotation, kernels.tangents)
    ax, ay, az = axis.unbind(-1)
    tx, ty = j[0] * ax + j[1] * az, j[2] * ay + j[3] * az
    across = (thickness**2)[None]
    rest = (kernels.along**2)[None] - across
    covariances = torch.stack(
        [
            across * (j[0] ** 2 + j[1] ** 2) + rest * tx**2,
            across * (j[1] * j[3]) + rest * (tx * ty),
            across * (j[2] ** 2 + j[3] ** 2) + rest * ty**2,
        ],
        dim=-1,
    )
    return Projected(means, covariances, depth, visible)


def project_covariances(means: Tensor, covariances: Tensor, views: Views) -> Projected:
    """Project Gaussians of any shape.

    Parameters
    ----------
    means : (N, 3) mm.
    covariances : (N, 3, 3) mm^2.
    views : V cameras of the same floating type.
    """
    pixels, j, depth, visible = _expand(means, views)
    zero = torch.zeros_like(j[0])
    jacobian = torch.stack([torch.stack([j[0], zero, j[1]], -1), torch.stack([zero, j[2], j[3]], -1)], -2)
    m = jacobian @ views.rotation[:, None]  # (V, N, 2, 3)
    flat = m @ covariances[None] @ m.transpose(-1, -2)
    return Projected(pixels, torch.stack([flat[..., 0, 0], flat[..., 0, 1], flat[..., 1, 1]], -1), depth, visible)


def low_pass(
    projected: Projected, opacity: Tensor, *, variance: float = PIXEL_VARIANCE
) -> tuple[Tensor, Tensor, Tensor]:
    """Widen the kernels by the pixel and take their opacity down by as much, then invert the covariances.

    Parameters
    ----------
    projected : N kernels in V views.
    opacity : (N,) alpha in 0..1.
    variance : added to both axes, pixel^2; the opacity is multiplied by sqrt(det before / det after), which
        keeps the integral of the kernel.

    Returns
    -------
    means, conics, opacity
        (V, N, 2), (V, N, 3) and (V, N) as `frametwin.raster.splat.splat_flat` takes them; conics of unseen kernels are
        zeros.
    """
    xx, xy, yy = projected.covariances.unbind(-1)
    before = xx * yy - xy**2
    wide_x, wide_y = xx + variance, yy + variance
    after = wide_x * wide_y - xy**2
    sound = projected.visible & (before > 0.0) & (after > 0.0) & torch.isfinite(after)
    one = torch.ones_like(after)
    before, after = torch.where(sound, before, one), torch.where(sound, after, one)
    conics = torch.stack([wide_y / after, -xy / after, wide_x / after], dim=-1)
    conics = torch.where(sound[..., None], conics, torch.zeros_like(conics))
    return projected.means, conics, opacity[None] * torch.sqrt(before / after)


def _expand(points: Tensor, views: Views) -> tuple[Tensor, tuple[Tensor, ...], Tensor, Tensor]:
    """Pixels (V, N, 2), the four entries of J that are not zero, depth and visibility (V, N)."""
    local = torch.einsum("vij,nj->vni", views.rotation, points) + views.translation[:, None]
    x, y, depth = local.unbind(-1)
    ahead = depth > NEAR
    z = torch.where(ahead, depth, torch.ones_like(depth))  # never divide by a depth near zero, not even unseen
    fx, fy = views.focal[:, None, 0], views.focal[:, None, 1]
    u, v = fx * x / z, fy * y / z
    means = torch.stack([u + views.centre[:, None, 0], v + views.centre[:, None, 1]], dim=-1)
    sizes = torch.tensor([(w, h) for h, w in views.sizes], dtype=points.dtype)[:, None]  # (V, 1, 2) as x, y
    near_picture = ((means > -_MARGIN * sizes) & (means < (1.0 + _MARGIN) * sizes)).all(-1)
    visible = ahead & near_picture
    means = torch.where(visible[..., None], means, torch.zeros_like(means))
    return means, (fx / z, -u / z, fy / z, -v / z), depth, visible
