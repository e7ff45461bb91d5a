"""The share of each pixel that the print covers, by comparison in the photograph itself.

Every pixel is taken for I = a F + (1 - a) s B: the print's light F, spread from pixels that are surely print, and
the background B under the local factor s of light, spread from pixels that surely are not. The two shares are
solved for with a weak belief that they sum to one, so that colour decides where it can and brightness where it
must (a print that is darker at its rim would else look thinner than it is).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.imaging.focus import blur_of, blurred, shared_light
from frametwin.imaging.light import spread
from frametwin.imaging.photograph import TINT, Photograph
from frametwin.imaging.shading import shaded_light
from frametwin.raster.lens_blur import edge_spread, lens_blur

SUM_SPREAD = 0.05
"""By how much the shares of a pixel may miss one, in the weights of the comparison."""

SHADED_SPREAD = 0.3
"""The same out of focus, where a strut's shading from side to side cannot be seen and its brightness tells little."""

MODEL_ERROR = 0.05
"""Error of the print's and the background's light, as a share of both."""

SOFTER = 1.12
"""How many times the blur that explains a photograph best, at most, its blur is taken to be."""

RIM = 1.1
"""How far the shading from the middle of a strut to its side goes on to the rim."""

NARROW = 6.2
"""Half width of a typical strut in pixels, see `half_width`, below which its own shading tells too little of its rim,
and that of all struts of the view is asked. From eight pixels on, a strut's own is the better guide."""

FINE_SIGMAS, WIDE_SIGMAS = (0.9, 2.0, 6.0), (2.5, 6.0, 12.0)
BACKGROUND_SIGMAS = (2.0, 5.0, 15.0, 50.0)

SHARP = 0.8
"""Blur in pixels up to which struts have pixels that are wholly print."""

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


@dataclass(frozen=True, eq=False)
class Coverage:
    """What a photograph shows about a twin.

    Attributes
    ----------
    share : (H, W) float32, of each pixel that is print; where print and background look alike, the twin's own.
    certain : (H, W) float32, 0 where nothing could be told, 1 where everything.
    """

    share: np.ndarray
    certain: np.ndarray


def coverage_about(
    photo: Photograph, silhouette: np.ndarray, margin: float, blur: float = 0.0, normals: np.ndarray | None = None
) -> Coverage:
    """Coverage from a photograph and a twin that is right to within a margin.

    Parameters
    ----------
    photo
        The photograph.
    silhouette : (H, W) float32
        The twin's, 0..1, with the camera's lens distortion if the photograph has it.
    margin
        Pixels by which the twin's outlines may be wrong.
    blur
        Of the photograph in pixels, if it has so much that no pixel need be wholly print.
    normals : (H, W, 3) float32, optional
        Of the twin's surface, 0 where there is none, by which the light of the sides of narrow struts is told. By
        default shading is carried on from the middle of each strut to its sides.
    """
    outer = _outside(silhouette) > margin + 2.0 * blur
    behind = _behind(photo, outer)
    if blur > 0.0:
        share, certain = _out_of_focus(photo, behind, blurred(silhouette, blur))
        share = np.where(outer, 0.0, share)
    else:
        share, certain = _in_focus(photo, behind, silhouette, outer, margin, normals)
    return Coverage(share.astype(np.float32), np.where(outer, 1.0, certain).astype(np.float32))


def blur_about(photo: Photograph, silhouette: np.ndarray, margin: float) -> float:
    """Blur in pixels of a photograph, told by a twin as in `coverage_about`; 0 where it is sharp enough.

    Struts that are dark on one side look narrower, and so sharper, than they are. How soft the shares of print are, as
    colours tell them, mends that in part.
    """
    outside = _outside(silhouette)
    blur = _blur(photo, _behind(photo, outside > margin), silhouette)
    if blur <= SHARP:
        return 0.0
    outer = outside > margin + 2.0 * blur
    behind = _behind(photo, outer)
    share = _unmixed(photo, shared_light(photo.light, behind, blurred(silhouette, blur)), behind, SHADED_SPREAD)
    share[outer] = 0.0
    return float(np.clip(lens_blur(share, silhouette, edge_spread(share)), blur, SOFTER * blur))


