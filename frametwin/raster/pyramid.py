"""The captured silhouettes at several sizes, blurred as the rods are."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from math import sqrt

import cv2
import numpy as np

from frametwin.cameras import Camera, packed

PIXEL_VARIANCE = 1.0 / 12.0
"""Of a square pixel, in pixels^2."""


SLIGHT = 0.7
"""Blur of a lens in pixels below which struts are blurred one by one, as they are drawn."""

SPARSE = 8
"""One row in so many is looked at for grey pixels: every outline has its share of them."""

KEPT = 0.5
"""Largest share of their size at which reduced pictures are kept; larger ones would fill the memory."""


@dataclass(frozen=True, eq=False)
class Level:
    """All views at one size and blur, in one flat buffer.

    Attributes
    ----------
    cameras : (N, 17) rows of `frametwin.cameras.packed` for this size, and the lens's k1 (0: it is undistorted).
    shapes : (N, 2) height and width.
    offsets : (N,) where each view starts.
    spread : s of the rods in pixels, sqrt(1/12 + blur^2).
    target : (pixels,) float32.
    lens : (N,) blur in pixels of this size that each picture had from its lens; ``None`` for sharp pictures.
    behind : (pixels,) float32 share of the background that is seen through struts that are not drawn anew here, before
        the lens has blurred them; ``None`` for none.
    kept : what was last drawn here, so that it need not be drawn again; see `frametwin.raster.rods`.
    """

    cameras: np.ndarray
    shapes: np.ndarray
    offsets: np.ndarray
    spread: float
    target: np.ndarray
    lens: np.ndarray | None = None
    behind: np.ndarray | None = None
    kept: dict[str, tuple[tuple[np.ndarray, ...], np.ndarray]] = field(init=False, repr=False, default_factory=dict)

    @property
    def spreads(self) -> np.ndarray:
        """(N,) spread in pixels of a rod's edge in each picture, the blur of its lens included."""
        return np.hypot(self.spread, self._lens)

    @property
    def drawn_spreads(self) -> np.ndarray:
        """(N,) the same of rods as they are drawn; what is left of the lens's blur is for `defocus`."""
        return np.hypot(self.spread, np.where(self._lens < SLIGHT, self._lens, 0.0))

    @property
    def _lens(self) -> np.ndarray:
        return np.zeros(len(self.shapes)) if self.lens is None else self.lens

    def defocus(self, through: np.ndarray) -> None:
        """Blur pictures of rods (pixels,) as the lenses have blurred those that they are held against, in place.

        What several struts cover together is blurred as a whole: blurred one by one and then blended, struts that
        cross or run close by each other would cover less.
        """
        for picture, blur in zip(self.pictures(through), self._lens, strict=True):
            if blur >= SLIGHT:
                cv2.GaussianBlur(picture, (0, 0), float(blur), dst=picture, borderType=cv2.BORDER_REPLICATE)

    def pictures(self, flat: np.ndarray) -> list[np.ndarray]:
        """A flat buffer as one (H, W) view a camera."""
        return [
            flat[start : start + height * width].reshape(height, width)
            for start, (height, width) in zip(self.offsets, self.shapes, strict=True)
        ]


@lru_cache(maxsize=256)
def _resized(camera: Camera, width: int, height: int) -> Camera:
    """The same for every moment of a stream, and checked once."""
    return camera.resized(width, height)


def _size(width: int, height: int, scale: float) -> tuple[int, int]:
    return max(1, round(width * scale)), max(1, round(height * scale))


def _of_size(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """A picture reduced by area."""
    same = mask.shape == (height, width)
    return mask if same else np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA))


def _as_reduced(mask: np.ndarray, scale: float) -> np.ndarray:
    reduced = _of_size(np.asarray(mask, dtype=np.float32), *_size(mask.shape[1], mask.shape[0], scale))
    return np.ascontiguousarray(reduced)


def _of_two_values(mask: np.ndarray) -> bool:
    rows = mask[::SPARSE]
    return bool(((rows == 0.0) | (rows == 1.0)).all())


class Pyramid:
    """Masks that are reduced by area and blurred on demand.

    Parameters
    ----------
    cameras
        Without lens distortion.
    masks
        One (H, W) picture a camera, 0..1, of the camera's size.
    lens
        Blur of each picture by its lens, standard deviation in pixels; none by default.
    largest
        Scale of the largest pictures that will be asked for. Only these are kept.

    Attributes
    ----------
    black_and_white : bool
        Whether the pictures are sharp, with pixels of 0 and 1 alone, before they are reduced.
    """

    def __init__(
        self,
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        lens: Sequence[float] | np.ndarray | None = None,
        largest: float = 1.0,
    ) -> None:
        self.cameras = tuple(cameras)
        self.lens = None if lens is None else np.asarray(lens, dtype=np.float64)
        self.black_and_white = (self.lens is None or not self.lens.any()) and all(map(_of_two_values, masks))
        self.largest = largest
        self.masks = tuple(_as_reduced(mask, largest) for mask in masks)
        self._last: tuple[float, tuple[list[Camera], list[np.ndarray]]] = (0.0, ([], []))

    def of_views(self, chosen: np.ndarray) -> Pyramid:
        """That of some of the views alone."""
        part = copy(self)
        part.cameras, part.masks = (tuple(kept[i] for i in chosen) for kept in (self.cameras, self.masks))
        part.lens = None if self.lens is None else self.lens[chosen]
        part._last = (0.0, ([], []))
        return part

    def level(self, scale: float, blur: float) -> Level:
        """The views at ``scale`` of their size, blurred by ``blur`` pixels of that size.

        Below half a pixel OpenCV's sampled kernel is narrower than the Gaussian it stands for (variance 0.008 for a
        blur of 0.3), so there the rods stay a little softer than the target; matching the two exactly brought the
        fit no nearer to the truth.
        """
        cameras, pictures = self._reduced(scale)
        if blur > 0.0:
            pictures = [
                cv2.GaussianBlur(picture, (0, 0), blur, borderType=cv2.BORDER_REPLICATE) for picture in pictures
            ]
        shapes = np.array([picture.shape for picture in pictures], dtype=np.int64)
        return Level(
            cameras=np.pad(packed(cameras), ((0, 0), (0, 1))),
            shapes=shapes,
            offsets=np.concatenate([[0], np.cumsum(shapes.prod(axis=1))[:-1]]),
            spread=sqrt(PIXEL_VARIANCE + blur * blur),
            target=np.concatenate([picture.ravel() for picture in pictures]).astype(np.float32, copy=False),
            lens=None if self.lens is None else scale * self.lens,
        )

    def _reduced(self, scale: float) -> tuple[list[Camera], list[np.ndarray]]:
        """The views at ``scale`` of their size. The last small ones are kept, for they are wanted with other blurs."""
        if scale == self._last[0]:
            return self._last[1]
        cameras, pictures = [], []
        for camera, mask in zip(self.cameras, self.masks, strict=True):
            width, height = _size(camera.width, camera.height, scale)
            cameras.append(_resized(camera, width, height))
            pictures.append(_of_size(mask, width, height))
        if scale <= KEPT:
            self._last = (scale, (cameras, pictures))
        return cameras, pictures

    def pixels_per_mm(self, point: np.ndarray, scale: float = 1.0) -> float:
        """Mean over the views of how many pixels a millimetre at the point (3,) covers."""
        focal = np.array([0.5 * (c.fl_x + c.fl_y) / np.linalg.norm(c.centre - point) for c in self.cameras])
        return float(scale * focal.mean())
