"""From pictures to masks: photo binarisation, background removal, undistortion."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.camera import FISHEYE
from frametwin.capture.capture import Capture, View
from frametwin.capture.picture import Picture
from frametwin.errors import InputError
from frametwin.imaging.decoding import decoded, eight_bits
from frametwin.progress import Progress, ProgressCallback, report

PHOTO_THRESHOLD = 120
"""Lambda of the paper's section V.B: the brightness above which a pixel is a strut, of 255."""

BACKGROUND_DIFFERENCE = 30
"""Smallest change of a channel, of 255, by which a pixel is told from the view before printing."""

_LEAST_CONTENT = 1e-5  # share of the pixels that must belong to the frame
_WHITE_BORDER = 0.9  # share of white border pixels above which the background is taken to be white


def read_masks(capture: Capture, progress: ProgressCallback | None = None) -> list[np.ndarray]:
    """Give all views as undistorted masks, 1 where the print is.

    A picture is a mask if it has one channel and no background picture, or if it is grey and nearly all
    black and white; grey values at the edges (anti-aliasing) are kept. Everything else is a photo: see
    `binarise_photo`.

    Parameters
    ----------
    capture
        The capture.
    progress
        Called after each view.

    Returns
    -------
    masks
        (H, W) float32 in 0..1 for each view. They belong to ``view.camera.without_distortion()``.

    Raises
    ------
    InputError
        If a picture cannot be decoded, has another size than its camera, shows nothing, or is white all
        around.
    Cancelled
        If ``progress`` says so.
    """
    masks = []
    for i, view in enumerate(capture.views):
        mask = _read_mask(view)
        check_content(mask, view.image.path)
        straight = undistort(mask, view.camera)
        if straight is not mask and not (straight > 0.5).any():
            raise InputError.at(
                view.image.path,
                "distortion",
                "nothing is left when the distortion of its lens is removed",
                "calibrate the camera again",
            )
        masks.append(straight)
        report(progress, Progress("reading images", i + 1, len(capture.views)))
    return masks


def _read_mask(view: View) -> np.ndarray:
    image = decode(view.image, view.camera)
    if view.background is not None:
        return binarise_photo(image, decode(view.background, view.camera))
    mask = mask_itself(image)
    return binarise_photo(image, None) if mask is None else mask


def mask_itself(image: np.ndarray) -> np.ndarray | None:
    """The mask (H, W) float32 that a picture (H, W) or (H, W, 3) uint8 is already; ``None`` if it is a photo."""
    grey = image if image.ndim == 2 else image[..., 0]
    if image.ndim == 3 and not (image == grey[..., None]).all():
        return None
    values = np.flatnonzero(cv2.calcHist([np.ascontiguousarray(grey)], [0], None, [256], [0.0, 256.0]))
    if len(values) == 2:  # be they 0 and 1 or 0 and 255
        return (grey == values[1]).astype(np.float32)
    if image.ndim == 2 or _is_grey_mask(grey):
        return grey.astype(np.float32) / 255.0
    return None


def _is_grey_mask(grey: np.ndarray) -> bool:
    """True if a grey picture with three channels is a mask with anti-aliased edges and not a photo."""
    black, white = np.mean(grey == 0), np.mean(grey == 255)
    return bool(black + white >= 0.9 and white >= 0.5 * (1.0 - black))


def binarise_photo(
    image: np.ndarray,
    background: np.ndarray | None = None,
    threshold: int = PHOTO_THRESHOLD,
    difference: int = BACKGROUND_DIFFERENCE,
) -> np.ndarray:
    """Find the bright, colourless struts in a photo (paper, section V.B).

    A pixel is a strut if it differs from the background picture, all its channels are above ``threshold``,
    and any two of them differ by less than half of that.

    Parameters
    ----------
    image
        (H, W) or (H, W, 3) uint8; the order of the channels does not matter.
    background
        The same view before printing, of the same height and width.
    threshold
        The paper's lambda.
    difference
        Least change of any channel against the background.

    Returns
    -------
    mask
        (H, W) float32, 0 or 1.

    Raises
    ------
    ValueError
        If the two pictures differ in size.
    """
    channels = image.reshape(*image.shape[:2], -1)
    low, high = channels.min(axis=2), channels.max(axis=2)
    strut = (low > threshold) & ((high - low) < threshold / 2.0)
    if background is not None:
        before = background.reshape(*background.shape[:2], -1)
        if before.shape[:2] != channels.shape[:2]:
            raise ValueError(f"the photo is {channels.shape[:2]}, its background {before.shape[:2]}")
        change = np.abs(channels.astype(np.int16) - before.astype(np.int16)).max(axis=2)
        strut &= change >= difference
    return strut.astype(np.float32)


def undistort(mask: np.ndarray, camera: Camera) -> np.ndarray:
    """Resample a picture (H, W) to what ``camera.without_distortion()`` sees; black where it sees more."""
    if not camera.has_distortion:
        return mask
    size = (camera.width, camera.height)
    matrix = camera.K_opencv
    rectify = cv2.fisheye.initUndistortRectifyMap if camera.model == FISHEYE else cv2.initUndistortRectifyMap
    column, row = rectify(matrix, camera.distortion, np.eye(3), matrix, size, cv2.CV_32FC1)
    return np.asarray(
        cv2.remap(mask, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    )


def decode(picture: Picture, camera: Camera) -> np.ndarray:
    """Decode the picture of a camera as (H, W) or (H, W, 3) uint8; transparent pixels become black."""
    image = eight_bits(decoded(picture.data, picture.path))
    if image.shape[:2] != (camera.height, camera.width):
        raise InputError.at(
            picture.path,
            "size",
            f"is {image.shape[1]} x {image.shape[0]} pixels where its camera has {camera.width} x {camera.height}",
            "give the picture as it was taken, or calibrate again",
        )
    if image.ndim == 3 and image.shape[2] == 4:
        share = image[..., 3:].astype(np.float32) / 255.0
        image = (image[..., :3] * share).round().astype(np.uint8)
    return image[..., 0] if image.ndim == 3 and image.shape[2] == 1 else image


def check_content(mask: np.ndarray, path: Path) -> None:
    """Refuse a mask (H, W) in 0..1 that cannot show a print.

    Raises
    ------
    InputError
        If so; see `content_problem`.
    """
    problem, remedy = content_problem(mask)
    if problem:
        raise InputError.at(path, "image", problem, remedy)


def content_problem(mask: np.ndarray) -> tuple[str, str]:
    """Why a mask (H, W) in 0..1 cannot show a print, and what to do about it; empty if it can."""
    remedy = "give a picture of the print: bright struts on a dark background, or a mask of them"
    share = np.count_nonzero(mask > 0.5) / mask.size
    if share < _LEAST_CONTENT:
        return "shows nothing of the print (all black)", remedy
    if share == 1.0:
        return "is white all over", remedy
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    if np.mean(border > 0.5) > _WHITE_BORDER:
        return "has a white background", f"invert it, or {remedy}"
    return "", ""
