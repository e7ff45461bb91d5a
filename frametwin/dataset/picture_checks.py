"""Whether the pictures of a sample show its truth: exposed as they should be, and right to a pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture, View
from frametwin.capture.picture import Picture
from frametwin.dataset.contrast_checks import contrast_problems, is_hard, is_indistinct
from frametwin.dataset.true_curves import TrueCurves
from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.decoding import decoded, eight_bits
from frametwin.imaging.masks import read_masks
from frametwin.raster.silhouette import silhouettes

LEAST_WHITE, MOST_WHITE = 1e-4, 0.9
"""Share of a mask that belongs to the print."""

MOST_CLIPPED = 0.02
"""Share of a photo that may be as bright as the sensor can tell."""

LEAST_BRIGHT = 64
"""Of 255: a photo whose brightest pixels are darker than this is black."""

LEAST_BACKGROUND = 12
"""The same of the view before printing, where there may be nothing but a dark table."""


@dataclass(frozen=True)
class Tolerance:
    """Shares by which a picture may differ from the exact silhouettes, beyond one pixel at the edges.

    Attributes
    ----------
    stray : white pixels that are beside every strut.
    hole : pixels inside of a strut that are not white.
    centreline : samples of the centrelines that are not white.
    """

    stray: float
    hole: float
    centreline: float


MASK = Tolerance(stray=0.001, hole=0.001, centreline=0.001)
PHOTO = Tolerance(stray=0.01, hole=0.15, centreline=0.15)
"""In photos the sides that the light does not reach are too dark for a mask; what is bright must be a strut."""

LONE = 5
"""So many wrong pixels a picture are forgiven: in a gap between struts that is narrower than a pixel, hundredths of
one decide whether its centre is black, and nothing around it tells that it is an edge."""

_PIXEL = np.ones((3, 3), dtype=np.uint8)


def check_pictures(
    capture: Capture, truth: Wireframe, curves: TrueCurves, look: Mapping[str, Any] | None = None
) -> list[str]:
    """Compare every picture with the true curves.

    Parameters
    ----------
    capture
        The sample.
    truth
        Its truth, with what is printed.
    curves
        Samples of the truth, with the real radius.
    look
        Of photos, as the sample notes it: those that the paper's rule is not made for are compared by contrast.

    Returns
    -------
    What is wrong, in words.
    """
    problems = []
    hard = look is not None and is_hard(look)
    for view in capture.views:
        name = capture.name_of(view.image)
        exposure = exposure_problems(view, capture.root, LEAST_BACKGROUND if hard else LEAST_BRIGHT)
        if exposure:
            problems += exposure
            continue
        if hard and look is not None and view.background is not None:
            if not is_indistinct(look):
                (exact,) = _exact(truth, [view.camera.without_distortion()], curves)
                problems += [f"{name}: {text}" for text in contrast_problems(view, exact)]
            continue
        try:
            (mask,) = read_masks(replace(capture, views=(view,)))
        except InputError as error:
            problems.append(str(error))
            continue
        camera = view.camera.without_distortion()
        tolerance = PHOTO if is_photo(view) else MASK
        problems += [f"{name}: {text}" for text in mask_problems(mask > 0.5, camera, truth, curves, tolerance)]
    return problems


def is_photo(view: View) -> bool:
    """Whether a view is a photo, not a mask: it has a background, or colours."""
    if view.background is not None:
        return True
    try:
        image = _pixels(view.image)
    except InputError:
        return False
    return image.ndim == 3 and bool((image != image[..., :1]).any())


def exposure_problems(view: View, root: Path, bright: int = LEAST_BRIGHT) -> list[str]:
    """Whether the picture of a view, and its background, are neither black nor saturated.

    ``bright`` is what the brightest pixels of a photo of the print have at least, of 255.
    """
    problems = []
    photo = is_photo(view)
    for picture in view.pictures:
        name = picture.path.relative_to(root).as_posix()
        try:
            image = _pixels(picture)
        except InputError:
            problems.append(f"{name} cannot be decoded")
            continue
        grey = image if image.ndim == 2 else image[..., :3].max(axis=2)
        least = bright if picture is view.image else LEAST_BACKGROUND
        problems += [f"{name} {text}" for text in (_photo_problems(grey, least) if photo else _mask_problems(grey))]
    return problems


def _mask_problems(grey: np.ndarray) -> list[str]:
    white = float(np.mean(grey > 127))
    if white < LEAST_WHITE:
        return [f"is black ({white:.2%} of it is white)"]
    return [f"is saturated ({white:.0%} of it is white)"] if white > MOST_WHITE else []


def _photo_problems(grey: np.ndarray, least: int) -> list[str]:
    if np.percentile(grey, 99.5) < least and grey.max() < 2 * least:
        return [f"is black (its brightest pixel is {int(grey.max())} of 255)"]
    clipped = float(np.mean(grey == 255))
    return [f"is saturated ({clipped:.0%} of it is clipped)"] if clipped > MOST_CLIPPED else []


def _pixels(picture: Picture) -> np.ndarray:
    return eight_bits(decoded(picture.data, picture.path))


def mask_problems(
    white: np.ndarray, camera: Camera, truth: Wireframe, curves: TrueCurves, tolerance: Tolerance
) -> list[str]:
    """Compare a mask (H, W) bool with the exact silhouettes of the truth, seen by a camera without distortion.

    White pixels belong within a pixel of the outline, and everything more than a pixel inside of it is white.
    """
    exact = _exact(truth, [camera], curves)[0]
    stray = white & (cv2.dilate(exact, _PIXEL) == 0)
    inner = cv2.erode(exact, _PIXEL) > 0
    hole = inner & ~white
    problems = []
    share = np.count_nonzero(stray) / max(1, int(np.count_nonzero(white)))
    if share > tolerance.stray and np.count_nonzero(stray) > LONE:
        problems.append(f"{share:.1%} of its white pixels lie more than a pixel beside the true struts{_where(stray)}")
    share = np.count_nonzero(hole) / max(1, int(np.count_nonzero(inner)))
    if share > tolerance.hole and np.count_nonzero(hole) > LONE:
        problems.append(f"{share:.1%} of the true struts' inside is not white{_where(hole)}")
    problems += _centreline_problems(white, camera, curves, tolerance)
    return problems


def _exact(truth: Wireframe, cameras: Sequence[Camera], curves: TrueCurves) -> list[np.ndarray]:
    return silhouettes(truth, cameras, present=curves.intervals, thickness=curves.radius)


def _where(wrong: np.ndarray) -> str:
    row, column = (int(round(float(values.mean()))) for values in np.nonzero(wrong))
    return f", around column {column} and row {row}"


def _centreline_problems(white: np.ndarray, camera: Camera, curves: TrueCurves, tolerance: Tolerance) -> list[str]:
    """Whether the centrelines are white, or have a white pixel beside them."""
    pixels, depth = camera.project(curves.points, distort=False)
    height, width = white.shape
    with np.errstate(invalid="ignore"):
        column, row = np.moveaxis(np.floor(pixels), -1, 0)
        seen = curves.present & (depth > 0.0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    if not seen.any():
        return ["none of the true struts is inside of the picture"]
    near = cv2.dilate(white.astype(np.uint8), _PIXEL)
    strut = np.broadcast_to(np.arange(len(seen))[:, None], seen.shape)[seen]
    dark = near[row[seen].astype(int), column[seen].astype(int)] == 0
    share = float(dark.mean())
    if share <= tolerance.centreline:
        return []
    worst = int(np.bincount(strut[dark]).argmax())
    return [f"{share:.1%} of the true centrelines are not white, most of strut {worst}"]
