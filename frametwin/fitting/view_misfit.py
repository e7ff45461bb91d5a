"""How far each view agrees with a twin, and which views disagree with all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods

APART = 3.0
"""A view that disagrees by so many times the median of all is suspected ..."""

LEAST = 0.08
"""... if it disagrees by so much at least."""

FEWEST = 4
"""Views that a fit needs: no more are left out than leave so many."""


@dataclass(frozen=True, eq=False)
class ViewMisfit:
    """Shares of pixels, view by view.

    Attributes
    ----------
    unexplained : (N,) array, 0..1
        Of the white of each picture, what the twin does not draw.
    unseen : (N,) array, 0..1
        Of what the twin draws, what is not white in the picture.
    """

    unexplained: np.ndarray
    unseen: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """(N,) array: both."""
        return self.unexplained + self.unseen


def view_misfit(drawn: Rods, level: Level) -> ViewMisfit:
    """Compare what is drawn with every picture of a level."""
    through = rods.transmittance(drawn, level)
    white, missing, extra, seen = [], [], [], []
    for own, target in zip(level.pictures(through), level.pictures(level.target), strict=True):
        white.append(float(target.sum(dtype=np.float64)))
        seen.append(float(own.size - own.sum(dtype=np.float64)))
        missing.append(float(np.maximum(target + own, 1.0).sum(dtype=np.float64) - own.size))
        extra.append(seen[-1] - white[-1] + missing[-1])
    return ViewMisfit(np.array(missing) / np.maximum(white, 1.0), np.array(extra) / np.maximum(seen, 1.0))


def disagreeing(misfit: np.ndarray) -> np.ndarray:
    """Indices of views (N,) whose misfit is far above that of the others, the worst first; never too many."""
    limit = max(APART * float(np.median(misfit)), LEAST)
    worst = np.argsort(-misfit, kind="stable")
    return worst[misfit[worst] > limit][: max(len(misfit) - FEWEST, 0)]
