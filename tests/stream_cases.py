"""Simulated streams: a print along a known motion, an arm before it, and the pictures that cameras take."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import box_around, ring_rig
from frametwin.geometry.parametric import half_bowl
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.silhouette import silhouettes

STEP = 0.2
"""Seconds between two moments: 5 Hz."""


def bent(points: np.ndarray, height: float, by: Sequence[float]) -> np.ndarray:
    """Points (..., 3) of a frame so high that leans as a cantilever does: by the square of the height, feet at rest."""
    return points + (points[..., 2:] / height) ** 2 * np.asarray(by)


@dataclass(eq=False)
class MovingPrint:
    """A bowl that leans by known amounts before a ring of cameras."""

    plan: Wireframe = field(default_factory=lambda: half_bowl(8, 2))
    views: int = 6
    size: tuple[int, int] = (600, 800)

    @property
    def cameras(self) -> tuple[Camera, ...]:
        return ring_rig(box_around(self.plan, self.at([12.0, 0.0, 0.0])), self.views, size=self.size)

    def at(self, by: Sequence[float], without: Collection[int] = ()) -> Wireframe:
        """The real print, its rim having gone by so many mm; some struts are not there."""
        height = float(self.plan.vertices[:, 2].max())
        printed = self.plan.printed.copy()
        printed[list(without)] = False
        return self.plan.replace(
            vertices=bent(self.plan.vertices, height, by),
            control_points=bent(self.plan.control_points, height, by),
            printed=printed,
        )

    def pictures(self, by: Sequence[float], without: Collection[int] = ()) -> list[np.ndarray]:
        return silhouettes(self.at(by, without), self.cameras)


def with_arm(picture: np.ndarray, colour: int) -> np.ndarray:
    """The picture with an arm over its left half."""
    height, width = picture.shape
    arm = np.array([[0, 0], [0.5 * width, 0], [0.55 * width, 0.5 * height], [0.45 * width, height], [0, height]])
    return np.asarray(cv2.fillPoly(picture.copy(), [np.round(arm).astype(np.int32)], (float(colour),)))


def drop(folder: Path, moment: str, names: Sequence[str], pictures: Sequence[np.ndarray]) -> None:
    """Pictures of one moment in a folder of its own."""
    (folder / moment).mkdir(parents=True)
    for name, picture in zip(names, pictures, strict=True):
        cv2.imwrite(str(folder / moment / f"{name}.png"), picture)
