"""One picture of a whole capture: close-ups above, all views below, with a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.imaging.overlay import FAINT, INK, PAPER, PRINT, SHIFT, Colour, Layer, Window, draw_view, window_of

TILE_AREA = 270_000
"""Pixels of one view."""

TILE_ASPECTS = (0.7, 1.7)
"""Least and greatest height of a view, as a share of its width."""

SHEET_ASPECT = 0.55
"""Height of the grid of views that is aimed at, as a share of its width."""

CLOSE_UP_HEIGHT = 540
MIN_WIDTH = 1500
"""Of the sheet, so that there is room for the header."""

SPACING = 12
HEADER = 112
LINE: Colour = (214, 218, 224)
TEXT_FINE = 4  # text is drawn this many times larger, then reduced


@dataclass(frozen=True)
class CloseUp:
    """An enlarged part of one view.

    Attributes
    ----------
    view : number of the view.
    window : which part.
    caption : why it is shown.
    pixels_per_mm : for the scale bar.
    marks : (N, 2) pixels of the view that are ringed.
    """

    view: int
    window: Window
    caption: str
    pixels_per_mm: float
    marks: np.ndarray


def contact_sheet(
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    layers: Sequence[Layer],
    *,
    title: str,
    subtitle: str = "",
    close_ups: Sequence[CloseUp] = (),
) -> np.ndarray:
    """All views of a capture in a grid, with the curves drawn over them.

    Parameters
    ----------
    cameras, masks
        The views: cameras without lens distortion, and (H, W) masks of their sizes, 0..1 or uint8.
    layers
        From the lowest to the highest; see `frametwin.imaging.overlay.layers_of`.
    title, subtitle
        What is shown.
    close_ups
        Shown above the views, side by side.

    Returns
    -------
    (H, W, 3) uint8, red, green, blue.
    """
    tile = _tile_size(cameras, layers)
    columns = _columns(len(cameras), tile)
    width = max(MIN_WIDTH, columns * tile[1] + (columns + 1) * SPACING)
    rows = [_header(width, title, subtitle, layers)]
    if close_ups:
        part = (width - (len(close_ups) + 1) * SPACING) // len(close_ups)
        size = (CLOSE_UP_HEIGHT, part)
        rows.append(_row([_close_up(cameras, masks, layers, shown, size) for shown in close_ups], width, size[0]))
    views = [
        _framed(draw_view(camera, mask, layers, size=tile, width=line_width(camera, layers, tile)), camera.name)
        for camera, mask in zip(cameras, masks, strict=True)
    ]
    rows += [_row(views[i : i + columns], width, tile[0]) for i in range(0, len(views), columns)]
    return np.concatenate([*rows, _blank(SPACING, width)])


def find_close_ups(
    cameras: Sequence[Camera],
    plan: np.ndarray,
    truth: np.ndarray,
    twin: np.ndarray,
    *,
    joints: np.ndarray | None = None,
) -> tuple[CloseUp, CloseUp]:
    """Close-ups of the joint that moved furthest and of the one at which the twin errs most.

    Parameters
    ----------
    cameras
        Of the views; each close-up takes one that shows well what it is about.
    plan, truth, twin
        (V, 3) joints in mm.
    joints
        (V,) bool, the ones to choose from; all by default.
    """
    chosen = np.flatnonzero(np.ones(len(plan), dtype=bool) if joints is None else joints)
    moved = np.linalg.norm(truth - plan, axis=1)[chosen]
    missed = np.linalg.norm(twin - truth, axis=1)[chosen]
    size = (CLOSE_UP_HEIGHT, 2 * CLOSE_UP_HEIGHT)  # about; the window grows with the sheet
    shown = np.concatenate([plan[chosen], truth[chosen]])
    spread = float(np.linalg.norm(np.ptp(shown, axis=0)))
    reasons = (
        (moved, plan, 0.1 * spread, f"Moved furthest: {moved.max():.1f} mm"),
        (missed, twin, 0.025 * spread, f"Largest error at a joint: {missed.max():.2f} mm"),
    )
    found = []
    for distance, other, reach, caption in reasons:
        joint = chosen[distance.argmax()]
        step = np.stack([other[joint], truth[joint]])
        view = _best_view(cameras, step, shown)
        name = cameras[view].name
        window, pixels_per_mm = _about(cameras[view], step, reach, shown, size)
        marks, _ = cameras[view].project(step, distort=False)
        found.append(CloseUp(view, window, f"{caption}, seen by {name}", pixels_per_mm, marks))
    return found[0], found[1]


def _best_view(cameras: Sequence[Camera], step: np.ndarray, shown: np.ndarray) -> int:
    """Among the views in which a step (2, 3) looks long, the one in which all points look furthest apart."""
    lengths, spreads = [], []
    for camera in cameras:
        pixels, depth = camera.project(np.concatenate([step, shown]), distort=False)
        seen = bool((depth[:2] > 0.0).all())
        # By angle, as views may differ in size.
        lengths.append(float(np.linalg.norm(pixels[1] - pixels[0])) / camera.fl_y if seen else -1.0)
        spreads.append(float(np.prod(np.std(pixels[depth > 0.0] / camera.fl_y, axis=0))) if seen else -1.0)
    fine = np.array(lengths) >= 0.7 * max(lengths)
    return int(np.argmax(np.where(fine, spreads, -np.inf)))


def _about(
    camera: Camera, step: np.ndarray, reach: float, shown: np.ndarray, size: tuple[int, int]
) -> tuple[Window, float]:
    """A window ``reach`` mm around a step (2, 3), within what there is to see, and its pixels for a mm."""
    pixels, depth = camera.project(step, distort=False)
    everything, ahead = camera.project(shown, distort=False)
    low, high = everything[ahead > 0.0].min(axis=0), everything[ahead > 0.0].max(axis=0)
    density = camera.fl_y / float(depth[1])
    half = max(reach * density, 0.75 * float(np.ptp(pixels, axis=0).max()), 1.0)
    zoom = 0.5 * size[0] / half
    room = 0.4 * np.array(size[::-1]) / zoom  # the step stays well inside
    middle = pixels.mean(axis=0)
    inside = np.clip(middle, np.minimum(low + room, 0.5 * (low + high)), np.maximum(high - room, 0.5 * (low + high)))
    middle = np.clip(inside, middle - 0.8 * room, middle + 0.8 * room)
    return Window(float(middle[0]), float(middle[1]), zoom), density * zoom


def _tile_size(cameras: Sequence[Camera], layers: Sequence[Layer]) -> tuple[int, int]:
    """Height and width of the views, tall for towers and wide for bridges."""
    points = np.concatenate([layer.control_points.reshape(-1, 3) for layer in layers])
    aspects = []
    for camera in cameras:
        pixels, depth = camera.project(points, distort=False)
        if (depth > 0.0).any():
            width, height = np.ptp(pixels[depth > 0.0], axis=0)
            aspects.append(height / max(width, 1.0))
    aspect = float(np.clip(np.median(aspects or [1.0]), *TILE_ASPECTS))
    return round(np.sqrt(TILE_AREA * aspect)), round(np.sqrt(TILE_AREA / aspect))


def _columns(count: int, tile: tuple[int, int]) -> int:
    """Columns of a grid of ``count`` views: few empty places, and a sheet that is not too long either way."""

    def cost(columns: int) -> float:
        rows = -(-count // columns)
        aspect = rows * tile[0] / (columns * tile[1])
        return (rows * columns - count) / count + abs(np.log(aspect / SHEET_ASPECT))

    return min(range(1, count + 1), key=cost)


def line_width(camera: Camera, layers: Sequence[Layer], size: tuple[int, int]) -> float:
    """Thinner lines where struts look short, so that dense frames stay legible."""
    curves = layers[0].control_points
    pixels, _ = camera.project(curves[:, [0, 3]], distort=False)
    length = np.median(np.linalg.norm(np.diff(pixels, axis=1), axis=-1)) * window_of(camera, layers, size).zoom
    return float(np.clip(length / 70.0, 0.25, 1.0))


def _close_up(
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    layers: Sequence[Layer],
    shown: CloseUp,
    size: tuple[int, int],
) -> np.ndarray:
    camera, mask = cameras[shown.view], masks[shown.view]
    picture = draw_view(camera, mask, layers, size=size, window=shown.window, width=2.0)
    for x, y in np.rint(shown.window.placed(shown.marks, size)).astype(int).tolist():
        cv2.circle(picture, (x, y), 14 << SHIFT, INK, 2, cv2.LINE_AA, SHIFT)
    _scale_bar(picture, shown.pixels_per_mm)
    return _framed(picture, shown.caption)


def _scale_bar(picture: np.ndarray, pixels_per_mm: float) -> None:
    """A bar of 1, 2 or 5 times a power of ten, at the lower right."""
    height, width = picture.shape[:2]
    longest = 0.2 * width / pixels_per_mm
    power = 10.0 ** np.floor(np.log10(longest))
    length = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= longest)
    text = f"{length:g} mm"
    right, low = width - 24, height - 22
    left = right - round(length * pixels_per_mm)
    ground = picture[low - 34 : low + 12, min(left, right - _text_width(text, 0.5)) - 12 : right + 12]
    ground[:] = np.rint(0.85 * 255.0 + 0.15 * ground).astype(np.uint8)
    cv2.line(picture, (left, low), (right, low), INK, 3)
    for x in (left, right):
        cv2.line(picture, (x, low - 5), (x, low + 5), INK, 2)
    put_text(picture, text, ((left + right - _text_width(text, 0.5)) // 2, low - 12), 0.5, INK)


def _header(width: int, title: str, subtitle: str, layers: Sequence[Layer]) -> np.ndarray:
    picture = _blank(HEADER, width)
    x = width - SPACING - 6
    for layer in reversed(layers):
        x -= _text_width(layer.name, 0.7)
        put_text(picture, layer.name, (x, 50), 0.7, INK)
        x -= 62
        thickness = max(2, round(1.5 * layer.width))
        cv2.line(picture, (x, 43), (x + 48, 43), layer.colour, thickness, cv2.LINE_AA)
        x -= 34
    x -= _text_width("seen", 0.7)
    put_text(picture, "seen", (x, 50), 0.7, INK)
    cv2.rectangle(picture, (x - 62, 33), (x - 14, 53), PRINT, cv2.FILLED)
    put_text(picture, title, (SPACING + 6, 52), 1.05, INK, 2.2)
    put_text(picture, subtitle, (SPACING + 6, 88), 0.62, FAINT)
    return picture


def _framed(picture: np.ndarray, caption: str) -> np.ndarray:
    """A view with a thin border and its caption on a light ground, at the top left."""
    height, width = picture.shape[:2]
    cv2.rectangle(picture, (0, 0), (width - 1, height - 1), LINE, 1)
    ground = picture[1:32, 1 : _text_width(caption, 0.5) + 24]
    ground[:] = np.rint(0.85 * 255.0 + 0.15 * ground).astype(np.uint8)
    put_text(picture, caption, (12, 22), 0.5, INK)
    return picture


def _row(pictures: Sequence[np.ndarray], width: int, height: int) -> np.ndarray:
    row = _blank(height + SPACING, width)
    x = SPACING
    for picture in pictures:
        row[:height, x : x + picture.shape[1]] = picture
        x += picture.shape[1] + SPACING
    return row


def _blank(height: int, width: int) -> np.ndarray:
    return np.full((height, width, 3), PAPER, dtype=np.uint8)


def _text_width(text: str, scale: float) -> int:
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0])


def put_text(
    picture: np.ndarray,
    text: str,
    place: tuple[int, int],
    scale: float,
    colour: Colour,
    weight: float = 1.3,
) -> None:
    """Write into a picture (H, W, 3), smoothly; ``place`` is the left end of the base line."""
    high, low = round(30 * scale), round(12 * scale)
    x, y = max(0, place[0] - 4), max(0, place[1] - high)
    patch = picture[y : place[1] + low, x : place[0] + _text_width(text, scale) + 8]
    height, width = patch.shape[:2]
    ink = np.zeros((height * TEXT_FINE, width * TEXT_FINE), dtype=np.uint8)
    origin = ((place[0] - x) * TEXT_FINE, (place[1] - y) * TEXT_FINE)
    thickness = max(1, round(weight * TEXT_FINE))
    cv2.putText(ink, text, origin, cv2.FONT_HERSHEY_SIMPLEX, scale * TEXT_FINE, (255.0,), thickness, cv2.LINE_AA)
    share = cv2.resize(ink, (width, height), interpolation=cv2.INTER_AREA)[..., None] / 255.0
    patch[:] = np.rint(share * np.array(colour) + (1.0 - share) * patch).astype(np.uint8)
