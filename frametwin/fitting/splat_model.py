"""The paper's model of what is seen: curves moved by a field, kernels anchored to them, splatted into every view.

References
----------
FrameTwin paper, sections III.A and V.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from frametwin.cameras import Camera
from frametwin.fields.free import FreeField
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_torch import TrainableLattice
from frametwin.fields.network import NetworkField
from frametwin.fields.nodes import NodesField
from frametwin.fields.sampling import CurveSampling
from frametwin.fields.steered_nodes import SteeredNodes
from frametwin.fields.torch_field import TorchField
from frametwin.fitting import curve_terms
from frametwin.fitting.losses import BendingLoss, image_loss
from frametwin.fitting.part_fit import KernelCloud
from frametwin.fitting.settings import FitSettings
from frametwin.fitting.similarity import similarity_loss
from frametwin.fitting.view_turns import ViewTurns
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.kernels import AnchoredKernels, KernelLayout, adaptive_counts, anchored_kernels, effective_radius
from frametwin.raster.projection import Projected, Views, low_pass, project_anchored
from frametwin.raster.splat import splat_flat

Floats = NDArray[np.float64]


class SplatModel:
    """What is learnt, and the loss that it has: the field, and each kernel's thickness and opacity.

    Parameters
    ----------
    frame : Wireframe
        The plan of what is printed: E struts.
    box : (2, 3) array, mm
        The computational domain.
    cameras : list of Camera
        Without distortion.
    targets : list of (H, W) tensor
        What they see, 0..1.
    settings : FitSettings
    """

    def __init__(
        self,
        frame: Wireframe,
        box: Floats,
        cameras: list[Camera],
        targets: list[Tensor],
        settings: FitSettings,
    ) -> None:
        self.settings = settings
        self.sampling = CurveSampling.of(frame, settings.samples)
        self.plan = torch.from_numpy(self.sampling.control_points)
        self.scale = 0.5 * float(np.ptp(box, axis=0).max())
        self.field = _start_field(box, self.scale, self.sampling, settings)
        self.field.prepare(self.sampling)
        self.layout = _layout(frame, cameras, settings)
        self.views = Views.of(cameras, torch.float32)
        self.targets = targets
        self.turns = ViewTurns(len(cameras), settings.views_per_step, settings.seed)
        alpha = settings.opacity_start
        width = effective_radius(1.0, alpha, spread=settings.spread)  # of kernels with tau = 1
        values = np.arange(frame.strut_count) if settings.values_by_strut else self.layout.strut_of_kernel
        tau = frame.radius[values] / float(width)
        self.log_thickness = torch.tensor(np.log(tau), dtype=torch.float32).requires_grad_()
        self.logit_opacity = torch.full((len(values),), float(np.log(alpha / (1.0 - alpha)))).requires_grad_()
        self.bending = BendingLoss(
            box,
            frame.control_points,
            power=settings.bending_power,
            samples=settings.bending_samples,
            seed=settings.seed,
        )

    def groups(self) -> list[dict]:
        """Parameters and their learning rates, as torch's optimisers take them; the field's come first."""
        settings = self.settings
        rate = settings.learning_rate_scale * settings.learning_rate
        groups = [{"params": list(self.field.parameters()), "lr": rate}]
        if settings.learn_thickness:
            groups.append({"params": [self.log_thickness], "lr": settings.thickness_rate})
        if settings.learn_opacity:
            groups.append({"params": [self.logit_opacity], "lr": settings.opacity_rate})
        return groups

    def curves(self) -> Tensor:
        """(E, 4, 3) tensor, mm: the control points; differentiable."""
        return self.plan + self.field.control_displacements(self.sampling).double()

    def loss(self, curves: Tensor) -> Tensor:
        """Total loss of curves (paper, Eq. 13) in the views of the next step."""
        settings = self.settings
        chosen = self.turns.take()
        views = self.views if len(chosen) == len(self.targets) else self.views.only(chosen)
        projected, terms = self.projected(curves, views)
        opacity = torch.sigmoid(self._by_kernel(self.logit_opacity))
        means, conics, opacity = low_pass(projected, opacity, variance=settings.pixel_variance)
        seen = splat_flat(means, conics, opacity, views.sizes)
        loss = self._image_loss(seen, [self.targets[i] for i in chosen])
        if settings.bending_weight > 0.0:
            # From mm to units of the scale: gamma has the power p, the volume 3, the Laplacian squared -2.
            unit = self.scale ** -(settings.bending_power + 1.0)
            bend = self.bending(self.field.laplacian_of, self.field.dtype)
            loss = loss + settings.bending_weight * unit * bend
        for weight, term in terms:
            loss = loss + weight * term
        return loss

    def projected(self, curves: Tensor, views: Views) -> tuple[Projected, list[tuple[float, Tensor]]]:
        """Kernels of curves in some views, and what is asked of them beside the pictures, with its weights."""
        kernels = anchored_kernels(curves.float(), self.layout, spread=self.settings.spread)
        projected = project_anchored(kernels, self._by_kernel(self.log_thickness).exp(), views)
        return projected, self._curve_terms(curves, kernels)

    def _curve_terms(self, curves: Tensor, kernels: AnchoredKernels) -> list[tuple[float, Tensor]]:
        settings, terms = self.settings, []
        count = self.layout.even_count
        if settings.smoothness_weight > 0.0 and count is not None:
            terms.append((settings.smoothness_weight, curve_terms.smoothness(kernels.tangents.view(-1, count, 3))))
        if settings.opacity_weight > 0.0:
            terms.append((settings.opacity_weight, curve_terms.sparsity(torch.sigmoid(self.logit_opacity))))
        if settings.width_weight > 0.0:
            terms.append((settings.width_weight, curve_terms.excess_width(self.log_thickness.exp() / self.scale)))
        if settings.connection_weight > 0.0 and self.turns.taken > curve_terms.LATE * settings.iterations:
            terms.append((settings.connection_weight, curve_terms.connection(curves[:, [0, 3]] / self.scale)))
        return terms

    def _image_loss(self, seen: Tensor, targets: list[Tensor]) -> Tensor:
        kind = self.settings.image_loss
        if kind == "sum":  # of all views at once, which only have to be added
            return image_loss([seen], [torch.cat([target.flatten() for target in targets])], reduction=kind)
        images = list(seen.split([target.numel() for target in targets]))
        if kind == "mean":
            return image_loss(images, [target.flatten() for target in targets], reduction=kind)
        shaped = [image.view(target.shape) for image, target in zip(images, targets, strict=True)]
        return similarity_loss(shaped, targets, kind)

    def _by_kernel(self, values: Tensor) -> Tensor:
        """(N,) values of all kernels, of which those of a strut may have one together."""
        return values[torch.from_numpy(self.layout.strut_of_kernel)] if self.settings.values_by_strut else values

    def cloud(self) -> KernelCloud | None:
        """Kernels that are not on the curves; none of these are."""
        return None

    def opacity(self) -> Floats:
        """(E, K) array, 0..1: opacity along the struts."""
        return stretched(to_array(torch.sigmoid(self._by_kernel(self.logit_opacity))), self.layout.counts)

    def thickness(self) -> Floats:
        """(E, K) array, mm: effective radius along the struts."""
        opacity = to_array(torch.sigmoid(self._by_kernel(self.logit_opacity)))
        tau = to_array(self._by_kernel(self.log_thickness).exp())
        radius = effective_radius(tau, opacity, spread=self.settings.spread)
        return stretched(radius, self.layout.counts)


def stretched(values: Floats, counts: NDArray[np.int64]) -> Floats:
    """Values of kernels as a table; struts that have fewer than others repeat theirs.

    Parameters
    ----------
    values : (N,) array
        Of all kernels, strut by strut.
    counts : (E,) array of int
        Kernels of each strut.

    Returns
    -------
    (E, K) array
        K being the largest of ``counts``.
    """
    width = int(counts.max())
    first = np.cumsum(counts) - counts
    return values[first[:, None] + np.arange(width) * counts[:, None] // width]


def to_array(values: Tensor) -> Floats:
    """A tensor as an array of doubles."""
    return values.detach().numpy().astype(np.float64)


def _start_field(box: Floats, scale: float, sampling: CurveSampling, settings: FitSettings) -> TorchField:
    """A field without displacement of the wanted kind."""
    if settings.field == "network":
        return NetworkField(
            box, seed=settings.seed, encoding=settings.encoding, initial_weights=settings.initial_weights
        )
    if settings.field == "lattice":
        lattice = LatticeField.zeros(box, [even_cells(box, cells) for cells in settings.lattice_cells])
        return TrainableLattice(lattice, scale)
    if settings.field == "free":
        return FreeField.on_curves(sampling, scale, settings.share_ends)
    nodes = NodesField.spread_over(sampling.points, settings.node_count, scale, settings.node_neighbours)
    if settings.node_motion == "free":
        return nodes
    first = {"encoding": settings.encoding, "initial_weights": settings.initial_weights}
    return SteeredNodes(nodes.nodes.numpy(), scale, settings.node_neighbours, settings.seed, **first)


def _layout(frame: Wireframe, cameras: Sequence[Camera], settings: FitSettings) -> KernelLayout:
    most = settings.kernels_per_strut
    if not settings.adaptive_kernels:
        return KernelLayout.even(frame.strut_count, most)
    return KernelLayout(
        adaptive_counts(frame.control_points, frame.radius, cameras, minimum=min(4, most), maximum=most)
    )
