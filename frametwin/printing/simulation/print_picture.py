"""One picture of a print as it really stands: by deviation from the design, what is lost in red."""

from __future__ import annotations

import cv2
import numpy as np

from frametwin.cameras.rigs import ring_rig
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.contact_sheet import put_text
from frametwin.imaging.overlay import FAINT, INK, PAPER, Colour, Layer, draw_view

DESIGN: Colour = (205, 209, 215)
LOST: Colour = (214, 39, 40)
SCALE: tuple[Colour, ...] = ((38, 84, 150), (42, 138, 164), (79, 176, 125), (176, 196, 60), (240, 170, 40))
"""From where the design has it to the largest deviation shown."""

PARTS = 4
"""Of each strut, coloured by themselves."""

VIEW = (560, 640)
"""Height and width of one view in pixels."""

HEADER = 150
SAMPLES = 8


def print_picture(
    design: Wireframe, real: Wireframe, lost: np.ndarray, title: str, subtitle: str, largest: float | None = None
) -> np.ndarray:
    """Draw a print from two sides and from obliquely above.

    Parameters
    ----------
    design
        As it should be; all of it is drawn in grey.
    real
        As it is; its printed struts are drawn, in the colour of their distance from the design at equal parameter.
    lost
        Indices of struts that were laid and do not stand; they are drawn red, where the design has them.
    title, subtitle
        What is shown.
    largest
        Deviation in mm of the last colour; that of ``real`` by default. Give one for pictures that are compared.

    Returns
    -------
    (H, W, 3) uint8 array
        Red, green, blue.
    """
    pieces, deviation = _pieces(design, real)
    top = max(float(deviation.max(initial=0.0)) if largest is None else largest, 1e-9)
    level = np.minimum((deviation / top * len(SCALE)).astype(int), len(SCALE) - 1)
    layers = [Layer("design", design.control_points, DESIGN, 2.0, least=1.0)]
    for k, colour in enumerate(SCALE):
        beyond = k == len(SCALE) - 1 and deviation.max(initial=0.0) > top * (1.0 + 1e-9)
        to = "mm off and more" if beyond else f"to {(k + 1) * top / len(SCALE):.1f} mm off"
        name = f"{k * top / len(SCALE):.1f} {to}"
        layers.append(Layer(name, pieces[level == k], colour, 4.0, least=1.6))
    layers.append(Layer("lost", design.control_points[lost], LOST, 4.0, least=1.6))
    low, high = design.bounds
    room = 0.1 * design.extent
    box = np.stack([low - room, high + room])
    cameras = [
        *ring_rig(box, 4, size=VIEW, elevation_deg=4.0, start_deg=-90.0)[:2],
        *ring_rig(box, 1, size=VIEW, elevation_deg=35.0, start_deg=-50.0),
    ]
    blank = np.zeros(VIEW, dtype=np.uint8)
    drawn = [layer for layer in layers if len(layer.control_points)]
    views = np.concatenate([draw_view(camera, blank, drawn, size=VIEW) for camera in cameras], axis=1)
    return np.concatenate([_header(views.shape[1], title, subtitle, layers), views])


def _header(width: int, title: str, subtitle: str, layers: list[Layer]) -> np.ndarray:
    picture = np.full((HEADER, width, 3), PAPER, dtype=np.uint8)
    put_text(picture, title, (20, 50), 1.05, INK, 2.2)
    put_text(picture, subtitle, (20, 88), 0.62, FAINT)
    step = (width - 40) // len(layers)
    for k, layer in enumerate(layers):
        cv2.line(picture, (20 + k * step, 122), (58 + k * step, 122), layer.colour, 5, cv2.LINE_AA)
        put_text(picture, layer.name, (68 + k * step, 128), 0.55, INK)
    return picture


def _pieces(design: Wireframe, real: Wireframe) -> tuple[np.ndarray, np.ndarray]:
    """(N PARTS, 4, 3) pieces of the printed struts and (N PARTS,) largest distance from the design of each."""
    printed = real.printed
    curves, planned = real.control_points[printed], design.control_points[printed]
    pieces, deviation = [], []
    for k in range(PARTS):
        u = np.linspace(k, k + 1, SAMPLES + 1) / PARTS
        points = bezier.evaluate(curves, u)
        pieces.append(np.einsum("cj,sjx->scx", bezier.refit_matrix(SAMPLES), points))
        deviation.append(np.linalg.norm(points - bezier.evaluate(planned, u), axis=2).max(axis=1))
    return np.concatenate(pieces), np.concatenate(deviation)
