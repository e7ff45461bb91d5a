"""The readable reference of blurred rods: depth-sorted front-to-back alpha blending in plain torch.

Slow, differentiable by autograd, in any floating type. The compiled loops of `frametwin.raster.rod_kernels` must
agree with it: the same coverage of a piece and of a joint's disc, the same lines between neighbouring pieces. Here
every kernel is drawn on the whole picture and they are blended one after another, nearest first, as any splatter
does; that the order changes nothing is the reader's to try.

References
----------
FrameTwin paper, sections V.A and V.D.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, sqrt

import torch
from torch import Tensor

from frametwin.raster.reference import pixel_centres
from frametwin.raster.rod_kernels import OPAQUE, REACH

MIN_DEPTH = 1e-6
"""A strut with a point nearer than this, or behind the camera, is not drawn."""


@dataclass(frozen=True, eq=False)
class ReferenceView:
    """One camera and its picture.

    Attributes
    ----------
    camera : (16,) a row of `frametwin.cameras.packed`.
    size : height and width.
    spread : s of the rods in pixels.
    """

    camera: Tensor
    size: tuple[int, int]
    spread: float

    def project(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Pixels (..., 2) and depth (...) of world points (..., 3)."""
        local = points @ self.camera[:9].view(3, 3).T + self.camera[9:12]
        return local[..., :2] / local[..., 2:] * self.camera[12:14] + self.camera[14:16], local[..., 2]


def coverage(distance: Tensor, radius: Tensor, spread: float) -> Tensor:
    """Share of a pixel at a distance from the centreline that a blurred rod covers.

    It is 0 where the pixel is more than `REACH` spreads outside of the rod's edge, and flat where it is as far inside.
    """
    upper, lower = (radius - distance) / spread, (-radius - distance) / spread
    value = torch.special.ndtr(upper) - torch.special.ndtr(lower)
    value = torch.where(distance <= radius + REACH * spread, value, torch.zeros_like(value))
    flat = torch.full_like(value, 0.5 * (1.0 + erf(REACH / sqrt(2.0))))
    return torch.where(distance < radius - REACH * spread, flat, value)


def half_width(a: Tensor, b: Tensor, view: ReferenceView) -> Tensor:
    """Apparent half width in pixels, per mm of radius, of a round rod about a..b (3,) in world coordinates.

    The outline is where the pixels' rays touch the cylinder: at |ray . n| = radius / depth, with n the unit normal of
    the plane through the camera and the axis.
    """
    rotation, shift = view.camera[:9].view(3, 3), view.camera[9:12]
    a, b = rotation @ a + shift, rotation @ b + shift
    normal = torch.linalg.cross(a, b - a)
    steepness = torch.linalg.vector_norm(normal[:2] / view.camera[12:14])  # of |ray . normal|, by the pixel
    return torch.linalg.vector_norm(normal) / steepness * 2.0 / (a[2] + b[2])


def dividing_lines(line: Tensor) -> Tensor:
    """(P+1, 2) directions across which neighbouring pieces of a projected polyline (P+1, 2) take turns.

    A pixel x lies ahead of point p when (x - line[p]) . direction[p] >= 0.
    """
    step = line.diff(dim=0)
    step = step / torch.linalg.vector_norm(step, dim=1, keepdim=True).clamp(min=1e-9)
    nothing = torch.zeros_like(step[:1])
    return torch.cat([nothing, step]) + torch.cat([step, nothing])


