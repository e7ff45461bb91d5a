"""What a fit minimises: the difference between pictures, and the bending of the deformation field.

References
----------
FrameTwin paper, section V.B, Eq. 9-13.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from frametwin.fields.base import checked_box
from frametwin.geometry import bezier

Floats = NDArray[np.float64]


def image_loss(images: Sequence[Tensor], targets: Sequence[Tensor], *, reduction: str = "sum") -> Tensor:
    """Sum over views of the absolute difference (paper, Eq. 9).

    Parameters
    ----------
    images, targets : as many pictures (H, W), or flat vectors, of equal sizes in pairs.
    reduction : over the pixels of each view, "sum" or "mean". The paper writes a sum; the code of 3D Gaussian
        splatting, on which it builds, takes the mean; beside a sum over millions of pixels the paper's weight of the
        bending term is without effect.

    Returns
    -------
    A scalar, in grey values, for the sum times pixels.

    Raises
    ------
    ValueError
        If the numbers or the sizes of the pictures do not agree, or the reduction is unknown.
    """
    if reduction not in ("sum", "mean"):
        raise ValueError(f"{reduction!r} is neither 'sum' nor 'mean'")
    if len(images) != len(targets) or any(a.shape != b.shape for a, b in zip(images, targets, strict=False)):
        raise ValueError("pictures and targets must agree in number and size")
    differences = [(a - b).abs() for a, b in zip(images, targets, strict=True)]
    return torch.stack([one.mean() if reduction == "mean" else one.sum() for one in differences]).sum()


class BendingLoss:
    """Monte Carlo estimate of the bending term (paper, Eq. 10-12),

        integral over the box of gamma(x) |Laplacian d(x)|^2 dx

    in mm^(p + 1), where gamma(x) is the distance to the printed struts to the power p. Gamma lets the field bend freely
    beside printed struts, which the pictures show, and keeps it smooth away from them. Each call draws new points,
    uniform in the box, from a generator of its own.

    Parameters
    ----------
    box : (2, 3) mm, the computational domain.
    control_points : (E, 4, 3) mm, the plan of the printed struts.
    power : p, at least 0; 2 in the paper. With 0 every point counts alike.
    samples : points drawn at each call.
    seed : of the generator.

    Raises
    ------
    ValueError
        If the box has no volume, there is no strut, the power is negative, or there are no samples.
    """

    def __init__(
        self,
        box: ArrayLike,
        control_points: ArrayLike,
        *,
        power: float = 2.0,
        samples: int = 2048,
        seed: int = 0,
    ) -> None:
        from scipy.spatial import cKDTree

        curves = np.asarray(control_points, dtype=np.float64)
        if curves.ndim != 3 or not len(curves) or not power >= 0.0 or samples < 1:
            raise ValueError("the bending term needs a strut, a power of 0 or more and at least one sample")
        self._box = checked_box(box)
        self._power, self._samples = power, samples
        self._rng = np.random.default_rng(seed)
        self._tree = cKDTree(_along(curves, float(np.ptp(self._box, axis=0).max()) / 200.0))

    @property
    def volume(self) -> float:
        """Volume of the box in mm^3."""
        return float(np.prod(np.ptp(self._box, axis=0)))

    def gamma(self, points: ArrayLike) -> Floats:
        """(N,) weights of points (N, 3): the distance to the nearest printed strut, to the power p."""
        distance, _ = self._tree.query(np.asarray(points, dtype=np.float64))
        return np.asarray(distance, dtype=np.float64) ** self._power

    def __call__(self, laplacian_of: Callable[[Tensor], Tensor], dtype: torch.dtype = torch.float64) -> Tensor:
        """Estimate the integral.

        Parameters
        ----------
        laplacian_of : gives the Laplacian (N, 3) at points (N, 3), such as `TorchField.laplacian_of`.
        dtype : of the points it is given.
        """
        points = self._rng.uniform(self._box[0], self._box[1], size=(self._samples, 3))
        weight = torch.from_numpy(self.gamma(points)).to(dtype)
        bend = laplacian_of(torch.from_numpy(points).to(dtype))
        return self.volume * (weight * (bend**2).sum(-1)).mean()


def _along(control_points: Floats, step: float) -> Floats:
    """Points on the curves, at most about ``step`` mm apart, ends included; at least eleven a curve."""
    polygon = np.linalg.norm(np.diff(control_points, axis=1), axis=2).sum(axis=1)
    count = np.maximum(10, np.ceil(polygon / step)).astype(int)
    parts = [
        bezier.evaluate(control_points[count == n], np.linspace(0.0, 1.0, n + 1)).reshape(-1, 3)
        for n in np.unique(count)
    ]
    return np.concatenate(parts)
