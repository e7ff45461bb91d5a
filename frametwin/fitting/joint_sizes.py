"""Material at joints: blobs that are thicker than the struts that end in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frametwin.fitting.presence import steadied
from frametwin.raster import rods
from frametwin.raster.pyramid import Level
from frametwin.raster.rods import Rods

CANDIDATES = (1.0, 1.15, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0)
"""Common sizes that are tried, relative to the thickest strut of each joint."""

SMALLEST, LARGEST = 1.0, 6.0

FURTHEST = 0.3
"""Most by which the logarithm of a size changes in a step."""

WORTH = 0.02
"""Share by which the loss must fall before joints are given material of their own."""


def common_size(drawn: Rods, level: Level, candidates: Sequence[float] = CANDIDATES) -> float:
    """The one size of all joints with the lowest loss; 1 where a larger one gains less than `WORTH`.

    Candidates, of which the first is 1, are gone through until the loss has risen twice in turn.
    """
    ones = np.ones(len(drawn.joints))
    losses: list[float] = []
    for size in candidates:
        losses.append(rods.squared_loss(replace(drawn, joint_size=size * ones), level, keep=size == candidates[0]))
        if len(losses) > 2 and losses[-1] > losses[-2] > losses[-3]:
            break
    best = int(np.argmin(losses))
    return candidates[best] if losses[best] < (1.0 - WORTH) * losses[0] else 1.0


def learn_joint_sizes(sizes: np.ndarray, radius: np.ndarray, by_struts: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """A Gauss-Newton step of the joints' sizes, each held to the common one (`frametwin.fitting.presence.steadied`).

    A size is relative to the struts'. Were these made thicker and the size stepped too, the joint would get both.

    Parameters
    ----------
    sizes : (V,) array
        The present ones.
    radius : (V,) array, mm
        Of the discs that were drawn; 0 for none.
    by_struts : (V,) array, mm
        The same of the present sizes with struts as thick as they are from now on.
    widths : (V, 2) array
        Curvature and slope of the loss by each disc's radius.
    """
    seen = (radius > 0.0) & (widths[:, 0] > 0.0)
    if not seen.any():
        return sizes
    near = np.log(sizes[seen])
    step = steadied(near, widths[seen, 0] * radius[seen] ** 2, widths[seen, 1] * radius[seen])
    if step is None:
        return sizes
    result = sizes.copy()
    result[seen] = np.exp(np.clip(step, near - FURTHEST, near + FURTHEST)) * radius[seen] / by_struts[seen]
    return np.clip(result, SMALLEST, LARGEST)
