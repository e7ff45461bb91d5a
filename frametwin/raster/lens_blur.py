"""How soft the outlines in masks are, and by what blur of the lens rods look as soft.

The slope of a straight edge that is blurred by a Gaussian of the spread s is that Gaussian, so that the mean of the
slope, weighted with its square, is 1 / (sqrt(3 pi) s): what a picture says of s without knowing where its edges are.
Struts that are no wider than the blur have less steep edges for another reason, and so have struts that cross; the
blur is therefore that with which pictures of the rods, wherever about they may be, are as soft as the masks.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt

import cv2
import numpy as np

SOFT = 0.9
"""Spread in pixels from which edges are called soft: those of sharp pictures are at 0.4 to 0.6."""

WIDEST = 10.0
"""Largest blur that is believed, in pixels."""

_ROWS = 3  # one in so many is looked at
_SLOPE = 0.02  # least slope, of 1 a pixel, that is taken for an edge
_ROUNDS = 4


def edge_spread(picture: np.ndarray) -> float:
    """Typical spread s in pixels of the edges in a picture (H, W), 0..1; 0 where it has none."""
    here, below = picture[:-1:_ROWS, :-1], picture[1::_ROWS, :-1]
    across, down = picture[:-1:_ROWS, 1:] - here, below - here
    steep = across * across + down * down
    steep = steep[steep > _SLOPE * _SLOPE]
    square = float(steep.sum())
    return square / (sqrt(3.0 * pi) * float((steep * np.sqrt(steep)).sum())) if square > 0.0 else 0.0


def lens_blur(mask: np.ndarray, sharp: np.ndarray, spread: float) -> float:
    """Blur in pixels after which a sharp picture is as soft as a mask.

    Parameters
    ----------
    mask : (H, W), 0..1.
    sharp : (H, W), of about the same struts.
    spread : of the mask's edges, see `edge_spread`.
    """
    variance = 0.0
    found = edge_spread(sharp)
    for _ in range(_ROUNDS):
        variance = min(max(variance + spread**2 - found**2, 0.0), WIDEST**2)
        if variance == 0.0:
            return 0.0
        found = edge_spread(cv2.GaussianBlur(sharp, (0, 0), sqrt(variance)))
    return sqrt(variance)


def soft_views(masks: Sequence[np.ndarray]) -> np.ndarray:
    """(N,) spread of the edges in each mask that has soft ones, 0 for the others."""
    spreads = np.array([edge_spread(mask) for mask in masks])
    return np.where(spreads > SOFT, spreads, 0.0)
