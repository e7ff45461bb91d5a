"""One moment as the twin's steps see it: reduced pictures, and which of their pixels count."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.levels import Levels
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rods
from frametwin.raster.pyramid import Level, Pyramid
from frametwin.raster.rods import Rods, Terms


class Sight:
    """The pictures of one moment.

    Parameters
    ----------
    frame : Wireframe
        What is printed of the plan.
    cameras : sequence of Camera
        N, without distortion.
    masks : sequence of (H, W) array of float32, 0..1
        Of the cameras' sizes.
    valid : sequence of (H, W) array of bool
        Pixels that count.
    """

    def __init__(
        self,
        frame: Wireframe,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        valid: Sequence[np.ndarray],
    ) -> None:
        self.cameras, self.masks = tuple(cameras), tuple(masks)
        self.valid = tuple(valid)
        self._levels = Levels(frame, Pyramid(cameras, masks))
        self._flat: dict[tuple[float, float], np.ndarray] = {}

    def with_valid(self, valid: Sequence[np.ndarray]) -> Sight:
        """The same pictures, of which other pixels count."""
        other = object.__new__(Sight)
        other.cameras, other.masks, other.valid = self.cameras, self.masks, tuple(valid)
        other._levels, other._flat = self._levels, {}
        return other

    def level(self, stage: Stage) -> Level:
        """The pictures at the size and blur of a stage."""
        return self._levels.at(stage.detail, stage.blur)

    def pixels_per_mm(self, stage: Stage) -> float:
        """Pixels of the stage's pictures to a millimetre of the frame."""
        return self._levels.pixels_per_mm(stage.detail)

    def counted(self, stage: Stage) -> np.ndarray:
        """(pixels,) bool: pixels of the stage's level that count."""
        key = (stage.detail, stage.blur)
        if key not in self._flat:
            parts = []
            for own, (height, width) in zip(self.valid, self.level(stage).shapes.tolist(), strict=True):
                if own.all() or not own.any():
                    parts.append(np.full(height * width, bool(own.flat[0])))
                    continue
                # A reduced pixel counts where all of what it is made of does.
                small = cv2.resize(own.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
                parts.append((small > 1.0 - 1e-3).ravel())
            self._flat[key] = np.concatenate(parts)
        return self._flat[key]

    def compared(self, drawn: Rods, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
        """Transmittance (pixels,) of what is drawn, and residual (pixels,); both 0 where pixels do not count.

        A kernel gathers nothing from pixels through which nothing is seen, so such pixels say nothing at all.
        """
        level, counted = self.level(stage), self.counted(stage)
        through = rods.transmittance(drawn, level)
        residual = np.float32(1.0) - through - level.target
        if not counted.all():
            through = through * counted
            residual *= counted
        return through, residual

    def terms(self, drawn: Rods, stage: Stage) -> Terms:
        """Loss of what is drawn, and its Gauss-Newton terms, from the pixels that count."""
        through, residual = self.compared(drawn, stage)
        loss = 0.5 * float(np.dot(residual, residual))
        return Terms(loss, *rods.pull_back(drawn, self.level(stage), through, residual))
