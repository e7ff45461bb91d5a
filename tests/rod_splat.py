"""The compiled splatter of blurred rods as a differentiable torch function, to be held against a reference.

What a fit leaves out is added here, so that the gradients are whole: the discs of joints grow with the radius of the
struts, and as they come nearer.
"""

from __future__ import annotations

from math import ceil, erf, exp, floor, pi, sqrt
from typing import Any

import numba as nb
import numpy as np
import torch
from torch import Tensor

from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rod_kernels import HIDDEN, OPAQUE, REACH
from frametwin.raster.rods import Rods

MIN_DEPTH = 1e-6
"""Joints nearer to a camera than this, or behind it, are not drawn, mm."""


@nb.njit(parallel=True, cache=True)
def _disc_slopes(joints, joint_radius, cameras, shapes, offsets, spread, limits, through, slope, by_radius, by_place):
    """Derivatives of a loss by the discs' radius (V,), and by the joints (V, 3) as far as depth sets the size.

    ``slope`` (pixels,) is the loss's derivative by the picture, ``limits`` are REACH, OPAQUE and HIDDEN.
    `rod_kernels.gather_joints` has the motion of the discs; that their size follows the depth and the struts is left
    out there, as it hardly tells a joint's place.
    """
    most, opaque, hidden = limits
    for k in nb.prange(joints.shape[0]):
        by_radius[k] = 0.0
        for e in range(3):
            by_place[k, e] = 0.0
        if joint_radius[k] <= 0.0:
            continue
        place = np.empty(3)
        for v in range(cameras.shape[0]):
            camera = cameras[v]
            height, width, start = shapes[v, 0], shapes[v, 1], offsets[v]
            for e in range(3):
                place[e] = camera[9 + e]
                for f in range(3):
                    place[e] += camera[3 * e + f] * joints[k, f]
            if place[2] < MIN_DEPTH:
                continue
            x = camera[12] * place[0] / place[2] + camera[14]
            y = camera[13] * place[1] / place[2] + camera[15]
            unit = 0.5 * (camera[12] + camera[13]) / place[2]
            r = unit * joint_radius[k]
            core, reach = r - most * spread, r + most * spread
            total = 0.0
            for j in range(max(0, int(floor(y - reach - 0.5))), min(height - 1, int(ceil(y + reach - 0.5))) + 1):
                at = start + j * width
                for i in range(max(0, int(floor(x - reach - 0.5))), min(width - 1, int(ceil(x + reach - 0.5))) + 1):
                    d = sqrt((i + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2)
                    if d < core or d > reach:
                        continue
                    za, zb = (r - d) / spread, (r + d) / spread
                    c = 0.5 * (erf(za / sqrt(2.0)) + erf(zb / sqrt(2.0)))
                    others = min(through[at + i] / (1.0 - min(c, opaque)), 1.0)
                    if others >= hidden:
                        total += slope[at + i] * others * (exp(-0.5 * za * za) + exp(-0.5 * zb * zb))
            total *= unit / (spread * sqrt(2.0 * pi))
            by_radius[k] += total
            for e in range(3):
                by_place[k, e] -= total * joint_radius[k] / place[2] * camera[6 + e]


def _disc_gradients(drawn: Rods, level: Level, through: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, ...]:
    """(E, P) by the struts' radius, which the discs share, and (V, 3) by the joints' depth."""
    joints, size = np.ascontiguousarray(drawn.joints, dtype=np.float64), drawn.joint_radius()
    by_radius, by_place = np.empty(len(joints)), np.empty((len(joints), 3))
    view = (level.cameras, level.shapes, level.offsets, level.spread)
    _disc_slopes(joints, size, *view, (REACH, OPAQUE, HIDDEN), through, slope, by_radius, by_place)
    widest = np.where(drawn.opacity > 0.5, drawn.radius, 0.0)
    by_piece = np.zeros(drawn.radius.shape)
    sharing = np.zeros(len(joints))  # struts of equal radius share the disc's derivative
    ends = [(drawn.edges[:, side], -side) for side in (0, 1)]
    for joint, piece in ends:
        np.add.at(sharing, joint, widest[:, piece] == size[joint])
    for joint, piece in ends:
        share = by_radius[joint] / np.maximum(sharing[joint], 1.0)
        by_piece[:, piece] += np.where(widest[:, piece] == size[joint], share, 0.0)
    return by_piece, by_place


class _Splat(torch.autograd.Function):
    """All views at once, in one flat buffer."""

    @staticmethod
    def forward(
        ctx: Any,
        control_points: Tensor,
        joints: Tensor,
        radius: Tensor,
        opacity: Tensor,
        edges: np.ndarray,
        level: Level,
    ) -> Tensor:
        arrays = [x.detach().numpy().astype(np.float64) for x in (control_points, joints, radius, opacity)]
        drawn = Rods(arrays[0], arrays[1], edges, arrays[2], arrays[3])
        ctx.drawn, ctx.level, ctx.through = drawn, level, rods.transmittance(drawn, level)
        ctx.types = [x.dtype for x in (control_points, joints, radius, opacity)]
        return torch.from_numpy(np.float32(1.0) - ctx.through)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        drawn, level, through = ctx.drawn, ctx.level, ctx.through
        slope = np.ascontiguousarray(grad.numpy(), dtype=np.float32)
        _, struts, _, joints, widths, _ = rods.pull_back(drawn, level, through, slope)
        disc_radius, disc_depth = _disc_gradients(drawn, level, through, slope)
        results = (
            struts.reshape(-1, 4, 3),
            joints + disc_depth,
            widths[..., 1] + disc_radius,
            rods.opacity_terms(drawn, level, through, slope)[..., 1],
        )
        grads = [torch.from_numpy(g).to(kind) for g, kind in zip(results, ctx.types, strict=True)]
        return (*grads, None, None)


def splat_rods(
    control_points: Tensor, joints: Tensor, edges: np.ndarray, radius: Tensor, opacity: Tensor, level: Level
) -> list[Tensor]:
    """Pictures of blurred rods of grey value 1; see `frametwin.raster.rod_kernels`.

    Parameters
    ----------
    control_points : (E, 4, 3) mm, of the struts' cubic curves.
    joints : (V, 3) mm, where struts meet; each is drawn as one disc, as wide as the widest piece that ends there.
    edges : (E, 2) joints of each strut.
    radius : (E, P) mm, of P pieces of equal parameter length.
    opacity : (E, P) 0..1; a piece above one half widens the discs at its ends.
    level : cameras, sizes and blur of the pictures; its target is not used.

    Returns
    -------
    N float32 pictures (H, W), one a camera. Gradients flow to control points, joints, radius and opacity. They
    leave out that a strut's flat ends move along it: the joints' discs cover the ends.
    """
    flat = _Splat.apply(control_points, joints, radius, opacity, edges, level)
    counts = level.shapes.prod(axis=1).tolist()
    sizes = [(int(height), int(width)) for height, width in level.shapes]
    return [part.view(size) for part, size in zip(flat.split(counts), sizes, strict=True)]
