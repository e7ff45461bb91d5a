"""Masks of photographs: what is print in one picture, and whether the picture can be used at all.

A pixel is background if it is the reference times one common factor of light: a shadow. It is print if its colour
says otherwise, or if it is brighter than the background nearby, and if the plan is near. A first mask so found
keeps all that colour tells; what lies wholly in shadow is found once a first twin says where to look
(`refined_mask`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frametwin.imaging.colours import as_common_outside, darker_than_shadows, tinted_as_print
from frametwin.imaging.coverage import blur_about, coverage_about, first_coverage, half_width
from frametwin.imaging.focus import blurred
from frametwin.imaging.light import spread
from frametwin.imaging.photograph import Photograph
from frametwin.imaging.refocus import GENTLE, refocused

LEAST_FOUND, MOST_FOUND = 0.25, 3.0
"""Share of the plan's pixels that a view must show, and may."""

LEAST_TOLD = 0.3
"""Share of a twin's pixels that must differ from the background."""

LEAST_RANGE = 12
"""Difference of the brightest and darkest pixels, of 255, below which a picture shows nothing."""

THICK = 2.5
"""Half widths of a strut in blurs, from which a photograph can be made so sharp that the middles of struts are wholly
print. Thinner ones keep neither their width nor their place by it."""

EVENED = 1.0
"""Blur in pixels of the mask of a photograph that was made sharp, whose noise was raised by it. The fit draws struts as
soft (`frametwin.raster.lens_blur`)."""

MARGIN = 0.6
"""By how many mm the first twin may be off."""

_TINTED = 16.0  # squared, in multiples of the noise
_USUAL = 6.0
_SHADOW = (0.05, 1.6)  # factors of light that background may have
_BRIGHTER = 1.3  # than the background nearby
_SURE = 5.0
_ENOUGH = 0.5  # share of the plan's pixels below which brightness alone is asked too
_LIT = 0.75  # quantile of the background's factors that is taken to be out of all shadows
_FACTOR_SIGMAS = (6.0, 25.0, 80.0)


@dataclass(frozen=True, eq=False)
class ViewMask:
    """What one view shows of the print.

    Attributes
    ----------
    coverage : (H, W) float32, the share of each pixel that is print.
    used : whether the view is good for a fit.
    reason, remedy : why not, and what to do about it, in words.
    method : "mask" for a picture that is a mask already, "paper", "reference" or "alone".
    valid : (H, W) float32, how much each pixel tells, 0 where it tells nothing.
    found : pixels of print as a share of what the plan would cover; NaN where that is not known.
    photo : what the mask was made from, if it was a photograph.
    blur : of the photograph in pixels, once a twin has told it; see `frametwin.imaging.focus`.
    softness : the blur in half widths of a typical strut.
    """

    coverage: np.ndarray
    used: bool = True
    reason: str = ""
    method: str = "mask"
    valid: np.ndarray | None = None
    found: float = float("nan")
    photo: Photograph | None = None
    blur: float = 0.0
    softness: float = 0.0
    remedy: str = "give a picture of the print, better with the same view before printing in background/, or a mask"


def photo_mask(photo: Photograph) -> ViewMask:
    """Find the print in a photograph by colour and brightness, near the plan."""
    rough = rough_mask(photo)
    coverage = first_coverage(photo, rough)
    method = "reference" if photo.has_reference else "alone"
    found = float(coverage.sum()) / max(photo.neighbourhood.expected, 1)
    reason = ""
    if found < LEAST_FOUND:
        reason = f"too little of the print is found ({found:.0%} of what the plan would cover)"
    elif found > MOST_FOUND:
        reason = f"too much differs from the background ({found:.0%} of what the plan would cover)"
    return ViewMask(coverage, not reason, reason, method, None, found, photo)


def rough_mask(photo: Photograph) -> np.ndarray:
    """Pixels (H, W) bool that are no background under any one factor of light."""
    tint, factor = photo.tint(), photo.factor
    usual = (tint < _USUAL) & (factor > _SHADOW[0]) & (factor < _SHADOW[1])
    nearby = spread(factor, usual.astype(np.float32), _FACTOR_SIGMAS)
    if usual.any():  # a patch of light amid shadows is no print
        nearby = np.maximum(nearby, min(1.0, float(np.quantile(factor[usual], _LIT))))
    error = 0.08 * np.maximum(nearby, 0.2) + 1.0 / np.maximum(photo.bright, 1e-6)
    brighter = (factor - nearby > _SURE * error) & (factor > _BRIGHTER * nearby)
    found = photo.near & (((tint > _TINTED) & tinted_as_print(photo, tint)) | brighter)
    if not photo.has_reference:
        found &= ~as_common_outside(photo)
    if found.sum() < _ENOUGH * photo.neighbourhood.expected:
        found |= darker_than_shadows(photo)
    return found


def refined_mask(
    mask: ViewMask, silhouette: np.ndarray, margin: float = MARGIN, normals: np.ndarray | None = None
) -> ViewMask:
    """The mask of the same photograph, looked for about a twin's silhouette (H, W) in 0..1; ``margin`` in mm.

    ``normals`` (H, W, 3) of its surface, carried on beyond its outlines, tell its dark sides.
    """
    if mask.photo is None or not mask.used:
        return mask
    photo = mask.photo
    pixels = max(2.0, margin * photo.neighbourhood.pixels_per_mm)
    blur = mask.blur or blur_about(photo, silhouette, pixels)
    half = half_width(silhouette)
    softness = blur / half if half > 0.0 else 0.0
    if half < THICK * blur:
        about = coverage_about(photo, silhouette, pixels, blur)
    elif blur > 0.0 and mask.blur == 0.0:  # what was seen out of focus is too far off to look about it
        return replace(
            photo_mask(refocused(photo, blur, GENTLE)), valid=mask.valid, photo=photo, blur=blur, softness=softness
        )
    elif blur > 0.0:
        about = coverage_about(refocused(photo, blur), silhouette, pixels, normals=normals)
        about = replace(about, share=blurred(about.share, EVENED))
    else:
        about = coverage_about(photo, silhouette, pixels, normals=normals)
    coverage, certain = about.share, about.certain
    if mask.valid is not None:
        known = mask.valid > 0.0
        coverage = np.where(known, coverage, silhouette).astype(np.float32)
        certain = np.where(known, certain, 0.0).astype(np.float32)
    told = float(certain[silhouette > 0.5].mean()) if (silhouette > 0.5).any() else 0.0
    reason = "" if told >= LEAST_TOLD else f"print and background look alike in it (only {told:.0%} can be told apart)"
    seen = replace(mask, coverage=coverage, valid=certain, blur=blur, softness=softness)
    return replace(seen, used=not reason, reason=reason)


def nothing_to_see(image: np.ndarray) -> str:
    """Why a photograph (H, W) or (H, W, 3) uint8 shows nothing at all; empty if it may show something."""
    low, high = (float(value) for value in np.quantile(image[::3, ::3], (0.002, 0.998)))
    if high - low >= LEAST_RANGE:
        return ""
    return "is black all over" if high < 32.0 else "is white all over" if low > 223.0 else "shows one even colour"
