"""What colour and brightness say of print where a comparison with the background, pixel by pixel, does not."""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.imaging.photograph import DARK, Photograph

_VISIBLE = 5.0  # brightness of a background, in multiples of its noise, before which dark print shows
_DARK_PRINT = -1.0  # logarithm of the light below which a print is dark beside its background
_PART_OF_DARK = 0.7
_SURELY_PRINT = 0.3  # share of the plan's pixels that are taken for print by how much they differ

_BINS = 12  # of brightness, and of each of two ratios of colours
_BIN_BLUR = 0.7
_LEAST_OUTSIDE = 0.05  # share of the picture without which its colours are not known


def darker_than_shadows(photo: Photograph) -> np.ndarray:
    """Pixels (H, W) bool that are darker than shadows usually are, for dark print without a colour of its own.

    The plan says about how many pixels of print there are, and so how dark it is. Where that is not dark beside the
    background, print and shadow cannot be told by brightness, and nothing is found.
    """
    where = photo.neighbourhood
    visible = where.near & (photo.bright > _VISIBLE)
    if not visible.any():
        return visible
    brightness = np.log(np.maximum(photo.factor, 1e-3))
    share = min(0.5 * where.expected / int(visible.sum()), 1.0)
    usual = float(np.quantile(brightness[visible], share))
    return np.asarray(visible & (usual < _DARK_PRINT) & (brightness < _PART_OF_DARK * usual))


def tinted_as_print(photo: Photograph, tint: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool whose colour lies from the background's towards that of the print.

    Shadows change their colour too, by light from the surroundings and by the camera's curve, but not towards the
    print's, which is that of the pixels that differ most from the background.
    """
    near = photo.near
    if not near.any():
        return near
    share = min(_SURELY_PRINT * photo.neighbourhood.expected / int(near.sum()), 1.0)
    strong = near & (tint >= np.quantile(tint[near], 1.0 - share))
    colour, ground = _chromaticity(photo.light), _chromaticity(photo.background)
    step = np.median(colour[strong], axis=0) - ground
    towards = ((colour - ground) * step).sum(axis=-1) > 0.0
    return np.asarray(towards | (photo.bright <= DARK))


def _chromaticity(light: np.ndarray) -> np.ndarray:
    return np.asarray(light / np.maximum(light.sum(axis=-1, keepdims=True), 1e-4))


def as_common_outside(photo: Photograph) -> np.ndarray:
    """Pixels (H, W) bool of colours that are as common where no print can be as where it should be."""
    outside = ~photo.near
    if outside.mean() < _LEAST_OUTSIDE:
        return np.zeros_like(outside)
    bins = _colour_bins(photo.light)
    near, far = _histogram(bins[photo.near]), _histogram(bins[outside])
    return np.asarray((far >= near)[bins])


def _colour_bins(light: np.ndarray) -> np.ndarray:
    """Number (H, W) of the bin of brightness and two ratios that each pixel falls into."""
    curve = np.cbrt(cv2.blur(light, (3, 3)))  # steps that look alike
    total = curve.sum(axis=-1)
    first, second = (curve[..., c] / np.maximum(total, 0.1) for c in (0, 2))
    places = (total / 3.0, (first - 0.2) / 0.3, (second - 0.2) / 0.3)
    whole = [np.clip((place * _BINS).astype(np.int32), 0, _BINS - 1) for place in places]
    return np.asarray((whole[0] * _BINS + whole[1]) * _BINS + whole[2])


def _histogram(bins: np.ndarray) -> np.ndarray:
    """Share of pixels in each bin, those of neighbouring bins mixed in."""
    from scipy.ndimage import gaussian_filter  # a tenth of a second, for photographs without a background alone

    count = np.bincount(bins, minlength=_BINS**3).reshape(_BINS, _BINS, _BINS).astype(float)
    return np.asarray(gaussian_filter(count / max(len(bins), 1), _BIN_BLUR, mode="nearest").ravel())
