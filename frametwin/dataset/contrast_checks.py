"""Whether photographs that vary show the truth: print differs from the picture without it where the true struts are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from frametwin.capture.views import View
from frametwin.imaging.masks import decode, undistort

LEAST_CONTRAST = 0.15
"""Difference of the reflectances of print and table below which a photograph need not show the print to this check."""

LEAST_BRIGHT = 0.3
"""Reflectance in every colour from which on a print is as white as the paper's rule wants it."""

RING = (3, 10)
"""Pixels beside the struts between which their surroundings are looked at."""

LEAST_SHARE = 0.5
"""Of the struts' inside that has to differ more than nearly all of its surroundings do."""

USUAL, LEAST_CHANGE = 90.0, 8.0
"""Percentile of the surroundings that counts as nearly all, and the least difference that counts, of 255."""


def is_hard(look: Mapping[str, Any]) -> bool:
    """Whether photographs of a look are not what the paper's rule is made for."""
    colour = look.get("strut_colour", (1.0,))
    moved = any(look.get(name) for name in ("clutter", "reference_exposure", "reference_turn", "view_exposures"))
    light = max(look.get("table_colour", (0.0,))) > LEAST_BRIGHT
    return min(colour) < LEAST_BRIGHT or bool(moved) or light


def is_indistinct(look: Mapping[str, Any]) -> bool:
    """Whether print and table are so alike that a photograph tells them apart by shading alone."""
    pairs = zip(look.get("strut_colour", (1.0,)), look.get("table_colour", (0.0,)), strict=False)
    return max(abs(one - other) for one, other in pairs) < LEAST_CONTRAST


def contrast_problems(view: View, exact: np.ndarray) -> list[str]:
    """Compare a photograph with its background where the struts are and beside them.

    Parameters
    ----------
    view
        With a background.
    exact : (H, W) uint8 array
        Exact silhouettes as the camera without distortion sees them.
    """
    assert view.background is not None
    image, before = (
        np.stack([undistort(channel, view.camera) for channel in np.moveaxis(_colours(picture, view), -1, 0)], axis=-1)
        for picture in (view.image, view.background)
    )
    near, far = (cv2.dilate(exact, np.ones((2 * reach + 1,) * 2, np.uint8)) > 0 for reach in RING)
    ring, inside = far & ~near, cv2.erode(exact, np.ones((3, 3), np.uint8)) > 0
    if not (ring.any() and inside.any()):
        return []
    lit = ring & (before.max(axis=2) > LEAST_CHANGE)
    gain = float(np.median(image[lit].sum(axis=1) / before[lit].sum(axis=1))) if lit.any() else 1.0
    change = np.abs(image - gain * before).max(axis=2)
    usual = max(float(np.percentile(change[ring], USUAL)), LEAST_CHANGE)
    share = float(np.mean(change[inside] > usual))
    if share >= LEAST_SHARE:
        return []
    return [f"only {share:.0%} of the true struts' inside differ from the background more than what is beside them"]


def _colours(picture: Any, view: View) -> np.ndarray:
    image = decode(picture, view.camera).astype(np.float32)
    return image if image.ndim == 3 else image[..., None]
