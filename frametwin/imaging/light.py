"""Photographs as light: decoded to linear brightness, and spread from the pixels that are known.

Shares of a pixel add up in light and not in the numbers of a picture file, which follow the curve of sRGB
(IEC 61966-2-1). Cameras differ from that curve; at an outline only its rough course matters.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

_CODES = np.arange(256) / 255.0
_LIGHT = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4).astype(np.float32)
_STEP = np.gradient(_LIGHT).astype(np.float32)

_ENOUGH = 0.05  # share of a window that must be known for its mean to count in full
_FINE_SIGMA = 3.0  # windows wider than this are averaged in a reduced picture


def linear_light(image: np.ndarray) -> np.ndarray:
    """Light (H, W, 3) float32 in 0..1 of a picture (H, W) or (H, W, 3) uint8."""
    return np.asarray(cv2.LUT(_three_channels(image), _LIGHT))


def light_of_one_code(image: np.ndarray) -> np.ndarray:
    """How much light (H, W, 3) float32 one step of the picture's numbers is, at each pixel."""
    return np.asarray(cv2.LUT(_three_channels(image), _STEP))


def _three_channels(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2))


def spread(values: np.ndarray, weight: np.ndarray, sigmas: Sequence[float]) -> np.ndarray:
    """Fill a picture from the pixels that are known, by weighted means over windows that grow as they must.

    Normalised convolution (Knutsson and Westin, CVPR 1993).

    Parameters
    ----------
    values : (H, W) or (H, W, 3) float32
        What is known where ``weight`` is above 0.
    weight : (H, W) float32
        Weight of each pixel.
    sigmas
        Spread of the Gaussian windows in pixels, growing; the next one serves where too little is known within
        one. Where nothing is known within the last, the mean of all is taken.

    Returns
    -------
    Array of the shape of ``values``.
    """
    stacked = np.dstack([values * _as_columns(weight, values), weight])
    total = stacked.sum(axis=(0, 1))
    everywhere = total[:-1] / max(float(total[-1]), 1e-9)
    filled = np.zeros((*values.shape[:2], stacked.shape[2] - 1), dtype=np.float32)
    missing = np.ones(values.shape[:2], dtype=np.float32)
    for sigma in sigmas:
        mean = _blurred(stacked, sigma)
        known = mean[..., -1]
        share = np.minimum(known / _ENOUGH, 1.0) * missing
        filled += (share / np.maximum(known, 1e-9))[..., None] * mean[..., :-1]
        missing -= share
    filled += missing[..., None] * everywhere.astype(np.float32)
    return filled.reshape(values.shape)


def _as_columns(weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    return weight if values.ndim == 2 else weight[..., None]


def _blurred(values: np.ndarray, sigma: float) -> np.ndarray:
    if sigma <= _FINE_SIGMA:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))
    height, width = values.shape[:2]
    reduction = max(1, int(sigma / (0.6 * _FINE_SIGMA)))
    size = (max(1, width // reduction), max(1, height // reduction))
    small = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / reduction, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))
