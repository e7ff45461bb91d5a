"""How far each strut may be off, from everything that a fit knows of its own faults.

The curvature of the fit gives the error that pictures leave when all that was assumed is true (`confidence`). What was
assumed is seldom true: outlines are not where the model has them, masks lose a side of the struts, the world is held by
little. Each of these has a size that shows in the fit itself, and its share is added in squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.fitting.confidence import HALF, standard_deviation
from frametwin.fitting.elastic import ElasticFrame
from frametwin.raster.rods import Terms

OUTLINE = 0.7
"""Error of a strut in radii for a misfit of 1. On exact silhouettes both are that of a tenth of a pixel's outline."""

WIDTH = 0.25
"""Error of a strut for a radius that is found off by 1: a mask that loses one side of the struts narrows and moves
them, and one that is planned wrongly only narrows them."""

DARK = 2.0
"""Error of a strut in radii for a share of 1 of its pixels in plain view that are black."""

ASTRAY = 2.0
"""Error of a strut for outlines that are off its own by 1 more than those of the typical strut: where a strut cannot
follow what was printed, or lies beside it, its outlines agree by chance in places."""

TYPICAL = 1.25
"""Times the typical strut's, up to which that tells nothing against one: others cross it, and pictures are coarse."""

HALF_SYSTEMATIC = 0.5
"""Systematic error, as a share of the strut's radius, at which the confidence is one half."""

ALONG = 0.15
"""Radii by which a strut may slide along itself, which no silhouette shows."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Standard deviations of E struts.

    Attributes
    ----------
    across, along : (E,) array, mm
    confidence : (E,) array, 0..1
    """

    across: np.ndarray
    along: np.ndarray
    confidence: np.ndarray


def uncertainty(
    elastic: ElasticFrame,
    terms: Terms,
    radius: np.ndarray,
    misfit: float,
    whiteness: np.ndarray,
    outline: np.ndarray,
    world: np.ndarray,
) -> Uncertainty:
    """Standard deviations and confidence of every strut.

    Parameters
    ----------
    elastic, terms
        The frame, and what the last step was made of.
    radius : (E,) array, mm
        As found.
    misfit : float, 0..2
        Share of pixels that twin and pictures disagree on, of the typical view that was used.
    whiteness : (E,) array, 0..1
        Share of each strut's pixels in plain view that are white.
    outline : (E,) array, radii
        By which outlines in the pictures seem to be off each strut's own.
    world : (E,) array, mm
        Standard deviation of where the world is held, at each strut.
    """
    planned = elastic.frame.radius
    formal = standard_deviation(elastic, terms)
    shared = (
        (OUTLINE * misfit * radius) ** 2
        + (WIDTH * (radius - planned)) ** 2
        + (DARK * np.maximum(0.0, 1.0 - whiteness) * radius) ** 2
        + world**2
    )
    typical = float(np.median(outline))
    beside, clearly = (ASTRAY * radius * _beyond(outline, share * typical) for share in (1.0, TYPICAL))
    across = np.sqrt(formal**2 + shared + beside**2)
    doubt = (formal / (HALF * planned)) ** 2 + (shared + clearly**2) / (HALF_SYSTEMATIC * planned) ** 2
    return Uncertainty(across, np.hypot(across, ALONG * radius), 1.0 / (1.0 + doubt))


def _beyond(values: np.ndarray, least: float) -> np.ndarray:
    """What is left of errors when others are taken from them, in squares; 0 below."""
    return np.sqrt(np.maximum(values**2 - least**2, 0.0))
