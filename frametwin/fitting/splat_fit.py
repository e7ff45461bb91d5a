"""The paper's fit: a deformation field learnt through splatted, curve-anchored Gaussians.

Each iteration moves the samples of the plan by the field, refits the control points, anchors kernels to the
curves, splats them into every view, compares with the masks and takes one step of Adam on the field, the
thickness and the opacity of each kernel (paper, sections III.A and V).

What the paper leaves open is decided as follows.

- The field works in coordinates that map the longest side of the computational domain to -1..1, evenly along
  all axes, and its output is in the same unit. The bending integral is taken in these coordinates too, so its
  weight means the same for frames of all sizes.
- Encoding, rates, first weights and image loss are read as in the code that the paper's network (Deformable 3D
  Gaussians) and loss (3D Gaussian splatting) resemble; `frametwin.fitting.settings.PAPER_LETTER` has the text's.
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

import cv2
import numpy as np
import torch
from torch import Tensor

from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.fields.base import DeformationField, enlarged_box
from frametwin.fitting.confidence import confidence
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.free_kernels import FreeKernelModel
from frametwin.fitting.known_start import KnownStart
from frametwin.fitting.part_fit import PartFit
from frametwin.fitting.settings import FitSettings
from frametwin.fitting.splat_model import SplatModel, to_array
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.rods import Rods, gauss_newton

STAGE = "fitting"

JUDGED_SCALE, JUDGED_BLUR = 0.5, 0.7
"""Size, as a share, and blur in pixels of the pictures by which the confidence in the result is judged."""


JOINED = 1e-6
"""An end that is nearer to its joint than so many mm is at it."""


@dataclass(frozen=True)
class SplatFitter:
    """The paper's fit with its settings; a `Fitter`. It starts at the plan.

    The same settings on the same machine give the same bits.
    """

    settings: FitSettings

    def fit(
        self,
        printed: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        start: DeformationField | KnownStart | None = None,
        callback: ProgressCallback | None = None,
    ) -> PartFit:
        """See `frametwin.fitting.part_fit.Fitter.fit`.

        Raises
        ------
        InputError
            Also if there is a field to start from, or the learning rate is so high that the fit diverges.
        """
        settings = self.settings
        if start is not None:
            problem = f"the preset {settings.preset} starts at the plan"
            raise InputError.at("settings", "warm start", problem, "use the preset fast")
        used, targets = _resized(cameras, masks, settings.image_scale)
        with _deterministic():
            kind = FreeKernelModel if settings.kernels == "free" else SplatModel
            model = kind(printed, enlarged_box(printed.bounds, settings.domain_margin), used, targets, settings)
            loss = _descend(model, settings, callback)
            curves, thickness, opacity = to_array(model.curves()), model.thickness(), model.opacity()
        vertices = _joints(printed, curves)
        attached, gap = _loose_ends(printed, curves, vertices)
        planned = np.repeat(printed.radius[:, None], thickness.shape[1], axis=1)
        rods = Rods(curves, vertices, printed.edges, planned, np.ones_like(planned))
        terms = gauss_newton(rods, Pyramid(cameras, masks).level(JUDGED_SCALE, JUDGED_BLUR))
        return PartFit(
            control_points=curves,
            vertices=vertices,
            thickness=thickness,
            opacity=opacity,
            confidence=confidence(ElasticFrame(printed), terms),
            field=model.field.frozen(),
            loss=loss,
            timing={},
            cloud=model.cloud(),
            attached=attached,
            gap=gap,
        )


def _loose_ends(
    printed: Wireframe, curves: np.ndarray, vertices: np.ndarray
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """(E, 2) which ends are at their joints, and how far off in mm the others are; nothing where none can be."""
    gap = np.linalg.norm(curves[:, [0, 3]] - vertices[printed.edges], axis=2)
    joined = gap <= JOINED
    return (None, None) if joined.all() else (joined, np.where(joined, 0.0, gap))


def _joints(printed: Wireframe, curves: np.ndarray) -> np.ndarray:
    """(V, 3) mm: where the ends of struts meet, or the middle between them where each has an end of its own."""
    vertices = np.array(printed.vertices)
    where, ends = printed.edges.ravel(), curves[:, [0, 3]].reshape(-1, 3)
    vertices[where] = ends
    away = np.zeros_like(vertices)
    np.add.at(away, where, ends - vertices[where])  # exactly zero where they meet
    return vertices + away / np.maximum(np.bincount(where, minlength=len(vertices)), 1)[:, None]


def _descend(model: SplatModel, settings: FitSettings, callback: ProgressCallback | None) -> list[float]:
    """Adam's steps; the loss at each."""
    optimiser = torch.optim.Adam(model.groups(), betas=(0.9, 0.999), eps=1e-15)
    history: list[float] = []
    for iteration in range(settings.iterations):
        optimiser.param_groups[0]["lr"] = _rate(settings, iteration)
        optimiser.zero_grad()
        curves = model.curves()
        if not bool(torch.isfinite(curves).all()):  # such kernels would count as out of sight
            problem = f"the fit has diverged after {iteration} steps"
            raise InputError.at("settings", "learning_rate", problem, "give a lower rate")
        loss = model.loss(curves)
        loss.backward()
        optimiser.step()
        history.append(loss.item())
        report(callback, Progress(STAGE, iteration + 1, settings.iterations, history[-1], to_array(curves)))
    return history


def _resized(cameras: Sequence[Camera], masks: Sequence[np.ndarray], scale: float) -> tuple[list[Camera], list[Tensor]]:
    """Cameras and masks at a share of their size; masks are averaged over the pixels they lose."""
    used, targets = [], []
    for camera, mask in zip(cameras, masks, strict=True):
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
    first, last = (settings.learning_rate_scale * rate for rate in (settings.learning_rate, settings.learning_rate_end))
    share = iteration / max(settings.iterations - 1, 1)
    if settings.decay == "cosine":
        return last + 0.5 * (first - last) * (1.0 + math.cos(math.pi * share))
    return first * (last / first) ** share


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
