"""Pictures as files in memory, for pages and exports."""

from __future__ import annotations

import cv2
import numpy as np


def jpeg(picture: np.ndarray, quality: int) -> bytes:
    """Encode a picture as JPEG.

    Parameters
    ----------
    picture : (H, W) or (H, W, 3) uint8 array
        Grey, or blue, green, red as OpenCV has it.
    quality : int
        0 to 100.

    Raises
    ------
    ValueError
        If it is of another type or shape.
    """
    return _encoded(picture, ".jpg", np.uint8, (cv2.IMWRITE_JPEG_QUALITY, quality))


def png_of_16_bits(picture: np.ndarray) -> bytes:
    """Encode (H, W) uint16 as PNG, without losses.

    Raises
    ------
    ValueError
        If it is of another type or shape.
    """
    return _encoded(picture, ".png", np.uint16)


def png_with_alpha(picture: np.ndarray) -> bytes:
    """Encode (H, W, 4) uint8, red, green, blue and opacity, as PNG.

    Raises
    ------
    ValueError
        If it is of another type or shape.
    """
    if picture.ndim != 3 or picture.shape[2] != 4:
        raise ValueError(f"a picture with opacity is (H, W, 4), not {picture.shape}")
    return _encoded(np.ascontiguousarray(picture[..., [2, 1, 0, 3]]), ".png", np.uint8)


def tiff_of_floats(picture: np.ndarray) -> bytes:
    """Encode (H, W) float32 as TIFF with every digit, infinity included.

    Raises
    ------
    ValueError
        If it is of another type or shape.
    """
    adobe_deflate = 8
    return _encoded(picture, ".tiff", np.float32, (cv2.IMWRITE_TIFF_COMPRESSION, adobe_deflate))


def _encoded(picture: np.ndarray, suffix: str, kind: type, options: tuple[int, ...] = ()) -> bytes:
    done, data = False, None
    if picture.dtype == kind and picture.size and picture.ndim in (2, 3):
        done, data = cv2.imencode(suffix, picture, list(options))
    if not done or data is None:
        raise ValueError(f"{picture.dtype} {picture.shape} cannot be written as {suffix[1:]}")
    return data.tobytes()
