"""Pictures of a stream, reduced to what following needs before anything else is done with them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.errors import InputError
from frametwin.imaging.masks import binarise_photo, mask_itself, undistort

WORKERS = 2

UNLIT = 24
"""Grey value below which all of a picture is darkness and its noise, of which nothing can be told, not even whether
the camera gives masks."""


class Reducer:
    """Makes masks (H, W) float32 of reduced size, without lens distortion, from pictures as cameras give them.

    Whether a camera gives masks or photographs is seen from the first picture that is not all dark. Photographs need
    the view before printing: what differs from it, is bright and has no colour is print (paper, section V.B).

    Parameters
    ----------
    cameras : sequence of Camera
    scale : float, 0..1
        Share of each picture's width and height that is kept.
    backgrounds : sequence of (H, W) or (H, W, 3) array of uint8 or None, optional
        The views before printing.

    Attributes
    ----------
    cameras : tuple of Camera
        Of the masks.
    """

    def __init__(
        self, cameras: Sequence[Camera], scale: float, backgrounds: Sequence[np.ndarray | None] | None = None
    ) -> None:
        self._full = tuple(cameras)
        self._lens = tuple(
            camera.resized(max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))
            for camera in cameras
        )
        self.cameras = tuple(camera.without_distortion() for camera in self._lens)
        given = [None] * len(self._full) if backgrounds is None else list(backgrounds)
        self._backgrounds = [
            None if picture is None else self._reduced(i, picture, f"background of {self._full[i].name}")
            for i, picture in enumerate(given)
        ]
        self._is_mask: list[bool | None] = [None] * len(self._full)
        self._pool = ThreadPoolExecutor(WORKERS)

    def masks(self, pictures: Sequence[np.ndarray | None], sources: Sequence[str] = ()) -> list[np.ndarray | None]:
        """Masks of the pictures of one moment, ``None`` where a camera gave none.

        Parameters
        ----------
        pictures : sequence of (H, W) or (H, W, 3) array of uint8 or None
            One a camera.
        sources : sequence of str, optional
            What each is called in errors; by default as its camera.

        Raises
        ------
        InputError
            If there is not one entry a camera, or a picture has not its camera's size.
        """
        if len(pictures) != len(self._full):
            problem = f"holds {len(pictures)} pictures for {len(self._full)} cameras"
            raise InputError.at("stream", "pictures", problem, "give one for each camera, None where there is none")
        names = sources or [camera.name for camera in self._full]
        return list(self._pool.map(self._mask, range(len(pictures)), pictures, names))

    def _mask(self, view: int, picture: np.ndarray | None, source: str) -> np.ndarray | None:
        if picture is None:
            return None
        small = self._reduced(view, picture, source)
        background = self._backgrounds[view]
        white = float(picture.max())
        if white < UNLIT and len(np.unique(picture)) != 2:  # a mask may well be of zeros and ones
            return np.zeros(small.shape[:2], dtype=np.float32)
        if self._is_mask[view] is None:
            self._is_mask[view] = background is None and mask_itself(picture) is not None
        if self._is_mask[view]:
            grey = small if small.ndim == 2 else small[..., 0]
            mask = grey.astype(np.float32) * np.float32(1.0 / max(white, 1.0))
        else:
            mask = binarise_photo(small, background)
        return undistort(mask, self._lens[view])

    def _reduced(self, view: int, picture: np.ndarray, source: str) -> np.ndarray:
        camera, lens = self._full[view], self._lens[view]
        require_size(picture, camera, source)
        if (lens.width, lens.height) == (camera.width, camera.height):
            return picture
        # Zeros and ones would be rounded away.
        plain = picture * np.uint8(255) if picture.max(initial=0) == 1 else picture
        return np.asarray(cv2.resize(plain, (lens.width, lens.height), interpolation=cv2.INTER_AREA))


def require_size(picture: np.ndarray, camera: Camera, source: str) -> None:
    """Refuse a picture (H, W) or (H, W, 3) that has not its camera's size.

    Raises
    ------
    InputError
        It names ``source``, the picture's file or what else it is known by.
    """
    if picture.shape[:2] != (camera.height, camera.width):
        problem = f"is {picture.shape[1]} x {picture.shape[0]} pixels"
        remedy = f"give pictures of {camera.width} x {camera.height} pixels, or calibrate again"
        raise InputError.at(source, "size", problem, remedy)
