"""How far out of focus a photograph is, told by a twin, and the print's light where no pixel is wholly print.

A thin strut out of focus fills none of its pixels, so that its light cannot be read off anywhere. But a twin says how
much of each pixel it would fill under any blur; the blur under which print and background then explain the photograph
best is the camera's, and the light of the print follows from all pixels that it shares. A twin that lies
a little beside the print would gain by any blur, so a photograph is first asked whether its edges are as sharp as the
twin's would be: how much edges there are does not depend on where they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from frametwin.imaging.light import spread

BLURS = (0.0, 0.5, 0.7, 0.9, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0)
"""Gaussian blurs that are tried, in pixels."""

SIGMAS = (1.5, 3.0, 8.0)
"""Windows, in pixels, over which the light of the print is taken to be even."""

LEAST_SHARE = 0.2
"""Share of a pixel that must be print for it to tell of the print's light."""

_NEAR = np.ones((9, 9), np.uint8)


def blur_of(light: np.ndarray, behind: np.ndarray, silhouette: np.ndarray) -> float:
    """Standard deviation of a photograph's blur in pixels.

    Parameters
    ----------
    light : (H, W, 3) float32
        Of the photograph.
    behind : (H, W, 3) float32
        Of the background.
    silhouette : (H, W) float32
        The twin's, 0..1. Where it is off by a pixel the blur is found nearly as well.

    Returns
    -------
    0 for photographs that are as good as sharp.
    """
    near = cv2.dilate((silhouette > 0.1).astype(np.uint8), _NEAR) > 0
    if not near.any():
        return 0.0
    rows, columns = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
    window = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    light, behind, silhouette, near = light[window], behind[window], silhouette[window], near[window]
    least = np.inf
    rests: list[float] = []
    for blur in BLURS:
        share = blurred(silhouette, blur)
        front = shared_light(light, behind, share)
        if blur == 0.0 and _edges(share[..., None] * (front - behind), near) < _edges(light - behind, near):
            return 0.0
        missed = light - share[..., None] * front - (1.0 - share[..., None]) * behind
        rest = float((missed[near] ** 2).mean())
        rests.append(rest)
        if rest > least:
            break
        least = rest
    return _lowest(BLURS[: len(rests)], rests)


def _lowest(blurs: Sequence[float], rests: Sequence[float]) -> float:
    """Where the parabola through the lowest value and its two neighbours is lowest."""
    middle = int(np.argmin(rests))
    if not 0 < middle < len(rests) - 1:
        return blurs[middle]
    near = slice(middle - 1, middle + 2)
    second, first, _ = np.polyfit(blurs[near], rests[near], 2)
    return float(-0.5 * first / second) if second > 0.0 else blurs[middle]


def _edges(picture: np.ndarray, near: np.ndarray) -> float:
    """How much edges there are in a picture (H, W, 3), over the pixels ``near`` (H, W) bool."""
    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 0.7)
    return sum(float((cv2.Sobel(smooth, cv2.CV_32F, *axis, ksize=1)[near] ** 2).mean()) for axis in ((1, 0), (0, 1)))


def blurred(silhouette: np.ndarray, blur: float) -> np.ndarray:
    """The silhouette (H, W) as a lens with that blur in pixels shows it."""
    return silhouette if blur == 0.0 else np.asarray(cv2.GaussianBlur(silhouette, (0, 0), blur))


def shared_light(light: np.ndarray, behind: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Light of the print (H, W, 3) from pixels of which it fills a share (H, W), by least squares in each window."""
    known = np.maximum(share, LEAST_SHARE)[..., None]
    front = behind + (light - behind) / known
    weight = np.where(share > LEAST_SHARE, share * share, 0.0).astype(np.float32)
    return np.maximum(spread(front.astype(np.float32), weight, SIGMAS), 0.0)
