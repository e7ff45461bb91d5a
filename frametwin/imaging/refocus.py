"""A photograph that is out of focus, made as sharp as its noise allows.

A blur that is known is undone by the filter of least mean error (Wiener, Extrapolation, Interpolation, and Smoothing of
Stationary Time Series, 1949): fine detail is raised as far as it stands out of the noise. Shares of pixels add up in
light, so that what is filtered is light, of picture and background alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.imaging.photograph import Photograph, with_light


@dataclass(frozen=True)
class Sharpness:
    """How sharp a photograph is made.

    Attributes
    ----------
    left : blur in pixels that is left, as fine detail is lost in any case.
    contrast : difference of light between print and background, beside which noise is small or not.
    """

    left: float
    contrast: float


GENTLE = Sharpness(1.0, 0.3)
"""For a mask of its own, which noise would make ragged."""

SHARP = Sharpness(0.7, 0.6)
"""For a look about a twin: outlines are the less biased the sharper they are, and noise is evened out by the fit."""

_PAD = 4.0  # blurs by which pictures are continued beyond their rim


def refocused(photo: Photograph, blur: float, wanted: Sharpness = SHARP) -> Photograph:
    """The photograph with a blur, a standard deviation in pixels, undone as far as is wanted.

    Its variance stays that of the photograph: noise that is raised is evened out again over an outline's length.
    """
    noise = float(np.median(photo.variance)) / wanted.contrast**2
    height, width = photo.light.shape[:2]
    pad = int(np.ceil(_PAD * blur))
    tall, wide = (cv2.getOptimalDFTSize(size + 2 * pad) for size in (height, width))
    down, across = np.fft.fftfreq(tall)[:, None], np.fft.rfftfreq(wide)[None]
    square = (2.0 * np.pi) ** 2 * (down * down + across * across)
    kept = np.exp(-0.5 * square * blur**2)
    transfer = (np.exp(-0.5 * square * wanted.left**2) * kept / (kept * kept + noise) * (1.0 + noise)).astype(
        np.float32
    )

    def sharp(picture: np.ndarray) -> np.ndarray:
        edges = (pad, tall - height - pad, pad, wide - width - pad)
        padded = cv2.copyMakeBorder(picture, *edges, cv2.BORDER_REFLECT_101)
        filtered = np.fft.irfft2(np.fft.rfft2(padded, axes=(0, 1)) * transfer[..., None], s=(tall, wide), axes=(0, 1))
        inside = filtered[pad : pad + height, pad : pad + width]
        return np.maximum(inside, 0.0).astype(np.float32)

    return with_light(photo, sharp(photo.light), sharp(photo.background), photo.variance)
