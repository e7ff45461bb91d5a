"""One page of what was seen: the masks of a capture over its pictures, with the method and its figures."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from frametwin.capture.capture import Capture, View
from frametwin.imaging.contact_sheet import SPACING, put_text
from frametwin.imaging.encoding import jpeg
from frametwin.imaging.masks import decode, undistort
from frametwin.imaging.overlay import FAINT, INK, PAPER, TWIN, Colour
from frametwin.imaging.photo_masks import ViewMask

QUALITY = 85
TILE_WIDTH = 760
CAPTION = 56
REFUSED: Colour = (180, 30, 30)
TINT = 0.45
"""How strongly what is print is coloured, and what is unknown is greyed."""

METHOD_NAMES = {
    "mask": "a mask already",
    "paper": "rule of the paper",
    "reference": "compared with the view before printing",
    "alone": "compared with its own background",
    "auto": "not looked at further",
}

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.45 system-ui, sans-serif; margin: 24px; color: #282c34; }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(420px, 1fr)); gap: 18px; }}
figure {{ margin: 0; }} img {{ width: 100%; display: block; }} .refused {{ color: #b41e1e; }}
</style></head><body><h1>{title}</h1><p>{summary}</p><main>
{figures}
</main></body></html>
"""


@dataclass(frozen=True, eq=False)
class SeenView:
    """A view as it is shown: a picture (H, W, 3) uint8, red, green, blue, with the mask over it, and its caption."""

    picture: np.ndarray
    name: str
    figures: str
    refused: bool


def seen_views(capture: Capture, masks: Sequence[ViewMask]) -> list[SeenView]:
    """All views of a capture with their masks."""
    return [_seen(view, mask) for view, mask in zip(capture.views, masks, strict=True)]


def figures_of(mask: ViewMask) -> str:
    """The method of a view and its figures, or why it is not used, in one line."""
    parts = [METHOD_NAMES[mask.method]] if mask.used else [f"not used: {mask.reason}"]
    if np.isfinite(mask.found):
        parts.append(f"{mask.found:.0%} of the plan's pixels")
    if mask.photo is not None:
        parts.append(f"noise {mask.photo.noise:.1f} of 255")
        if mask.photo.has_reference:
            parts.append(f"exposure x {float(mask.photo.gain.mean()):.2f}")
    if mask.valid is not None:
        parts.append(f"{float((mask.valid < 0.5).mean()):.1%} unknown")
    return ", ".join(parts)


def sheet(views: Sequence[SeenView], columns: int = 2) -> np.ndarray:
    """All views in one picture (H, W, 3) uint8, red, green, blue."""
    tiles = [_tile(view) for view in views]
    height = max(tile.shape[0] for tile in tiles)
    rows = []
    for first in range(0, len(tiles), columns):
        row = np.full((height + SPACING, columns * (TILE_WIDTH + SPACING) + SPACING, 3), PAPER, dtype=np.uint8)
        for i, tile in enumerate(tiles[first : first + columns]):
            left = SPACING + i * (TILE_WIDTH + SPACING)
            row[: tile.shape[0], left : left + TILE_WIDTH] = tile
        rows.append(row)
    return np.concatenate(rows)


def page(title: str, views: Sequence[SeenView]) -> str:
    """All views on one HTML page that needs no other file."""
    used = sum(not view.refused for view in views)
    figures = "\n".join(
        f'<figure><img alt="{html.escape(view.name)}" src="{_source(view.picture)}">'
        f"<figcaption{' class=refused' if view.refused else ''}><b>{html.escape(view.name)}</b> "
        f"{html.escape(view.figures)}</figcaption></figure>"
        for view in views
    )
    summary = f"{used} of {len(views)} views can be used. Print is orange with its outline; what is unknown is grey."
    return _PAGE.format(title=html.escape(title), summary=summary, figures=figures)


def _seen(view: View, mask: ViewMask) -> SeenView:
    image = decode(view.image, view.camera)
    image = image[..., ::-1] if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    picture = undistort(np.ascontiguousarray(image), view.camera).astype(np.float32)
    share = TINT * mask.coverage[..., None]
    picture = (1.0 - share) * picture + share * np.array(TWIN, dtype=np.float32)
    if mask.valid is not None:
        grey = TINT * (1.0 - mask.valid[..., None])
        picture = (1.0 - grey) * picture + grey * 128.0
    shown = np.ascontiguousarray(np.rint(picture).astype(np.uint8))
    outlines, _ = cv2.findContours((mask.coverage > 0.5).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(shown, outlines, -1, TWIN, 1)
    return SeenView(shown, view.image.path.name, figures_of(mask), not mask.used)


def _tile(view: SeenView) -> np.ndarray:
    height = round(view.picture.shape[0] * TILE_WIDTH / view.picture.shape[1])
    tile = np.full((height + CAPTION, TILE_WIDTH, 3), PAPER, dtype=np.uint8)
    tile[CAPTION:] = cv2.resize(view.picture, (TILE_WIDTH, height), interpolation=cv2.INTER_AREA)
    put_text(tile, view.name, (4, 22), 0.55, INK)
    put_text(tile, view.figures, (4, 46), 0.45, REFUSED if view.refused else FAINT)
    return tile


def _source(picture: np.ndarray) -> str:
    """A picture (H, W, 3), red, green, blue, as an address that holds it."""
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg(picture[..., ::-1], QUALITY)).decode('ascii')}"
