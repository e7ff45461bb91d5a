"""The paper's fit: a deformation field learnt through splatted, curve-anchored Gaussians.

Each iteration moves the samples of the plan by the field, refits the control points, anchors kernels to the
curves, splats them into every view, compares with the masks and takes one step of Adam on the field, the
thickness and the opacity of each kernel (paper, sections III.A and V).

What the paper leaves open is decided as follows.

- The field works in coordinates that map the longest side of the computational domain to -1..1, evenly along
  all axes, and its output is in the same unit. The bending integral is taken in these coordinates too, so its
  weight means the same for frames of all sizes; the image loss is the plain sum over pixels.
- Thickness is learnt as a logarithm and opacity as a logit with the rates of the 3D Gaussian splatting code
  that the paper builds on; thickness starts where the blended kernels look as wide as the planned strut.
- The learning rate is "gradually reduced" with a minimum: half a cosine, as torch's annealing with a minimum
  does it. (A geometric fall between the same two rates ends a tenth further from the truth.)

References
----------
FrameTwin paper, sections III to V.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.fields.base import DeformationField, enlarged_box
from frametwin.fields.free import FreeField
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_torch import TrainableLattice
from frametwin.fields.network import NetworkField
from frametwin.fields.nodes import NodesField
from frametwin.fields.sampling import CurveSampling
from frametwin.fields.torch_field import TorchField
from frametwin.fitting.losses import BendingLoss, image_loss
from frametwin.fitting.settings import FitSettings
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster.kernels import KernelLayout, adaptive_counts, anchored_kernels, effective_radius
from frametwin.raster.projection import Views, low_pass, project_anchored
from frametwin.raster.splat import splat_flat

Floats = NDArray[np.float64]

STAGE = "fitting"


@dataclass(frozen=True, eq=False)
class SplatFit:
    """What a fit by splatting found.

    Attributes
    ----------
    control_points : (E, 4, 3) mm, the curves of the struts that were fitted.
    thickness : (E, K) mm, the effective radius of the strut at each kernel; NaN beyond the kernels of a strut
        that has fewer than K.
    opacity : (E, K) 0..1, NaN likewise.
    field : the deformation field.
    loss_history : the total loss of each iteration.
    """

    control_points: Floats
    thickness: Floats
    opacity: Floats
    field: DeformationField
    loss_history: list[float]


def fit_splats(
    frame: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    settings: FitSettings,
    callback: ProgressCallback | None = None,
    *,
    bounds: ArrayLike | None = None,
) -> SplatFit:
    """Find the deformation of a frame from its silhouettes.

    Parameters
    ----------
    frame : the plan of what has been printed (see `Wireframe.printed_part`).
    cameras : one for each picture, without distortion.
    masks : (H, W) pictures, 1 where a strut is seen and 0 elsewhere, undistorted; sizes may differ.
    settings : see `FitSettings`; the same settings on the same machine give the same bits.
    callback : told of every iteration with the loss and the curves; it can stop the fit.
    bounds : (2, 3) mm, bounding box of the whole plan, so that the field's domain holds the unprinted struts
        too; that of ``frame`` by default.

    Raises
    ------
    InputError
        If pictures and cameras do not belong together, or the learning rate is so high that the fit diverges.
    Cancelled
        If the callback stops the fit.
    """
    cameras, targets = _prepare_views(cameras, masks, settings.image_scale)
    box = enlarged_box(frame.bounds if bounds is None else bounds, settings.domain_margin)
    with _deterministic():
        return _Fit(frame, box, cameras, targets, settings).run(callback)


class _Fit:
    """Everything that one fit holds on to."""

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
        self.target = torch.cat([t.flatten() for t in targets])
        alpha = settings.opacity_start
        width = effective_radius(1.0, alpha, spread=settings.spread)  # of kernels with tau = 1
        tau = frame.radius[self.layout.strut_of_kernel] / float(width)
        self.log_thickness = torch.tensor(np.log(tau), dtype=torch.float32).requires_grad_()
        self.logit_opacity = torch.full((self.layout.size,), float(np.log(alpha / (1.0 - alpha)))).requires_grad_()
        self.bending = BendingLoss(
            box,
            frame.control_points,
            power=settings.bending_power,
            samples=settings.bending_samples,
            seed=settings.seed,
        )

    def run(self, callback: ProgressCallback | None) -> SplatFit:
        """Iterate and collect the result."""
        settings = self.settings
        optimiser = torch.optim.Adam(self._groups(), betas=(0.9, 0.999), eps=1e-15)
        history: list[float] = []
        for iteration in range(settings.iterations):
            optimiser.param_groups[0]["lr"] = _rate(settings, iteration)
            optimiser.zero_grad()
            curves = self._curves()
            if not bool(torch.isfinite(curves).all()):  # such kernels would count as out of sight
                problem = f"the fit has diverged after {iteration} steps"
                raise InputError.at("settings", "learning_rate", problem, "give a lower rate")
            loss = self._loss(curves)
            loss.backward()
            optimiser.step()
            history.append(loss.item())
            report(callback, Progress(STAGE, iteration + 1, settings.iterations, history[-1], _array(curves)))
        with torch.no_grad():
            return self._result(history)

    def _groups(self) -> list[dict]:
        settings = self.settings
        groups = [{"params": list(self.field.parameters()), "lr": settings.learning_rate}]
        if settings.learn_thickness:
            groups.append({"params": [self.log_thickness], "lr": settings.thickness_rate})
        if settings.learn_opacity:
            groups.append({"params": [self.logit_opacity], "lr": settings.opacity_rate})
        return groups

    def _curves(self) -> Tensor:
        return self.plan + self.field.control_displacements(self.sampling).double()

    def _loss(self, curves: Tensor) -> Tensor:
        """Total loss (paper, Eq. 13)."""
        settings = self.settings
        kernels = anchored_kernels(curves.float(), self.layout, spread=settings.spread)
        projected = project_anchored(kernels, self.log_thickness.exp(), self.views)
        opacity = torch.sigmoid(self.logit_opacity)
        means, conics, opacity = low_pass(projected, opacity, variance=settings.pixel_variance)
        loss = image_loss([splat_flat(means, conics, opacity, self.views.sizes)], [self.target])
        if settings.bending_weight > 0.0:
            # From mm to units of the scale: gamma has the power p, the volume 3, the Laplacian squared -2.
            unit = self.scale ** -(settings.bending_power + 1.0)
            bend = self.bending(self.field.laplacian_of, self.field.dtype)
            loss = loss + settings.bending_weight * unit * bend
        return loss

    def _result(self, history: list[float]) -> SplatFit:
        curves = _array(self._curves())
        opacity = _array(torch.sigmoid(self.logit_opacity))
        tau = _array(self.log_thickness.exp())
        radius = effective_radius(tau, opacity, spread=self.settings.spread)
        return SplatFit(
            control_points=curves,
            thickness=self._by_strut(radius),
            opacity=self._by_strut(opacity),
            field=self.field.frozen(),
            loss_history=history,
        )

    def _by_strut(self, values: Floats) -> Floats:
        """(E, K) table of values (N,) of the kernels."""
        counts = self.layout.counts
        table = np.full((len(counts), int(counts.max())), np.nan)
        table[np.arange(table.shape[1]) < counts[:, None]] = values
        return table


def _start_field(box: Floats, scale: float, sampling: CurveSampling, settings: FitSettings) -> TorchField:
    """A field without displacement of the wanted kind."""
    if settings.field == "network":
        return NetworkField(box, seed=settings.seed)
    if settings.field == "lattice":
        lattice = LatticeField.zeros(box, [even_cells(box, cells) for cells in settings.lattice_cells])
        return TrainableLattice(lattice, scale)
    if settings.field == "nodes":
        return NodesField.spread_over(sampling.points, settings.node_count, scale, settings.node_neighbours)
    return FreeField.on_curves(sampling, scale)


def _layout(frame: Wireframe, cameras: Sequence[Camera], settings: FitSettings) -> KernelLayout:
    most = settings.kernels_per_strut
    if not settings.adaptive_kernels:
        return KernelLayout.even(frame.strut_count, most)
    return KernelLayout(
        adaptive_counts(frame.control_points, frame.radius, cameras, minimum=min(4, most), maximum=most)
    )


def _prepare_views(
    cameras: Sequence[Camera], masks: Sequence[np.ndarray], scale: float
) -> tuple[list[Camera], list[Tensor]]:
    """Cameras and masks at the size that is used; masks are averaged over the pixels they lose."""
    import cv2

    if not cameras or len(cameras) != len(masks):
        problem = f"there are {len(masks)} pictures for {len(cameras)} cameras"
        raise InputError.at("capture", "views", problem, "give one picture for each camera, and at least one")
    used, targets = [], []
    for camera, mask in zip(cameras, masks, strict=True):
        if camera.has_distortion:
            raise InputError.at(camera.name, "distortion", "is not zero", "undistort the picture and its camera first")
        if np.shape(mask) != (camera.height, camera.width):
            problem = f"the picture is {np.shape(mask)} where the camera has {(camera.height, camera.width)}"
            raise InputError.at(camera.name, "size", problem, "give the picture that belongs to the camera")
        picture: np.ndarray = np.ascontiguousarray(mask, dtype=np.float32)
        if scale < 1.0:
            width, height = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
            picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
            camera = camera.resized(width, height)
        used.append(camera)
        targets.append(torch.from_numpy(picture.copy()))
    return used, targets


def _rate(settings: FitSettings, iteration: int) -> float:
    """The field's learning rate, which falls from the first to the last step."""
    first, last = settings.learning_rate, settings.learning_rate_end
    share = iteration / max(settings.iterations - 1, 1)
    if settings.decay == "cosine":
        return last + 0.5 * (first - last) * (1.0 + math.cos(math.pi * share))
    return first * (last / first) ** share


def _array(values: Tensor) -> Floats:
    return values.detach().numpy().astype(np.float64)


@contextlib.contextmanager
def _deterministic() -> Iterator[None]:
    """Insist on operations that give the same bits each time, and put the caller's choice back."""
    before = torch.are_deterministic_algorithms_enabled()
    warn_only = torch.is_deterministic_algorithms_warn_only_enabled()
    memory: Any = torch.utils.deterministic
    fill = memory.fill_uninitialized_memory
    torch.use_deterministic_algorithms(True)
    memory.fill_uninitialized_memory = False  # nothing here reads memory it has not written
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(before, warn_only=warn_only)
        memory.fill_uninitialized_memory = fill
