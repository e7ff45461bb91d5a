"""A photograph beside what would be there without the print: the reference matched to its light, and its noise.

The reference is the view before printing. Without one, the background is spread from where no print can be,
then from all pixels that look like it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from frametwin.imaging.light import light_of_one_code, linear_light, spread
from frametwin.imaging.neighbourhood import Neighbourhood

TINT = 0.06
"""By how much, as a share of its light, a background in shadow may change its colour."""

NOISE_RANGE = (0.7, 4.0)
"""Least and greatest noise of a pixel, in steps of 255, that is believed."""

DARK = 3.0
"""A background is too dark to have a colour when it is less than so many times its noise."""

_LEAST_OUTSIDE = 0.02  # share of the picture that must be free of the print for a reference to be matched there
_STRIDE = 3  # of the pixels from which light and noise are estimated
_GAIN_BINS = np.arange(-1.5, 1.5, 0.02)  # logarithms of a change of exposure
_GAIN_SPREAD = 0.6
_OWN_SIGMAS = (20.0, 60.0, 200.0)
_OWN_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Photograph:
    """Light of a picture and of its background, both linear.

    Attributes
    ----------
    light : (H, W, 3) float32, the picture.
    background : (H, W, 3) float32, what would be there without the print, in the picture's exposure.
    factor : (H, W) float32, the common factor of light with which the background comes nearest to the picture.
    variance : (H, W, 3) float32, of ``light`` less ``background``.
    bright : (H, W) float32, the background in multiples of its noise.
    neighbourhood : where the print can be.
    gain : (3,) change of exposure since the reference.
    noise : of a pixel, in steps of 255.
    has_reference : whether the background is a picture of its own.
    """

    light: np.ndarray
    background: np.ndarray
    factor: np.ndarray
    variance: np.ndarray
    bright: np.ndarray
    neighbourhood: Neighbourhood
    gain: np.ndarray
    noise: float
    has_reference: bool

    @property
    def near(self) -> np.ndarray:
        """(H, W) bool, where the print can be."""
        return self.neighbourhood.near

    def tint(self) -> np.ndarray:
        """Squared distance (H, W) from the background times one factor, in multiples of what noise does."""
        lit = np.minimum(self.factor, 3.0)[..., None] * self.background
        return np.asarray(((self.light - lit) ** 2 / (self.variance + (TINT * lit) ** 2)).sum(axis=-1))


def photograph(image: np.ndarray, reference: np.ndarray | None, where: Neighbourhood) -> Photograph:
    """Match a picture (H, W) or (H, W, 3) uint8 with the reference of its size, if there is one."""
    if reference is not None:
        return _with_reference(image, reference, where)
    found = _with_own_background(image, spread_outside(image, where), where)
    for _ in range(_OWN_ROUNDS):
        usual = (found.tint() < 9.0) & (np.abs(found.factor - 1.0) < 0.25)
        weight = (usual | ~where.near).astype(np.float32)
        found = _with_own_background(image, spread(found.light, weight, (4.0, 15.0, *_OWN_SIGMAS[1:])), where)
    return found


def spread_outside(image: np.ndarray, where: Neighbourhood) -> np.ndarray:
    """Background (H, W, 3) float32 that is known only where the print cannot be."""
    return spread(linear_light(image), _outside(where).astype(np.float32), _OWN_SIGMAS)


def _outside(where: Neighbourhood) -> np.ndarray:
    outside = ~where.near
    return outside if outside.mean() >= _LEAST_OUTSIDE else np.ones_like(outside)


def _with_reference(image: np.ndarray, reference: np.ndarray, where: Neighbourhood) -> Photograph:
    light, before = linear_light(image), linear_light(reference)
    sampled = np.zeros_like(where.near)
    sampled[::_STRIDE, ::_STRIDE] = _outside(where)[::_STRIDE, ::_STRIDE]
    gain = np.array([_gain(light[..., c][sampled], before[..., c][sampled]) for c in range(3)], dtype=np.float32)
    background = before * gain
    step = light_of_one_code(image) ** 2 + (light_of_one_code(reference) * gain) ** 2
    noise = _noise(((light - background)[sampled]) / np.sqrt(step[sampled]))
    return _assemble(light, background, noise**2 * step, where, gain, noise, has_reference=True)


def _with_own_background(image: np.ndarray, background: np.ndarray, where: Neighbourhood) -> Photograph:
    light = linear_light(image)
    step = light_of_one_code(image) ** 2
    fine = light - cv2.GaussianBlur(light, (0, 0), 1.5)
    outside = _outside(where)
    noise = _noise(1.1 * fine[outside][::_STRIDE] / np.sqrt(step[outside][::_STRIDE]))
    gain = np.ones(3, dtype=np.float32)
    return _assemble(light, background, 2.0 * noise**2 * step, where, gain, noise, has_reference=False)


def _assemble(
    light: np.ndarray,
    background: np.ndarray,
    variance: np.ndarray,
    where: Neighbourhood,
    gain: np.ndarray,
    noise: float,
    has_reference: bool,
) -> Photograph:
    power = (background * background / variance).sum(axis=-1)
    common = (light * background / variance).sum(axis=-1)
    factor = np.where(power > DARK**2, np.clip(common / np.maximum(power, 1e-12), 0.0, 20.0), 1.0).astype(np.float32)
    return Photograph(light, background, factor, variance, np.sqrt(power), where, gain, noise, has_reference)


def with_light(found: Photograph, light: np.ndarray, background: np.ndarray, variance: np.ndarray) -> Photograph:
    """The same with other light (H, W, 3) of picture and background, and its variance (H, W, 3)."""
    return _assemble(
        light, background, variance, found.neighbourhood, found.gain, found.noise, has_reference=found.has_reference
    )


def _gain(light: np.ndarray, before: np.ndarray) -> float:
    """The commonest ratio of two sets of pixels: shadows and sheen change some of them, exposure changes all."""
    usable = (before > 0.01) & (light > 0.003)
    if usable.sum() < 200:
        return 1.0
    ratio = np.log(light[usable] / before[usable])
    count, edges = np.histogram(ratio, _GAIN_BINS)
    middle = 0.5 * (edges[1:] + edges[:-1])
    likely = np.convolve(count, (0.25, 0.5, 0.25), "same") * np.exp(-0.5 * (middle / _GAIN_SPREAD) ** 2)
    around = np.abs(ratio - middle[likely.argmax()]) < 0.06
    return float(np.exp(np.median(ratio[around]))) if around.any() else 1.0


def _noise(scaled: np.ndarray) -> float:
    """Noise from differences (N, 3) in steps of 255, some of which are no noise: by the smaller ones."""
    return float(np.clip(np.quantile(np.abs(scaled), 0.4) / 0.524, *NOISE_RANGE))


def without(found: Photograph, ignored: np.ndarray) -> Photograph:
    """The same where nothing is looked for in pixels (H, W) bool that are told to be ignored."""
    near = found.near & ~ignored
    return replace(found, neighbourhood=replace(found.neighbourhood, near=near))
