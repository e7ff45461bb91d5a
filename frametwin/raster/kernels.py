"""Gaussian kernels anchored to Bezier curves: where they sit, which way they point and how far they spread.

Kernel j of K on a strut sits at u_j = (j + 0.5) / K (paper, Eq. 2), its axis along the tangent. Along the
axis it spreads by sigma_t, the chord between u_j - 1/2K and u_j + 1/2K (times a factor, 1 in the paper),
across it by tau, its thickness:

    Sigma = tau^2 I + (sigma_t^2 - tau^2) t t^T.

With equal spread across, the frame about the axis cannot be seen; `anisotropic_covariance` takes one that
can. Struts may have different numbers of kernels: a `KernelLayout` lists them one after another.

References
----------
FrameTwin paper, section V.A, Eq. 2-4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from frametwin.cameras import Camera
from frametwin.geometry import bezier
from frametwin.geometry.rotation_frames import rotation_minimising_frames

Floats = NDArray[np.float64]

_TINY = 1e-12  # mm; added under square roots so that a curve that stands still has a finite gradient


@dataclass(frozen=True, eq=False)
class KernelLayout:
    """How many kernels each strut has, and where they sit on it.

    Attributes
    ----------
    counts : (E,) int64 kernels of each strut, at least 1.

    Raises
    ------
    ValueError
        If a count is below 1.
    """

    counts: NDArray[np.int64]

    def __post_init__(self) -> None:
        counts = np.array(self.counts, dtype=np.int64)
        if counts.ndim != 1 or counts.size == 0 or counts.min() < 1:
            raise ValueError("a kernel layout needs one count of 1 or more for each strut")
        counts.setflags(write=False)
        object.__setattr__(self, "counts", counts)

    @classmethod
    def even(cls, struts: int, count: int) -> KernelLayout:
        """The same number of kernels on every strut, as in the paper."""
        return cls(np.full(struts, count, dtype=np.int64))

    @property
    def size(self) -> int:
        """Number of kernels N in all."""
        return int(self.counts.sum())

    @property
    def even_count(self) -> int | None:
        """Kernels of each strut if all have the same number, else None."""
        first = int(self.counts[0])
        return first if bool((self.counts == first).all()) else None

    @cached_property
    def strut_of_kernel(self) -> NDArray[np.int64]:
        """(N,) index of the strut that each kernel sits on, ascending."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def half_step(self) -> Floats:
        """(N,) half the distance to the next kernel, 1 / 2K, in the curve's parameter."""
        return 0.5 / self.counts[self.strut_of_kernel]

    @cached_property
    def parameter(self) -> Floats:
        """(N,) the curve's parameter u_j = (j + 0.5) / K (paper, Eq. 2)."""
        first = np.repeat(np.cumsum(self.counts) - self.counts, self.counts)
        return (2.0 * (np.arange(self.size) - first) + 1.0) * self.half_step

    def _stencil(self, rows: slice) -> Floats:
        """(3, n, 4) weights of the control points in position, derivative and chord of some kernels."""
        u, h = self.parameter[rows], self.half_step[rows]
        quadratic = 3.0 * bezier.bernstein(2, u)  # the derivative of a cubic is a quadratic of differences
        slope = np.pad(quadratic, ((0, 0), (1, 0))) - np.pad(quadratic, ((0, 0), (0, 1)))
        chord = bezier.bernstein(3, u + h) - bezier.bernstein(3, u - h)
        return np.stack([bezier.bernstein(3, u), slope, chord])


@dataclass(frozen=True, eq=False)
class AnchoredKernels:
    """Kernels in space.

    Attributes
    ----------
    means : (N, 3) mm.
    tangents : (N, 3) unit vectors along the curve.
    along : (N,) standard deviation sigma_t along the tangent, mm.
    """

    means: Tensor
    tangents: Tensor
    along: Tensor


def anchored_kernels(control_points: Tensor, layout: KernelLayout, *, spread: float = 1.0) -> AnchoredKernels:
    """Place kernels on the curves; differentiable with respect to the control points.

    Parameters
    ----------
    control_points : (E, 4, 3) mm, any floating type.
    layout : kernels of each of the E struts.
    spread : sigma_t as a multiple of the chord between neighbouring half-way points; 1 is the paper's.

    Returns
    -------
    N kernels, those of one strut together.

    Raises
    ------
    ValueError
        If the layout is for another number of struts.
    """
    if control_points.shape != (len(layout.counts), 4, 3):
        raise ValueError(f"control points {tuple(control_points.shape)} do not fit {len(layout.counts)} struts")
    count = layout.even_count
    if count is not None:
        stencil = torch.from_numpy(layout._stencil(slice(0, count))).to(control_points.dtype)  # (3, K, 4)
        values = torch.einsum("skc,ecx->sekx", stencil, control_points).reshape(3, -1, 3)
    else:
        stencil = torch.from_numpy(layout._stencil(slice(None))).to(control_points.dtype)  # (3, N, 4)
        picked = control_points.index_select(0, torch.from_numpy(layout.strut_of_kernel))
        values = torch.einsum("snc,ncx->snx", stencil, picked)
    means, slope, chord = values.unbind(0)
    return AnchoredKernels(
        means=means,
        tangents=slope / _norm(slope)[:, None],
        along=spread * _norm(chord),
    )


