"""Pictures that show plan, truth and twin over what the cameras saw.

Colours follow Okabe and Ito, "Color universal design", 2008, and are told apart by people of every kind of colour
vision. The lines are nested: the truth is the widest and lowest, the twin the thinnest and on top, so that all
three can be seen where they coincide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.geometry import bezier

Colour = tuple[int, int, int]

PLAN: Colour = (0, 114, 178)  # blue
TRUTH: Colour = (90, 200, 165)  # bluish green, lightened
TWIN: Colour = (213, 94, 0)  # vermillion
PAPER: Colour = (255, 255, 255)
INK: Colour = (40, 44, 52)
FAINT: Colour = (120, 126, 136)
PRINT: Colour = (222, 225, 230)

FINE = 3
"""Pictures are drawn this many times larger and then reduced, which gives lines of half a pixel's width."""

SHIFT = 5
"""Bits of the fraction of a pixel with which lines are placed."""

CHORDS = 24


@dataclass(frozen=True, eq=False)
class Layer:
    """Curves (E, n + 1, 3) in mm that are drawn in one colour, ``width`` pixels wide, under one name.

    Where lines are drawn thinner, as in dense frames, this one keeps at least ``least`` pixels.
    """

    name: str
    control_points: np.ndarray
    colour: Colour
    width: float
    least: float = 0.0


def layers_of(plan: np.ndarray, truth: np.ndarray | None = None, twin: np.ndarray | None = None) -> tuple[Layer, ...]:
    """The usual layers, from the lowest to the highest, for curves (E, n + 1, 3) in mm."""
    layers = [] if truth is None else [Layer("truth", truth, TRUTH, 6.5)]
    layers.append(Layer("plan", plan, PLAN, 3.0))
    return (*layers, *([] if twin is None else [Layer("twin", twin, TWIN, 1.5, least=1.1)]))


@dataclass(frozen=True)
class Window:
    """A part of a camera's picture that is shown: its middle in pixels, and how much it is enlarged."""

    column: float
    row: float
    zoom: float

    def placed(self, pixels: np.ndarray, size: tuple[int, int], fine: int = 1) -> np.ndarray:
        """Where pixels (..., 2) of the camera lie in a picture of ``size`` (height, width), in OpenCV's way of
        counting (pixel centres are whole numbers) and with `SHIFT` bits of fraction, (..., 2) float."""
        middle = np.array(size[::-1]) * fine / 2.0
        return ((pixels - [self.column, self.row]) * self.zoom * fine + middle - 0.5) * 2**SHIFT


def window_of(camera: Camera, layers: Sequence[Layer], size: tuple[int, int], margin: float = 0.05) -> Window:
    """Choose the window of a picture, ``size`` (height, width), that holds all curves and little else."""
    points = np.concatenate([layer.control_points.reshape(-1, 3) for layer in layers])
    pixels, depth = camera.project(points, distort=False)
    seen = pixels[depth > 0.0]
    if not len(seen):
        seen = np.array([[0.0, 0.0], [camera.width, camera.height]])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = 0.5 * (low + high)
    room = np.array(size[::-1]) * (1.0 - 2.0 * margin)
    return Window(float(middle[0]), float(middle[1]), float((room / np.maximum(high - low, 1.0)).min()))


def draw_view(
    camera: Camera,
    mask: np.ndarray,
    layers: Sequence[Layer],
    *,
    size: tuple[int, int] = (450, 600),
    window: Window | None = None,
    width: float = 1.0,
) -> np.ndarray:
    """One view: the mask in grey, the curves over it.

    Parameters
    ----------
    camera
        Without lens distortion.
    mask
        (H, W) of the camera's size, 0..1 or uint8.
    layers
        From the lowest to the highest.
    size
        Height and width of the picture.
    window
        What of the view is shown; all curves by default.
    width
        Factor on the layers' widths.

    Returns
    -------
    (height, width, 3) uint8, red, green, blue.
    """
    window = window_of(camera, layers, size) if window is None else window
    fine = (size[0] * FINE, size[1] * FINE)
    picture = _tinted(_cut_out(mask, window, fine))
    for layer in layers:
        _draw_curves(picture, camera, layer, window, width)
    return np.asarray(cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA))


def _cut_out(mask: np.ndarray, window: Window, size: tuple[int, int]) -> np.ndarray:
    """The window of a mask, resampled to ``size``, (height, width) uint8; black beyond the picture."""
    grey: np.ndarray = mask if mask.dtype == np.uint8 else np.rint(255.0 * mask).astype(np.uint8)
    zoom = window.zoom * FINE
    ratio = np.ones(2)
    if zoom < 1.0:  # average what is lost, then let the affine map do the rest
        smaller = (max(1, round(grey.shape[1] * zoom)), max(1, round(grey.shape[0] * zoom)))
        ratio = np.array([smaller[0] / grey.shape[1], smaller[1] / grey.shape[0]])
        grey = np.asarray(cv2.resize(grey, smaller, interpolation=cv2.INTER_AREA))
    scale = zoom / ratio
    # OpenCV counts pixel centres as whole numbers, the cameras as whole numbers and a half.
    shift = np.array([size[1], size[0]]) / 2.0 - zoom * np.array([window.column, window.row])
    shift = shift + 0.5 * scale - 0.5
    affine = np.array([[scale[0], 0.0, shift[0]], [0.0, scale[1], shift[1]]])
    return np.asarray(cv2.warpAffine(grey, affine, size[::-1], flags=cv2.INTER_LINEAR))


def _tinted(mask: np.ndarray) -> np.ndarray:
    """The colours of a mask (H, W) uint8."""
    table = np.rint(np.linspace(PAPER, PRINT, 256)).astype(np.uint8)[None]  # (1, 256, 3)
    return np.asarray(cv2.LUT(cv2.merge([mask, mask, mask]), table))


def _draw_curves(picture: np.ndarray, camera: Camera, layer: Layer, window: Window, scale: float) -> None:
    points = bezier.evaluate(layer.control_points, np.linspace(0.0, 1.0, CHORDS + 1))
    pixels, depth = camera.project(points, distort=False)
    ahead = (depth > 0.0).all(axis=1)
    height, width = picture.shape[:2]
    placed = window.placed(pixels[ahead], (height // FINE, width // FINE), FINE)
    far = 8.0 * 2**SHIFT * max(height, width)  # beyond that OpenCV's integers may overflow
    chains = np.rint(placed[(np.abs(placed) < far).all(axis=(1, 2))]).astype(np.int32)
    cv2.polylines(
        picture,
        list(chains),
        isClosed=False,
        color=layer.colour,
        thickness=_thickness(max(layer.least, layer.width * scale) * FINE),
        lineType=cv2.LINE_AA,
        shift=SHIFT,
    )


def _thickness(width: float) -> int:
    """OpenCV's thickness for a smooth line ``width`` pixels wide: it draws 1 as 1.4, and 2 k as 2 k + 1.5."""
    return max(1, 2 * round((width - 1.5) / 2.0))
