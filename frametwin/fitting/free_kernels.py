"""Kernels that have left their curves, as deformation-driven splatting has them: each with a place, a shape and a
direction of its own, carried by control nodes.

They start as the anchored ones. The curve of a strut is the cubic that lies nearest to its kernels, in the order in
which they began: the published method knows no curves, so this is only to have something that can be compared.

References
----------
Y. Huang et al., "SC-GS: sparse-controlled Gaussian splatting", CVPR 2024.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from frametwin.cameras import Camera
from frametwin.fields.node_weights import nearest_nodes
from frametwin.fields.nodes import NodesField, turn_matrices
from frametwin.fields.rigidity import Rigidity
from frametwin.fitting.part_fit import KernelCloud
from frametwin.fitting.settings import FitSettings
from frametwin.fitting.splat_model import SplatModel, stretched, to_array
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.kernels import anchored_kernels, anisotropic_covariance, effective_radius, kernel_frames
from frametwin.raster.projection import Projected, Views, project_covariances

Floats = NDArray[np.float64]


class FreeKernelModel(SplatModel):
    """The model of free kernels; parameters as `SplatModel`."""

    def __init__(
        self, frame: Wireframe, box: Floats, cameras: list[Camera], targets: list[Tensor], settings: FitSettings
    ) -> None:
        super().__init__(frame, box, cameras, targets, settings)
        if not isinstance(self.field, NodesField):
            raise TypeError("free kernels need control nodes to move them")
        self.nodes = self.field
        plan = self.plan.float()
        kernels = anchored_kernels(plan, self.layout, spread=settings.spread)
        self._start = kernels.means
        self._frames = kernel_frames(plan, self.layout, kernels)
        self._index = nearest_nodes(kernels.means.double(), self.nodes.nodes, self.nodes.neighbours)
        self.offsets = torch.zeros_like(kernels.means).requires_grad_()  # in units of the scale
        self.directions = torch.zeros_like(kernels.means).requires_grad_()  # rotation vectors
        across = self._by_kernel(self.log_thickness).detach()
        self.log_scales = torch.stack([kernels.along.log(), across, across], dim=-1).detach().requires_grad_()
        self._rigidity = Rigidity(self.nodes.nodes / self.scale) if settings.rigidity_weight > 0.0 else None
        u = (np.arange(settings.kernels_per_strut) + 0.5) / settings.kernels_per_strut
        self._nearest_cubic = torch.from_numpy(np.linalg.pinv(bezier.bernstein(3, u)))  # (4, K)

    def groups(self) -> list[dict[str, Any]]:
        """As `SplatModel.groups`; places have the field's rate."""
        settings = self.settings
        groups = super().groups()
        groups[0]["params"].append(self.offsets)
        groups = [group for group in groups if group["params"][0] is not self.log_thickness]
        if settings.learn_thickness:
            groups.append({"params": [self.log_scales, self.directions], "lr": settings.thickness_rate})
        return groups

    def _move(self) -> None:
        """Carry the kernels with the nodes."""
        motions = self.nodes.motions()
        own = self._start + self.scale * self.offsets
        moved, turn = self.nodes.carried(own.double(), self._index, motions)
        eye = torch.eye(3)
        self._moved_nodes = self.nodes.nodes / self.scale + motions[0]  # in units of the scale
        self._means = own + moved.float()
        self._axes = (eye + turn.float()) @ (eye + turn_matrices(self.directions)) @ self._frames

    def curves(self) -> Tensor:
        """(E, 4, 3) tensor, mm: the cubics through the kernels, which are moved to where they are now."""
        self._move()
        by_strut = self._means.detach().double().view(len(self.plan), -1, 3)
        return torch.einsum("ck,ekx->ecx", self._nearest_cubic, by_strut)

    def projected(self, curves: Tensor, views: Views) -> tuple[Projected, list[tuple[float, Tensor]]]:
        """The kernels, where `curves` has moved them, in some views, and the nodes' rigidity."""
        covariances = anisotropic_covariance(self._axes, self.log_scales.exp())
        terms = []
        if self._rigidity is not None:
            terms.append((self.settings.rigidity_weight, self._rigidity(self._moved_nodes)))
        return project_covariances(self._means, covariances, views), terms

    def thickness(self) -> Floats:
        """(E, K) array, mm: effective radius by the mean of the two spreads across."""
        tau = to_array(self.log_scales[:, 1:].mean(-1).exp())
        opacity = to_array(torch.sigmoid(self._by_kernel(self.logit_opacity)))
        return stretched(effective_radius(tau, opacity, spread=self.settings.spread), self.layout.counts)

    def cloud(self) -> KernelCloud:
        """The kernels as they are now."""
        with torch.no_grad():
            self._move()
            covariances = anisotropic_covariance(self._axes, self.log_scales.exp())
            opacity = torch.sigmoid(self._by_kernel(self.logit_opacity))
            return KernelCloud(*(to_array(values) for values in (self._means, covariances, opacity)))
