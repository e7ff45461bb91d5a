"""The share of each pixel that the print covers, by comparison in the photograph itself.

Every pixel is taken for I = a F + (1 - a) s B: the print's light F, spread from pixels that are surely print, and
the background B under the local factor s of light, spread from pixels that surely are not. The two shares are
solved for with a weak belief that they sum to one, so that colour decides where it can and brightness where it
must (a print that is darker at its rim would else look thinner than it is).
"""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.imaging.light import spread
from frametwin.imaging.photograph import TINT, Photograph

SUM_SPREAD = 0.05
"""By how much the shares of a pixel may miss one, in the weights of the comparison."""

MODEL_ERROR = 0.05
"""Error of the print's and the background's light, as a share of both."""

RIM = 1.1
"""How far the shading from the middle of a strut to its side goes on to the rim."""

FINE_SIGMAS, WIDE_SIGMAS = (0.9, 2.0, 6.0), (2.5, 6.0, 12.0)
BACKGROUND_SIGMAS = (2.0, 5.0, 15.0, 50.0)

_ROUNDS = 2
_CROSS = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
_SEEN = 9.0  # squared difference from the background, in multiples of the noise, of a pixel that shows print
_DISTINCT = (4.0, 16.0)  # the same between print and background: below nothing can be told, above everything
_AMONG = 1e-3  # weight of pixels at the outline where a strut has no inner ones


def first_coverage(photo: Photograph, found: np.ndarray) -> np.ndarray:
    """Coverage (H, W) float32 in 0..1 from a first, rough mask (H, W) bool."""
    around = cv2.dilate(found.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    behind = _behind(photo, ~around)
    inner = cv2.erode(found.astype(np.uint8), np.ones((5, 5), np.uint8))
    seeds = inner + _AMONG * found * (1 - inner)
    coverage = np.zeros(found.shape, dtype=np.float32)
    for _ in range(_ROUNDS):
        print_light = _print_light(photo, seeds.astype(np.float32))
        coverage = _unmixed(photo, print_light, behind)
        coverage[inner > 0] = 1.0
        coverage[~around | ~photo.near] = 0.0
        inner, seeds = _inside(coverage)
    return coverage


def coverage_about(photo: Photograph, silhouette: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Coverage from a photograph and a twin that is right to within a margin.

    Parameters
    ----------
    photo
        The photograph.
    silhouette : (H, W) float32
        The twin's, 0..1, with the camera's lens distortion if the photograph has it.
    margin
        Pixels by which the twin's outlines may be wrong.

    Returns
    -------
    coverage : (H, W) float32
        Where print and background look alike, the silhouette itself.
    certain : (H, W) float32
        0 where nothing could be told, 1 where everything.
    """
    inside = (silhouette > 0.5).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 5)
    outer = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5) > margin
    behind = _behind(photo, outer)
    differs = ((photo.light - behind) ** 2 / (photo.variance + (TINT * behind) ** 2)).sum(axis=-1)
    seeds = ((differs > _SEEN) & (depth > 1.5)) + 0.01 * ((differs > _SEEN) & (depth > 0.0))
    inner = np.zeros_like(inside)
    coverage = certain = np.zeros(silhouette.shape, dtype=np.float32)
    for _ in range(_ROUNDS):
        print_light = _print_light(photo, seeds.astype(np.float32))
        coverage = _unmixed(photo, print_light, behind)
        coverage[inner > 0] = 1.0
        coverage[depth > margin] = 1.0
        coverage[outer] = 0.0
        distinct = ((print_light - behind) ** 2 / (2.0 * photo.variance + (TINT * behind) ** 2)).sum(axis=-1)
        certain = np.clip((distinct - _DISTINCT[0]) / (_DISTINCT[1] - _DISTINCT[0]), 0.0, 1.0)
        coverage = certain * coverage + (1.0 - certain) * silhouette
        inner, seeds = _inside(coverage)
    return coverage.astype(np.float32), np.where(outer, 1.0, certain).astype(np.float32)


def _behind(photo: Photograph, free: np.ndarray) -> np.ndarray:
    """Light of the background (H, W, 3), with the shadows that lie on it where pixels (H, W) bool are free of print."""
    weight = free.astype(np.float32)
    if not photo.has_reference:
        return spread(photo.light, weight, BACKGROUND_SIGMAS)
    return np.asarray(spread(photo.factor, weight, BACKGROUND_SIGMAS)[..., None] * photo.background)


def _print_light(photo: Photograph, seeds: np.ndarray) -> np.ndarray:
    """Light of the print (H, W, 3), its shading carried on to the rim of each strut."""
    fine, wide = spread(photo.light, seeds, FINE_SIGMAS), spread(photo.light, seeds, WIDE_SIGMAS)
    return np.asarray(np.clip(fine + RIM * (fine - wide), 0.4 * fine, 1.8 * fine))


def _unmixed(photo: Photograph, front: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """The share that is not background, by least squares with the belief that both shares sum to one."""
    weight = 1.0 / (photo.variance + (MODEL_ERROR * (front + behind)) ** 2)
    belief = 1.0 / SUM_SPREAD**2
    ff = (weight * front * front).sum(axis=-1) + belief
    fb = (weight * front * behind).sum(axis=-1) + belief
    bb = (weight * behind * behind).sum(axis=-1) + belief
    fi = (weight * front * photo.light).sum(axis=-1) + belief
    bi = (weight * behind * photo.light).sum(axis=-1) + belief
    background_share = (ff * bi - fb * fi) / np.maximum(ff * bb - fb * fb, 1e-9)
    return np.asarray(np.clip(1.0 - background_share, 0.0, 1.0))


def _inside(coverage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels that are wholly print (H, W) uint8, and weights (H, W) of those from which its light is spread."""
    covered = (coverage > 0.5).astype(np.uint8)
    inner = cv2.erode(covered, _CROSS)
    return inner, inner + _AMONG * covered
