"""Blur of the lenses, told by the masks before a fit begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.elastic import ElasticFrame
from frametwin.fitting.motion import as_rods, start_pose
from frametwin.raster import rods
from frametwin.raster.lens_blur import lens_blur, soft_views
from frametwin.raster.pyramid import Pyramid

PIECES = 6
"""Straight pieces of a strut."""


def lens_blurs(elastic: ElasticFrame, cameras: Sequence[Camera], masks: Sequence[np.ndarray]) -> np.ndarray | None:
    """Blur of each picture by its lens.

    Parameters
    ----------
    elastic : ElasticFrame
        Of the plan: how much edge there is in a picture hardly depends on where the struts are.
    cameras, masks
        See `frametwin.fitting.part_fit.Fitter.fit`.

    Returns
    -------
    (N,) array or None
        Standard deviation in pixels; ``None`` where all pictures are sharp.
    """
    spreads = soft_views(masks)
    soft = np.flatnonzero(spreads)
    if not soft.size:
        return None
    level = Pyramid([cameras[i] for i in soft], [masks[i] for i in soft]).level(1.0, 0.0)
    drawn = as_rods(elastic, start_pose(elastic), PIECES)
    sharp = level.pictures(np.float32(1.0) - rods.transmittance(drawn, level))
    result = np.zeros(len(masks))
    result[soft] = [lens_blur(masks[i], picture, spreads[i]) for i, picture in zip(soft, sharp, strict=True)]
    return result