def half_width(silhouette: np.ndarray) -> float:
    """Of a typical strut in pixels: half of a straight one's pixels lie more than half as deep."""
    inside = (silhouette > 0.5).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 5)[inside > 0]
    return 2.0 * float(np.median(depth)) if depth.size else 0.0


def _outside(silhouette: np.ndarray) -> np.ndarray:
    """How many pixels each pixel (H, W) is from a silhouette."""
    return np.asarray(cv2.distanceTransform((silhouette <= 0.5).astype(np.uint8), cv2.DIST_L2, 5))


def _blur(photo: Photograph, behind: np.ndarray, silhouette: np.ndarray) -> float:
    """The blur of a photograph in which the print is seen; of one that shows as good as nothing none is told."""
    seen = _difference(photo, behind)[silhouette > 0.5] > _SEEN
    return blur_of(photo.light, behind, silhouette) if seen.size and seen.mean() > 0.5 else 0.0


def _difference(photo: Photograph, behind: np.ndarray) -> np.ndarray:
    """Squared difference (H, W) from the background, in multiples of the noise."""
    return np.asarray(((photo.light - behind) ** 2 / (photo.variance + (TINT * behind) ** 2)).sum(axis=-1))


def _out_of_focus(photo: Photograph, behind: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares of pixels none of which need be wholly print, and how certain; ``expected`` (H, W) are the twin's."""
    share = expected
    for _ in range(_ROUNDS):
        front = shared_light(photo.light, behind, share)
        certain = _told_apart(photo, front, behind)
        share = certain * _unmixed(photo, front, behind, SHADED_SPREAD) + (1.0 - certain) * expected
    return share, certain


def _in_focus(
    photo: Photograph,
    behind: np.ndarray,
    silhouette: np.ndarray,
    outer: np.ndarray,
    margin: float,
    normals: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """The same where the middles of the struts are wholly print; ``outer`` (H, W) bool is out of the twin's reach."""
    depth = cv2.distanceTransform((silhouette > 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    differs = _difference(photo, behind) > _SEEN
    seeds = (differs & (depth > 1.5)) + 0.01 * (differs & (depth > 0.0))
    inner = np.zeros(silhouette.shape, dtype=np.uint8)
    faces = normals if half_width(silhouette) < NARROW else None
    for _ in range(_ROUNDS):
        known = seeds.astype(np.float32)
        front = _print_light(photo, known) if faces is None else _shaded_light(photo, faces, known)
        share = _unmixed(photo, front, behind)
        share[inner > 0] = 1.0
        share[depth > margin] = 1.0
        share[outer] = 0.0
        certain = _told_apart(photo, front, behind)
        share = certain * share + (1.0 - certain) * silhouette
        inner, seeds = _inside(share)
    return share, certain


def _told_apart(photo: Photograph, front: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """How well (H, W) in 0..1 the lights of print and background can be told apart."""
    distinct = ((front - behind) ** 2 / (2.0 * photo.variance + (TINT * behind) ** 2)).sum(axis=-1)
    return np.asarray(np.clip((distinct - _DISTINCT[0]) / (_DISTINCT[1] - _DISTINCT[0]), 0.0, 1.0))


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


def _shaded_light(photo: Photograph, normals: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """The same, its shading told by where its surface faces (H, W, 3)."""
    return shaded_light(photo.light, normals, seeds, (FINE_SIGMAS, WIDE_SIGMAS))


def _unmixed(photo: Photograph, front: np.ndarray, behind: np.ndarray, sum_spread: float = SUM_SPREAD) -> np.ndarray:
    """The share that is not background, by least squares with the belief that both shares sum to one."""
    weight = 1.0 / (photo.variance + (MODEL_ERROR * (front + behind)) ** 2)
    belief = 1.0 / sum_spread**2
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