def isotropic_covariance(kernels: AnchoredKernels, thickness: Tensor) -> Tensor:
    """Covariances (N, 3, 3) mm^2 with the same spread ``thickness`` (N,) mm all around the curve."""
    eye = torch.eye(3, dtype=thickness.dtype)
    axis = kernels.tangents[:, :, None] * kernels.tangents[:, None, :]
    across = (thickness**2)[:, None, None]
    return across * eye + ((kernels.along**2)[:, None, None] - across) * axis


def anisotropic_covariance(frames: Tensor, scales: Tensor) -> Tensor:
    """Covariances F S S^T F^T (paper, Eq. 4, which writes the product in another order).

    Parameters
    ----------
    frames : (N, 3, 3) orthonormal, with tangent, normal and binormal as columns.
    scales : (N, 3) standard deviations sigma_t, sigma_n, sigma_b in mm.

    Returns
    -------
    (N, 3, 3) mm^2.
    """
    factor = frames * scales[:, None, :]
    return factor @ factor.transpose(1, 2)


def kernel_frames(control_points: Tensor, layout: KernelLayout, kernels: AnchoredKernels) -> Tensor:
    """Rotation-minimising frames of the kernels.

    The frame follows the tangent differentiably; its twist about the tangent is taken as constant.

    Parameters
    ----------
    control_points : (E, 4, 3) mm.
    layout, kernels : as given to and got from `anchored_kernels`.

    Returns
    -------
    (N, 3, 3) with tangent, normal and binormal as columns.
    """
    curves = control_points.detach().numpy().astype(np.float64)
    start = np.empty((layout.size, 3))
    for count in np.unique(layout.counts):
        chosen = layout.counts == count
        u = (np.arange(count) + 0.5) / count
        normals = rotation_minimising_frames(curves[chosen], u).normal  # (e, K, 3)
        start[chosen[layout.strut_of_kernel]] = normals.reshape(-1, 3)
    tangent = kernels.tangents
    normal = torch.from_numpy(start).to(tangent.dtype)
    normal = normal - (normal * tangent).sum(-1, keepdim=True) * tangent
    normal = normal / _norm(normal)[:, None]
    return torch.stack([tangent, normal, torch.linalg.cross(tangent, normal)], dim=-1)


def adaptive_counts(
    control_points: ArrayLike,
    radius: ArrayLike,
    cameras: Sequence[Camera],
    *,
    spacing: float = 1.0,
    least_pixels: float = 1.0,
    minimum: int = 4,
    maximum: int = 40,
) -> NDArray[np.int64]:
    """Number of kernels each strut needs to look like a rod in the pictures.

    Neighbours lie at most ``spacing`` radii apart in the view that sees the strut longest, but not closer
    than ``least_pixels``: short, thin or distant struts take fewer kernels.

    Parameters
    ----------
    control_points : (E, 4, 3) mm.
    radius : (E,) mm.
    cameras : the views; struts behind a camera do not count there.
    spacing : in projected radii.
    least_pixels : in pixels.
    minimum, maximum : bounds of the result.

    Returns
    -------
    (E,) int64.
    """
    curves, radius = np.asarray(control_points, dtype=np.float64), np.asarray(radius, dtype=np.float64)
    points = bezier.evaluate(curves, np.linspace(0.0, 1.0, 9))  # (E, 9, 3)
    needed = np.full(len(curves), float(minimum))
    for camera in cameras:
        pixels, depth = camera.project(points, distort=False)
        length = np.linalg.norm(np.diff(pixels, axis=1), axis=2).sum(axis=1)
        radius_pixels = radius * max(camera.fl_x, camera.fl_y) / np.where(depth > 0.0, depth, np.nan).mean(axis=1)
        needed = np.fmax(needed, length / np.fmax(spacing * radius_pixels, least_pixels))
    return np.clip(np.ceil(needed), minimum, maximum).astype(np.int64)


def effective_radius(thickness: ArrayLike, opacity: ArrayLike, *, spread: float = 1.0) -> Floats:
    """Radius in mm of the rod that blended kernels look like: where their coverage is half of that at the
    centreline.

    Parameters
    ----------
    thickness, opacity : tau in mm and alpha, of one shape.
    spread : as for `anchored_kernels`.

    Returns
    -------
    Radii, of the same shape. For a long straight row of equal kernels; the low-pass of the pixels is left
    out.
    """
    thickness, opacity = np.broadcast_arrays(np.asarray(thickness, float), np.asarray(opacity, float))
    reach = int(np.ceil(4.0 * spread)) + 1
    along = np.exp(-0.5 * (np.arange(-reach, reach + 1) / spread) ** 2)  # neighbours' values at a kernel's own mean
    weight = np.clip(opacity, 0.0, 1.0)[..., None] * along

    def coverage(across: Floats) -> Floats:
        return 1.0 - np.prod(1.0 - weight * across[..., None], axis=-1)

    half = 0.5 * coverage(np.ones_like(thickness))
    low, high = np.zeros_like(thickness), np.ones_like(thickness)
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = coverage(middle) > half
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return thickness * np.sqrt(-2.0 * np.log(0.5 * (low + high)))


def _norm(vectors: Tensor) -> Tensor:
    return torch.sqrt((vectors**2).sum(-1) + _TINY**2)
