"""Photographs of round struts under one lamp, painted by the laws of light: the share of every pixel is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import ring_rig
from frametwin.capture.capture import Capture, read_capture, write_capture
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.neighbourhood import Neighbourhood
from frametwin.raster.silhouette import silhouettes

BLUE = (0.04, 0.1, 0.3)
WHITE, GREY, DARK, ORANGE = (0.8, 0.8, 0.78), (0.3, 0.3, 0.3), (0.012, 0.012, 0.013), (0.7, 0.2, 0.03)


def codes(light: np.ndarray, noise: float = 1.0, seed: int = 0) -> np.ndarray:
    """The picture (H, W, 3) uint8 of linear light, after the curve of sRGB, with noise in steps of 255."""
    light = np.clip(light, 0.0, 1.0)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    noisy = 255.0 * curve + np.random.default_rng(seed).normal(0.0, noise, light.shape)
    return np.clip(np.rint(noisy), 0.0, 255.0).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Strut:
    """One upright strut before a table, as seen by a still camera.

    Attributes
    ----------
    image, reference : (H, W, 3) uint8.
    coverage : (H, W) exact shares.
    where : all of the picture but its sides.
    """

    image: np.ndarray
    reference: np.ndarray
    coverage: np.ndarray
    where: Neighbourhood

    @property
    def width(self) -> float:
        """Of the strut in pixels."""
        return float(self.coverage[0].sum())


def strut_photo(
    material: tuple[float, ...] = WHITE,
    table: tuple[float, ...] = BLUE,
    *,
    dark_side: float = 0.15,
    radius: float = 5.0,
    exposure: float = 1.0,
    shadow: float = 1.0,
) -> Strut:
    """A cylinder lit from the left: Lambert's law on one side, ``dark_side`` of the light on the other.

    ``shadow`` is the factor of light on a band of the table, 12 to 20 pixels to the right of the strut.
    """
    height, width, fine = 60, 120, 16
    x = (np.arange(width * fine) + 0.5) / fine - 60.3
    across = x / radius
    normal = np.sqrt(np.clip(1.0 - across**2, 0.0, 1.0))
    lit = dark_side + (1.0 - dark_side) * np.clip(0.6 * normal - 0.8 * across, 0.0, 1.0)
    ground = np.where((x > 12.0) & (x < 20.0), shadow, 1.0)[:, None] * np.array(table)
    inside = np.abs(across) < 1.0
    row = np.where(inside[:, None], lit[:, None] * np.array(material), ground)
    shares = inside.reshape(width, fine).mean(axis=1)
    light = np.broadcast_to(row.reshape(width, fine, 3).mean(axis=1), (height, width, 3))
    near = np.zeros((height, width), dtype=bool)
    near[:, 25:95] = True
    where = Neighbourhood(near, 4.0, int(2 * radius * height))
    before = np.broadcast_to(np.array(table), (height, width, 3))
    return Strut(
        codes(exposure * light, seed=1),
        codes(before, seed=2),
        np.broadcast_to(shares, (height, width)).astype(np.float32),
        where,
    )


def shift_of(mask: np.ndarray, strut: Strut) -> float:
    """How far the middle of a mask is from that of the strut, in pixels."""
    x = np.arange(mask.shape[1])
    return float((mask * x).sum() / mask.sum() - (strut.coverage * x).sum() / strut.coverage.sum())


def frame_photos(
    frame: Wireframe, count: int, size: tuple[int, int] = (120, 160)
) -> tuple[tuple[Camera, ...], list[np.ndarray], list[np.ndarray]]:
    """Cameras around a frame, white on blue, and the pictures (H, W, 3) uint8 with and without it."""
    cameras = ring_rig(frame, count, size=size)
    shares = [picture[..., None] / 255.0 for picture in silhouettes(frame, cameras, supersampling=4)]
    images = [codes(a * np.array(WHITE) * 0.8 + (1.0 - a) * np.array(BLUE), seed=i) for i, a in enumerate(shares)]
    before = [codes(np.zeros_like(a) + np.array(BLUE), seed=100 + i) for i, a in enumerate(shares)]
    return cameras, images, before


def photo_capture(folder: object, frame: Wireframe, count: int, black: tuple[int, ...] = ()) -> Capture:
    """A capture of such photographs with references; the pictures ``black`` show nothing."""
    cameras, images, before = frame_photos(frame, count)
    for i in black:
        images[i] = np.zeros_like(images[i])
    write_capture(folder, frame, cameras, images, backgrounds=before)  # type: ignore[arg-type]
    return read_capture(folder)  # type: ignore[arg-type]