def piece_coverages(points: Tensor, radius: Tensor, view: ReferenceView) -> tuple[Tensor, Tensor]:
    """What every piece of one strut covers: on the outer side of a turn as far as the dividing line, but no further
    than its half width.

    Parameters
    ----------
    points : (P+1, 3) of the polyline.
    radius : (P,) mm.
    view : the camera.

    Returns
    -------
    (P, H, W) coverage, zeros for a strut that reaches behind the camera, and (P,) depth of the pieces' middles.
    """
    line, depth = view.project(points)
    middle = 0.5 * (depth[:-1] + depth[1:])
    if bool((depth < MIN_DEPTH).any()):
        return points.new_zeros((len(radius), *view.size)), middle
    pixels = pixel_centres(*view.size, dtype=points.dtype)
    lines = dividing_lines(line)
    ahead = ((pixels[None] - line[:, None, None]) * lines[:, None, None]).sum(-1) >= 0.0  # (P+1, H, W)
    covers = []
    for p in range(len(radius)):
        step = line[p + 1] - line[p]
        length = torch.linalg.vector_norm(step)
        if bool(length < 1e-9):
            covers.append(points.new_zeros(view.size))
            continue
        away = pixels - line[p]
        half = half_width(points[p], points[p + 1], view) * radius[p]
        distance = (step[0] * away[..., 1] - step[1] * away[..., 0]).abs() / length
        along = (away * step).sum(-1) / length
        own = ahead[p] & ~ahead[p + 1] & (along >= -half) & (along <= length + half)
        value = coverage(distance, half, view.spread)
        covers.append(torch.where(own, value, torch.zeros_like(value)))
    return torch.stack(covers), middle


def joint_coverage(joint: Tensor, radius: Tensor, view: ReferenceView) -> tuple[Tensor, Tensor]:
    """(H, W) coverage of a joint's disc and its depth; zeros for a joint without radius or behind the camera."""
    centre, depth = view.project(joint)
    if bool(depth < MIN_DEPTH) or bool(radius <= 0.0):
        return joint.new_zeros(view.size), depth
    away = pixel_centres(*view.size, dtype=joint.dtype) - centre
    apparent = view.camera[12:14].mean() * radius / depth
    return coverage(torch.linalg.vector_norm(away, dim=-1), apparent, view.spread), depth


def joint_radius(edges: Tensor, radius: Tensor, opacity: Tensor, joints: int) -> Tensor:
    """(V,) largest radius of the end pieces (E, P) at each joint that are rather there than not; 0 without any."""
    ends = torch.where(opacity[:, [0, -1]] > 0.5, radius[:, [0, -1]], torch.zeros_like(radius[:, [0, -1]]))
    return radius.new_zeros(joints).scatter_reduce(0, edges.reshape(-1), ends.reshape(-1), "amax")


def blend(alphas: Tensor, depth: Tensor) -> Tensor:
    """Front-to-back alpha blend of kernels of grey value 1.

    Parameters
    ----------
    alphas : (N, H, W) what each kernel covers, times its opacity.
    depth : (N,); only the order counts, and with one grey value not even that.

    Returns
    -------
    (H, W) grey values: sum_i a_i prod_{j<i} (1 - a_j).
    """
    picture = alphas.new_zeros(alphas.shape[1:])
    passed = torch.ones_like(picture)
    for i in torch.argsort(depth, stable=True).tolist():
        a = alphas[i].clamp(max=OPAQUE)
        picture = picture + passed * a
        passed = passed * (1.0 - a)
    return picture


def kernels(
    points: Tensor, joints: Tensor, edges: Tensor, radius: Tensor, opacity: Tensor, view: ReferenceView
) -> tuple[Tensor, Tensor]:
    """Alpha (N, H, W) and depth (N,) of all pieces, strut by strut, and then of the joints' discs.

    Parameters
    ----------
    points : (E, P+1, 3) mm, of the struts' polylines.
    joints : (V, 3) mm.
    edges : (E, 2) joints of each strut.
    radius : (E, P) mm.
    opacity : (E, P) 0..1.
    view : the camera.
    """
    alphas, depths = [], []
    for k in range(len(points)):
        covers, depth = piece_coverages(points[k], radius[k], view)
        alphas.append(opacity[k, :, None, None] * covers)
        depths.append(depth)
    for joint, size in zip(joints, joint_radius(edges, radius, opacity, len(joints)), strict=True):
        cover, nearness = joint_coverage(joint, size, view)
        alphas.append(cover[None])
        depths.append(nearness[None])
    return torch.cat(alphas), torch.cat(depths)


def picture(
    points: Tensor, joints: Tensor, edges: Tensor, radius: Tensor, opacity: Tensor, view: ReferenceView
) -> Tensor:
    """(H, W) picture of struts and joints, grey value 1; see `kernels` and `blend`."""
    return blend(*kernels(points, joints, edges, radius, opacity, view))
