"""From the light that reaches a camera to the picture that it stores: exposure, shot and read noise, tone curve."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from frametwin.capture.scene import PhotoLook

LEVELS = 1 << 16


def expose(light: np.ndarray, look: PhotoLook, rng: np.random.Generator) -> np.ndarray:
    """A photo (H, W, 3) uint8 of linear light (H, W, 3), where 1 is just white at exposure 0.

    The number of electrons in a pixel varies as its square root (shot noise), the amplifier adds its own. The normal
    distribution stands for Poisson's, from which it does not differ visibly above some tens of electrons.
    """
    signal = np.maximum(light, 0.0).astype(np.float32) * np.float32(look.electrons * 2.0**look.exposure)
    deviation = np.sqrt(signal + np.float32(look.read_noise**2))
    signal += deviation * rng.standard_normal(light.shape, dtype=np.float32)
    signal *= np.float32((LEVELS - 1) / look.electrons)
    return tone_curve()[np.clip(signal, 0.0, LEVELS - 1).astype(np.uint16)]


@lru_cache(maxsize=1)
def tone_curve() -> np.ndarray:
    """The curve of sRGB (IEC 61966-2-1) from `LEVELS` even steps of light to 8 bits."""
    light = np.arange(LEVELS) / (LEVELS - 1)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)
