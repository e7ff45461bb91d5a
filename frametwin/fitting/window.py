"""The part of every picture in which a few struts are, with the rest of the frame as it was drawn last."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from frametwin.fitting.camera_freedoms import with_cameras
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods, sharp_transmittance

BLURS = 4.0
"""Spreads of an edge that are kept around everything."""


@dataclass(frozen=True, eq=False)
class Window:
    """What is seen of a few struts in each picture of a level.

    Attributes
    ----------
    points : (N, 3) array, mm
        Within whose hull the struts are.
    margin : float, mm
        Kept around it.
    rest : Rods
        All that stays as it is.
    cameras : (N, 10) array or None
        Freedoms of the cameras, where these stay; ``None`` where the rig is taken as exact.
    """

    points: np.ndarray
    margin: float
    rest: Rods
    cameras: np.ndarray | None = None
    _made: list[tuple[Level, Level]] = field(init=False, repr=False, default_factory=list)

    def part_of(self, level: Level, scales: np.ndarray) -> Level:
        """The part of a level with so many pixels (N,) to one of the full pictures; made once."""
        for whole, part in self._made:
            if whole is level:
                return part
        seen = level if self.cameras is None else with_cameras(level, self.cameras, scales)
        boxes = self._boxes(seen)
        pictures = [
            picture[top:bottom, left:right]
            for picture, (left, top, right, bottom) in zip(level.pictures(level.target), boxes.tolist(), strict=True)
        ]
        cameras = seen.cameras.copy()
        cameras[:, 14:16] -= boxes[:, :2]
        shapes = np.array([picture.shape for picture in pictures], dtype=np.int64)
        part = replace(
            level,
            cameras=cameras,
            shapes=shapes,
            offsets=np.concatenate([[0], np.cumsum(shapes.prod(axis=1))[:-1]]),
            target=np.concatenate([picture.ravel() for picture in pictures]),
        )
        part = replace(part, behind=sharp_transmittance(self._rest_in(part), part))
        self._made.append((level, part))
        return part

    def _rest_in(self, part: Level) -> Rods:
        """Of the rest the struts that may be seen in some picture of the part."""
        rest = self.rest
        most = part.shapes[:, None, ::-1]
        thickest = max(float(rest.radius.max(initial=0.0)), float(rest.joint_radius().max(initial=0.0)))
        low, high = _hulls(part, rest.control_points, thickest)
        seen = ((high > 0.0) & (low < most)).all(axis=2).any(axis=0)
        return replace(
            rest,
            control_points=rest.control_points[seen],
            edges=rest.edges[seen],
            radius=rest.radius[seen],
            opacity=rest.opacity[seen],
        )

    def _boxes(self, level: Level) -> np.ndarray:
        """(N, 4) first column and row, and those after the last, of each picture."""
        low, high = (edge[:, 0] for edge in _hulls(level, self.points[None], self.margin))
        most = level.shapes[:, ::-1]
        first = np.clip(np.floor(low), 0, most - 1)
        last = np.clip(np.ceil(high), first + 1, most)
        return np.concatenate([first, last], axis=1).astype(np.int64)


def _hulls(level: Level, points: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, M, 2) lowest and highest column and row of groups of points (M, K, 3), margin (mm) and blur beyond them.

    What is behind a camera is anywhere.
    """
    cameras = level.cameras
    rotations, shifts = cameras[:, :9].reshape(-1, 3, 3), cameras[:, 9:12]
    seen = np.matmul(points, rotations[:, None].transpose(0, 1, 3, 2)) + shifts[:, None, None]  # (N, M, K, 3)
    depth = seen[..., 2]
    at = cameras[:, None, None, 12:14] * seen[..., :2] / np.maximum(depth, 1e-6)[..., None]
    at += cameras[:, None, None, 14:16]
    more = margin * cameras[:, 12:14].max(axis=1)[:, None] / np.maximum(depth.min(axis=2), 1e-6)
    more += BLURS * level.spreads[:, None]
    more = np.where(depth.min(axis=2) < 1e-6, np.inf, more)[..., None]
    return at.min(axis=2) - more, at.max(axis=2) + more
