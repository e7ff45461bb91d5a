"""Where an edge between black and white lies in profiles across it, by the share of white in each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_CONTRAST = 12.0
"""Grey values between the two sides of an edge."""


@dataclass(frozen=True, eq=False)
class Profiles:
    """What profiles across an edge tell.

    Attributes
    ----------
    positions : (N,) array, px
        Where the edge is, from the middle towards the last sample; NaN where no edge is seen.
    contrast : (N,) array
        Grey values by which the side of the last sample is brighter.
    blur : (N,) array, px
        Standard deviation of the blur; NaN where no edge is seen.
    """

    positions: Floats
    contrast: Floats
    blur: Floats


def edge_profiles(grey: NDArray[np.uint8], places: Floats, reach: float) -> Profiles:
    """Measure an edge at several stations.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    places : (N, M, 2) array
        Samples in even steps across the edge at each station; pixel centres are whole numbers.
    reach
        How far they go to both sides of the middle, px.
    """
    light = _sampled(grey, places)
    count = light.shape[1]
    part = max(1, count // 6)
    low, high = light[:, :part].mean(axis=1), light[:, -part:].mean(axis=1)
    contrast = high - low
    size = np.abs(contrast)
    seen = np.isfinite(size)
    seen[seen] = size[seen] > max(LEAST_CONTRAST, 0.5 * float(np.median(size[seen]))) if seen.any() else False
    share = np.clip((light[seen] - low[seen, None]) / contrast[seen, None], -0.2, 1.2)
    step = 2.0 * reach / (count - 1)
    positions, blur = np.full(len(light), np.nan), np.full(len(light), np.nan)
    positions[seen] = reach - step * (share.sum(axis=1) - 0.5 * (share[:, 0] + share[:, -1]))
    blur[seen] = np.sqrt(np.pi) * step * (share * (1.0 - share)).sum(axis=1)  # of a Gaussian blur, exactly
    return Profiles(positions, np.where(np.isfinite(contrast), contrast, 0.0), blur)


def _sampled(grey: NDArray[np.uint8], places: Floats) -> Floats:
    """Grey values at places (..., 2) between pixels, linear; NaN outside the picture.

    OpenCV's own takes places to a thirty-second of a pixel only.
    """
    from scipy import ndimage  # a tenth of a second, and every fit would wait for it

    rows_first = np.moveaxis(places[..., ::-1], -1, 0)
    return np.asarray(ndimage.map_coordinates(grey, rows_first, np.float64, order=1, cval=np.nan))
