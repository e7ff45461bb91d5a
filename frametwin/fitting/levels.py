"""The pictures of a frame at the sizes that the stages of a fit ask for."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.raster.pyramid import KEPT as SMALL
from frametwin.raster.pyramid import Level, Pyramid

KEPT = 20_000_000
"""Most pixels of the large levels that are kept at a time; the last stages ask for two of them by turns."""


class Levels:
    """Pictures by the apparent thickness of the typical strut, each made when it is first asked for.

    Parameters
    ----------
    frame : Wireframe
        The plan of what is printed.
    pyramid : Pyramid
        Its pictures.
    """

    def __init__(self, frame: Wireframe, pyramid: Pyramid) -> None:
        self._frame, self._pyramid = frame, pyramid
        self._density = pyramid.pixels_per_mm(frame.bounds.mean(axis=0))  # at full size
        self._radius = float(np.median(frame.radius))
        self._made: dict[tuple[float, float], Level] = {}

    @property
    def widths(self) -> np.ndarray:
        """(N,) width in pixels of each full picture."""
        return np.array([camera.width for camera in self._pyramid.cameras], dtype=np.float64)

    @property
    def radius(self) -> float:
        """Of the typical strut, in mm."""
        return self._radius

    @property
    def density(self) -> float:
        """How many pixels of the full pictures a millimetre of the frame covers."""
        return self._density

    @property
    def view_count(self) -> int:
        """Number of views."""
        return len(self._pyramid.cameras)

    @property
    def black_and_white(self) -> bool:
        """Whether the full pictures are sharp masks, of pixels of 0 and 1 alone."""
        return self._pyramid.black_and_white

    def scale(self, detail: float) -> float:
        """Of the pictures of `at`, relative to the full ones.

        Some of the views alone may be nearer than all of them are, and ask for more than is kept of the pictures.
        """
        return min(self._pyramid.largest, detail / (self._density * self._radius))

    def of_views(self, chosen: np.ndarray) -> Levels:
        """Those of some of the views alone."""
        return Levels(self._frame, self._pyramid.of_views(chosen))

    def at(self, detail: float, blur: float) -> Level:
        """The pictures reduced, never enlarged, and blurred.

        Parameters
        ----------
        detail : float, pixels
            Radius of the typical strut.
        blur : float, pixels
            Of the reduced pictures.
        """
        scale = self.scale(detail)
        key = (scale, blur)
        if key not in self._made:
            made = self._pyramid.level(scale, blur)
            large = made.target.size + sum(other.target.size for of, other in self._made.items() if of[0] >= SMALL)
            if large > KEPT:
                self._made = {of: other for of, other in self._made.items() if of[0] < SMALL}
            self._made[key] = made
        return self._made[key]

    def pixels_per_mm(self, detail: float) -> float:
        """How many pixels of the pictures of `at` a millimetre of the frame covers."""
        return self.scale(detail) * self._density
