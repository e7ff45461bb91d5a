"""A view's print against the twin: its outline to lay over the twin, and where the two differ.

Colours follow Okabe and Ito, "Color universal design", 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

ONLY_PRINT = (230, 159, 0)  # orange
ONLY_TWIN = (86, 180, 233)  # sky blue
LIGHT, DARK = (255, 255, 255), (0, 0, 0)
THRESHOLD = 0.5
"""Share of a pixel from which on it is print."""

FINE = 800
"""Width of a picture in pixels for each of which a line gets a pixel more."""


@dataclass(frozen=True)
class Shares:
    """Of the print that a view shows: how much the twin leaves out, and how much more the twin covers."""

    left_out: float
    beyond: float


def outline(coverage: np.ndarray) -> np.ndarray:
    """Outline of the print, light with a dark rim, so that it is seen over everything.

    Parameters
    ----------
    coverage : (H, W) float array
        Share of each pixel that is print.

    Returns
    -------
    (H, W, 4) uint8 array, red, green, blue, opacity.
    """
    mask = (coverage >= THRESHOLD).astype(np.uint8)
    width = 1 + mask.shape[1] // FINE
    inner, outer = _grown(mask, width) - mask, _grown(mask, 2 * width) - mask
    picture = np.zeros((*mask.shape, 4), dtype=np.uint8)
    picture[outer > 0] = (*DARK, 255)
    picture[inner > 0] = (*LIGHT, 255)
    return picture


def difference(coverage: np.ndarray, drawn: np.ndarray) -> tuple[np.ndarray, Shares]:
    """Where print and twin differ: print without twin orange, twin without print blue, the rest clear.

    Parameters
    ----------
    coverage : (H, W) float array
        Share of each pixel that is print.
    drawn : (H, W) array
        Not zero where the twin is.

    Returns
    -------
    (H, W, 4) uint8 array, red, green, blue, opacity, and how much that is.
    """
    mask, twin = coverage >= THRESHOLD, drawn > 0
    picture = np.zeros((*mask.shape, 4), dtype=np.uint8)
    picture[mask & ~twin] = (*ONLY_PRINT, 255)
    picture[twin & ~mask] = (*ONLY_TWIN, 255)
    all_of_it = max(int(mask.sum()), 1)
    return picture, Shares(float((mask & ~twin).sum()) / all_of_it, float((twin & ~mask).sum()) / all_of_it)


def _grown(mask: np.ndarray, by: int) -> np.ndarray:
    side = 2 * by + 1
    return np.asarray(cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))))
