"""Views that show nothing: a lamp that is off, a lid, a camera that has just been switched on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.levels import Levels
from frametwin.geometry.wireframe import Wireframe
from frametwin.raster import rods
from frametwin.raster.pyramid import Pyramid
from frametwin.raster.rods import Rods

DARK = 0.1
"""Share of the white that the print would have in a picture, below which that shows nothing usable. Struts that fall
remain in view, elsewhere: a print does not vanish."""

MUCH = 0.1
"""Share of what the typical view sees of the print, from which it is missed in a view."""


class DarkViews:
    """Tells pictures without a print, by how much of it each camera would see.

    Parameters
    ----------
    frame : Wireframe
        What is printed of the plan.
    cameras : sequence of Camera
        N, without distortion, of the masks' sizes.
    stage : Stage
        In the detail of which it is drawn.
    """

    def __init__(self, frame: Wireframe, cameras: Sequence[Camera], stage: Stage) -> None:
        empty = [np.zeros((camera.height, camera.width), dtype=np.float32) for camera in cameras]
        self._level = Levels(frame, Pyramid(cameras, empty)).at(stage.detail, stage.blur)

    def find(self, drawn: Rods, masks: Sequence[np.ndarray | None]) -> np.ndarray:
        """(N,) bool: views whose pictures show nothing of what stands.

        Parameters
        ----------
        drawn : Rods
            What stands, where it was last seen.
        masks : sequence of (H, W) array of float32 or None
            None of those that are missing is dark.
        """
        through = self._level.pictures(rods.transmittance(drawn, self._level))
        would_be = np.array([1.0 - float(part.mean()) for part in through])
        white = np.array([np.inf if mask is None else float(mask.mean()) for mask in masks])
        return (would_be > MUCH * float(np.median(would_be))) & (white < DARK * would_be)
