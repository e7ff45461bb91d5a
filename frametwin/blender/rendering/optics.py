"""What a lens and its shutter do to the light of a view before the sensor: blur, dark corners, exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frametwin.capture.scene import PhotoLook

REACH = 3.0
"""Of the blur, in standard deviations."""


def through_lens(light: np.ndarray, look: PhotoLook) -> np.ndarray:
    """Linear light (H, W, 3), out of focus and darker towards the corners as the look says."""
    if look.defocus:
        light = blurred(light, look.defocus)
    if look.vignetting:
        light = light * vignette(light.shape[0], light.shape[1], look.vignetting)[..., None]
    return light


def view_look(look: PhotoLook, view: int, reference: bool) -> PhotoLook:
    """The look of one view, with its own exposure; ``reference`` is the picture without the print."""
    stops = look.view_exposures[view] if view < len(look.view_exposures) else 0.0
    stops += look.reference_exposure if reference else 0.0
    return replace(look, exposure=float(np.clip(look.exposure + stops, -5.0, 5.0))) if stops else look


def blurred(light: np.ndarray, deviation: float) -> np.ndarray:
    """Linear light (H, W, C) under a Gaussian blur, in px; what is beyond the edge is as the edge."""
    reach = int(np.ceil(REACH * deviation))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    weights = (weights / weights.sum()).astype(np.float32)
    for axis in (0, 1):
        room = [(reach, reach) if axis == other else (0, 0) for other in range(light.ndim)]
        padded, side = np.pad(light, room, mode="edge"), light.shape[axis]
        light = sum(weight * padded.take(range(shift, shift + side), axis=axis) for shift, weight in enumerate(weights))
    return light


def vignette(height: int, width: int, share: float) -> np.ndarray:
    """Share (H, W) of the light that is left: 1 in the middle, ``1 - share`` in the corners, even in between."""
    y = (np.arange(height) + 0.5) / height * 2.0 - 1.0
    x = (np.arange(width) + 0.5) / width * 2.0 - 1.0
    square = (x[None] * width) ** 2 + (y[:, None] * height) ** 2
    return (1.0 - share * square / (width**2 + height**2)).astype(np.float32)
