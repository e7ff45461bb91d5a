"""Pictures of lenses that distort, resampled from a pinhole camera's wider picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frametwin.cameras.camera import PERSPECTIVE, Camera
from frametwin.errors import InputError

GRID = 1.0 / 400.0
"""Focal lengths between the places at which the lens is inverted; linear in between, which is right to 0.005 px."""

WIDEST_DEG = 75.0
"""Angle off the axis up to which a flat picture is made; its size grows with the tangent."""

LARGEST_AREA = 24.0
"""Of the pinhole camera's picture, in areas of the picture that is wanted."""

EDGE = 2
"""Pixels that the pinhole camera sees beyond the lens on every side."""


@dataclass(frozen=True, eq=False)
class LensWarp:
    """Where each pixel of a lens lies in the picture of a pinhole camera at the same place.

    Attributes
    ----------
    pinhole : camera without distortion that sees all that the lens sees.
    columns, rows : (H, W) float32 array, px
        Place in the pinhole camera's picture that each pixel's centre sees; pixel centres at +0.5.
    """

    pinhole: Camera
    columns: NDArray[np.float32]
    rows: NDArray[np.float32]

    def nearest(self, picture: np.ndarray) -> np.ndarray:
        """The picture (h, w, ...) of the pinhole camera as the lens sees it, every value one that is there."""
        return np.asarray(picture[self.rows.astype(np.intp), self.columns.astype(np.intp)])

    def linear(self, picture: np.ndarray) -> np.ndarray:
        """The picture (h, w, C) of the pinhole camera as the lens sees it, linear between pixel centres, float32."""
        height, width = picture.shape[:2]
        x, y = self.columns - np.float32(0.5), self.rows - np.float32(0.5)
        left = np.clip(x.astype(np.intp), 0, width - 2)
        top = np.clip(y.astype(np.intp), 0, height - 2)
        across, down = (x - left)[..., None], (y - top)[..., None]
        upper = picture[top, left] * (1.0 - across) + picture[top, left + 1] * across
        lower = picture[top + 1, left] * (1.0 - across) + picture[top + 1, left + 1] * across
        return np.asarray(upper * (1.0 - down) + lower * down, dtype=np.float32)


def lens_warp(camera: Camera, finer: float = 1.0) -> LensWarp:
    """How to make the picture of a lens from a pinhole camera's.

    Parameters
    ----------
    camera
        With distortion, or without.
    finer
        How many times as fine as the lens's own the pinhole picture is, along each side.

    Raises
    ------
    InputError
        If the lens has no inverse somewhere in its picture, or sees too far to the side for a flat picture.
    """
    where = f"camera {camera.name}"
    nodes_x, nodes_y = _nodes(camera.width, camera.fl_x), _nodes(camera.height, camera.fl_y)
    pixels = np.stack(np.meshgrid(nodes_x, nodes_y), axis=-1)  # (h, w, 2)
    plane = camera.undistort((pixels - (camera.cx, camera.cy)) / (camera.fl_x, camera.fl_y))
    if not np.isfinite(plane).all():
        problem = "has no inverse everywhere in its picture"
        raise InputError.at(where, "distortion", problem, "give weaker coefficients, or a longer focal length")
    if np.linalg.norm(plane, axis=-1).max() > np.tan(np.radians(WIDEST_DEG)):
        problem = f"sees more than {WIDEST_DEG:g} degrees off its axis, too much for a flat picture"
        raise InputError.at(where, "fl_x", problem, "give a longer focal length")
    density = finer * _stretch(plane, camera)
    focal = np.array([camera.fl_x, camera.fl_y]) * density
    low = np.floor((plane * focal).min(axis=(0, 1))) - EDGE
    high = np.ceil((plane * focal).max(axis=(0, 1))) + EDGE
    width, height = (high - low).astype(int).tolist()
    if width * height > LARGEST_AREA * density**2 * camera.width * camera.height:
        raise InputError.at(where, "distortion", "needs too large a flat picture", "give a longer focal length")
    pinhole = replace(
        camera,
        width=width,
        height=height,
        fl_x=focal[0],
        fl_y=focal[1],
        cx=-low[0],
        cy=-low[1],
        distortion=np.zeros(5),
        model=PERSPECTIVE,
        covariance=None,
    )
    places = plane * focal - low
    across, down = _weights(nodes_x, camera.width), _weights(nodes_y, camera.height)
    columns, rows = (_between(places[..., axis], across, down) for axis in (0, 1))
    return LensWarp(pinhole, columns, rows)


def _nodes(side: int, focal: float) -> np.ndarray:
    """Places along a side of the picture at which the lens is inverted, its ends among them."""
    return np.linspace(0.0, side, max(2, int(np.ceil(side / (GRID * focal))) + 1))


def _stretch(plane: np.ndarray, camera: Camera) -> float:
    """How many times as fine as its middle the lens is where it is finest, 1 to 2."""
    steps_x = np.linalg.norm(np.diff(plane, axis=1), axis=-1).min() * (plane.shape[1] - 1) / camera.width
    steps_y = np.linalg.norm(np.diff(plane, axis=0), axis=-1).min() * (plane.shape[0] - 1) / camera.height
    return float(np.clip(1.0 / min(steps_x * camera.fl_x, steps_y * camera.fl_y), 1.0, 2.0))


def _weights(nodes: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Node before every pixel centre of a side, and how far it is on to the next, 0 to 1."""
    place = (np.arange(side) + 0.5) / (nodes[1] - nodes[0])
    before = np.minimum(place.astype(np.intp), len(nodes) - 2)
    return before, (place - before).astype(np.float64)


def _between(values: np.ndarray, across: tuple, down: tuple) -> NDArray[np.float32]:
    """Values (h, w) at the nodes, at every pixel centre (H, W)."""
    (left, x), (top, y) = across, down
    rows = values[top] * (1.0 - y[:, None]) + values[top + 1] * y[:, None]
    return np.asarray(rows[:, left] * (1.0 - x) + rows[:, left + 1] * x, dtype=np.float32)
