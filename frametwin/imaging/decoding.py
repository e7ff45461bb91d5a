"""The pixels of a picture file, as OpenCV decodes them."""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike


def decoded(data: bytes, path: PathLike, remedy: str = "save it again, as PNG or JPEG") -> np.ndarray:
    """Decode a picture as it is stored.

    Parameters
    ----------
    data
        The bytes of the file.
    path
        What to call it in messages.
    remedy
        What to do about a damaged one.

    Returns
    -------
    pixels : (H, W), (H, W, 3) or (H, W, 4) array, uint8 or uint16
        Channels in OpenCV's order: blue, green, red, opacity.

    Raises
    ------
    InputError
        If it cannot be decoded.
    """
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None:
        raise InputError.at(path, "image", "the picture is damaged", remedy)
    return np.asarray(image)


def eight_bits(image: np.ndarray) -> np.ndarray:
    """The same picture with 8 bits a channel: of 16 the upper ones, so that white stays white."""
    return image if image.dtype == np.uint8 else (image // 257).astype(np.uint8)
