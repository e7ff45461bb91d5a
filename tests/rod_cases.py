"""Small scenes of struts for tests of the rod splatter and of what is fitted with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from frametwin.cameras import Camera, look_at
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rod_reference, rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods

SIZES = ((40, 56), (33, 21), (18, 70))  # views may differ
FAR_JOINTS = np.full((2, 3), 1e12)
"""So far away that their discs cover nothing: for struts whose ends shall stay flat."""


def camera_at(
    centre: Sequence[float],
    size: tuple[int, int],
    focal: float,
    target: Sequence[float] = (0.0, 0.0, 0.0),
    stretch: float = 1.0,
) -> Camera:
    """A camera that looks at the target; its pixels are ``stretch`` times as high as wide."""
    height, width = size
    pose = look_at(centre, target)
    return Camera("view", width, height, focal, focal / stretch, width / 2.0 + 0.3, height / 2.0 - 0.2, pose)


def views(sizes: Sequence[tuple[int, int]] = SIZES) -> list[Camera]:
    """Cameras around the origin, 60 mm away: one with oblong pixels, and none in a symmetric place."""
    centres = ([60.0, 5.0, 20.0], [-25.0, 52.0, 9.0], [11.0, -40.0, 45.0])
    return [
        camera_at(centre, size, focal, stretch=stretch)
        for centre, size, focal, stretch in zip(centres, sizes, (90.0, 60.0, 75.0), (1.0, 1.0, 1.3), strict=True)
    ]


def level_of(cameras: Sequence[Camera], blur: float = 0.6, masks: Sequence[np.ndarray] | None = None) -> Level:
    """The cameras' pictures at full size, black where no masks are given."""
    if masks is None:
        masks = [np.zeros((camera.height, camera.width), dtype=np.float32) for camera in cameras]
    return Pyramid(cameras, masks).level(1.0, blur)


def random_scene(seed: int, struts: int = 6, pieces: int = 5) -> Rods:
    """Curved struts of uneven radius and opacity that share joints; the last leads past the cameras."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-16.0, 16.0, (struts, 3))
    joints[-1] = [150.0, 130.0, 80.0]  # behind the first camera, far outside of the pictures of others
    pairs = [(i, (i + 1) % (struts - 1)) for i in range(struts - 1)] + [(0, struts - 1)]
    edges = np.array(pairs)
    curves = bezier.straight(joints[edges[:, 0]], joints[edges[:, 1]])
    curves[:, 1:3] += rng.normal(scale=2.0, size=(struts, 2, 3))
    opacity = rng.uniform(0.2, 0.95, (struts, pieces))
    opacity[1, 1:3] = 0.0  # missing
    return Rods(curves, joints, edges, rng.uniform(0.5, 1.6, (struts, pieces)), opacity)


def lone_rod(start: Sequence[float], end: Sequence[float], radius: float, pieces: int = 1, joints: bool = True) -> Rods:
    """One straight strut, fully there, with or without the discs of its joints."""
    ends = np.array([start, end], dtype=np.float64)
    return Rods(
        control_points=bezier.straight(ends[:1], ends[1:]),
        joints=ends if joints else FAR_JOINTS,
        edges=np.array([[0, 1]]),
        radius=np.full((1, pieces), radius),
        opacity=np.ones((1, pieces)),
    )


def of_frame(frame: Wireframe, pieces: int) -> Rods:
    """All struts of a frame, fully there."""
    return Rods(
        control_points=np.array(frame.control_points),
        joints=np.array(frame.vertices),
        edges=frame.edges,
        radius=np.repeat(frame.radius[:, None], pieces, axis=1),
        opacity=np.ones((frame.strut_count, pieces)),
    )


def shifted(drawn: Rods, shift: np.ndarray) -> Rods:
    """The scene with its control points moved by ``shift`` (E, 4, 3)."""
    return replace(drawn, control_points=drawn.control_points + shift)


def leaves_of(drawn: Rods) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Control points, joints, radius and opacity in float64, each to be differentiated by."""
    arrays = (drawn.control_points, drawn.joints, drawn.radius, drawn.opacity)
    return tuple(torch.from_numpy(np.array(x)).requires_grad_() for x in arrays)


def reference_kernels(leaves: Sequence[Tensor], edges: np.ndarray, level: Level) -> list[tuple[Tensor, Tensor]]:
    """Alpha and depth of all kernels of each view, by the torch reference."""
    curves, joints, radius, opacity = leaves
    points = torch.from_numpy(rods.basis(radius.shape[1])) @ curves
    return [
        rod_reference.kernels(
            points,
            joints,
            torch.from_numpy(edges),
            radius,
            opacity,
            rod_reference.ReferenceView(torch.from_numpy(camera), (int(shape[0]), int(shape[1])), level.spread),
        )
        for camera, shape in zip(level.cameras, level.shapes, strict=True)
    ]


def squared_loss(drawn: Rods, level: Level) -> float:
    """Half the sum of squared residuals over all views."""
    residual = np.float32(1.0) - rods.transmittance(drawn, level) - level.target
    return 0.5 * float(np.dot(residual, residual))


def weighted_sum(pictures: Sequence[Tensor], seed: int) -> Tensor:
    """A loss with a different gradient at every pixel."""
    rng = np.random.default_rng(seed)
    return torch.stack([(p.double() * torch.from_numpy(rng.normal(size=p.shape))).sum() for p in pictures]).sum()
