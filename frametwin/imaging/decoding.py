"""The pixels of pictures."""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.capture.picture import Picture
from frametwin.errors import InputError


def decode(picture: Picture) -> np.ndarray:
    """Decode a picture to 8 bits a channel; transparent pixels become black.

    Returns
    -------
    (H, W) or (H, W, 3) array of uint8
        Blue, green, red.

    Raises
    ------
    InputError
        If it cannot be decoded.
    """
    image = cv2.imdecode(np.frombuffer(picture.data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError.at(picture.path, "image", "the picture is damaged", "save it again, as PNG or JPEG")
    if image.dtype != np.uint8:
        image = (image // 257).astype(np.uint8)  # 16 bits a channel
    if image.ndim == 3 and image.shape[2] == 4:
        share = image[..., 3:].astype(np.float32) / 255.0
        image = (image[..., :3] * share).round().astype(np.uint8)
    return image[..., 0] if image.ndim == 3 and image.shape[2] == 1 else image
