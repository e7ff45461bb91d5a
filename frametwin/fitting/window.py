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
        part = replace(part, behind=sharp_transmittance(self.rest, part))
        self._made.append((level, part))
        return part

    def _boxes(self, level: Level) -> np.ndarray:
        """(N, 4) first column and row, and those after the last, of each picture."""
        cameras, (height, width) = level.cameras, level.shapes.T
        seen = np.einsum("vab,nb->vna", cameras[:, :9].reshape(-1, 3, 3), self.points) + cameras[:, None, 9:12]
        depth = np.maximum(seen[..., 2:], 1e-6)
        at = cameras[:, None, 12:14] * seen[..., :2] / depth + cameras[:, None, 14:16]
        more = self.margin * cameras[:, 12:14].max(axis=1) / depth.min(axis=(1, 2)) + BLURS * level.spreads
        low, high = at.min(axis=1) - more[:, None], at.max(axis=1) + more[:, None]
        most = np.stack([width, height], axis=1)
        first = np.clip(np.floor(low), 0, most - 1)
        last = np.clip(np.ceil(high), first + 1, most)
        behind = (seen[..., 2] < 1e-6).any(axis=1)[:, None]  # of a camera: one sees them anywhere
        return np.concatenate([np.where(behind, 0, first), np.where(behind, most, last)], axis=1).astype(np.int64)
