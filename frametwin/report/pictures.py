"""The photographs of a report: every view cut out about the print, and single struts where they are seen best.

Pictures are plain; what lies over them is drawn by the browser, with the cameras that are told beside them.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture
from frametwin.geometry import bezier
from frametwin.imaging.encoding import jpeg
from frametwin.imaging.masks import decode, undistort
from frametwin.progress import Progress, ProgressCallback, report

QUALITY = 82
MARGIN = 0.04
"""About the print, as a share of the picture."""

CHORDS = 12
CROP_MARGIN, CROP_LEAST, CROP_MOST = 0.35, 96, 480
"""About a strut, as a share of its length in the picture; least and greatest width and height of its cut-out, px."""

CROPS = 3
"""Views in which a strut is shown."""

SEEN = 0.5
"""Share of a strut that must be in plain view for it to be shown in a view, where there is such a view."""


@dataclass(frozen=True, eq=False)
class SeenView:
    """A view without lens distortion.

    Attributes
    ----------
    camera : Camera
        Without distortion.
    picture : (H, W) or (H, W, 3) uint8 array
        Grey, or blue, green, red.
    """

    camera: Camera
    picture: np.ndarray


def read_views(capture: Capture, progress: ProgressCallback | None = None) -> list[SeenView]:
    """Decode all pictures of a capture and take out the distortion of their lenses.

    Raises
    ------
    InputError
        If a picture cannot be decoded.
    """
    views = []
    for i, view in enumerate(capture.views):
        picture = undistort(np.ascontiguousarray(decode(view.image, view.camera)), view.camera)
        if set(np.unique(picture[::16, ::16])) <= {0, 1}:  # a mask of two values
            picture = picture * np.uint8(255)
        views.append(SeenView(view.camera.without_distortion(), picture))
        report(progress, Progress("reading images", i + 1, len(capture.views)))
    return views


def view_content(views: Sequence[SeenView], curves: np.ndarray, width: int) -> list[dict[str, Any]]:
    """Every view cut out about curves (E, n + 1, 3), at most ``width`` pixels wide, as for the page."""
    told = []
    for view in views:
        pixels = _visible(view.camera, curves.reshape(-1, 3))
        margin = MARGIN * max(view.camera.width, view.camera.height)
        told.append(_cut_out(view, pixels.min(axis=0) - margin, pixels.max(axis=0) + margin, width))
    return told


def crop_content(views: Sequence[SeenView], curves: np.ndarray, struts: Sequence[int]) -> dict[str, list[Any]]:
    """Cut-outs of struts in the views that show them best, by strut, as for the page.

    Parameters
    ----------
    views
        The ones to choose from.
    curves : (E, n + 1, 3) array, mm
        What stands: it may hide the struts.
    struts
        Which to show.
    """
    shares = [seen_shares(view.camera, curves, struts) for view in views]
    return {str(strut): _crops(views, curves[strut], [own[k] for own in shares]) for k, strut in enumerate(struts)}


def _crops(views: Sequence[SeenView], curve: np.ndarray, shares: Sequence[float]) -> list[dict[str, Any]]:
    """The best views of one strut: long in the picture and in plain view."""
    points = bezier.evaluate(curve[None], np.linspace(0.0, 1.0, CHORDS + 1))[0]
    found = []
    for i, (view, share) in enumerate(zip(views, shares, strict=True)):
        pixels, depth = view.camera.project(points, distort=False)
        inside = (depth > 0.0) & (pixels >= 0.0).all(axis=1)
        inside &= (pixels < [view.camera.width, view.camera.height]).all(axis=1)
        if inside.all():
            length = float(np.linalg.norm(np.ptp(pixels, axis=0)))
            found.append((share >= SEEN, length * max(share, 0.05), i, pixels))
    found.sort(key=lambda item: (item[0], item[1]), reverse=True)
    result = []
    for _, _, i, pixels in found[:CROPS]:
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        half = np.clip(0.5 * (1.0 + 2.0 * CROP_MARGIN) * float((high - low).max()), CROP_LEAST / 2, CROP_MOST / 2)
        middle = 0.5 * (low + high)
        result.append({"view": i, **_cut_out(views[i], middle - half, middle + half, CROP_MOST)})
    return result


def seen_shares(camera: Camera, curves: np.ndarray, struts: Sequence[int]) -> np.ndarray:
    """(N,) share of each of ``struts`` that no strut of ``curves`` (E, n + 1, 3) hides from a camera.

    Struts are painted from the furthest to the nearest as thin lines with their number; what is left of one is seen.
    """
    points = bezier.evaluate(curves, np.linspace(0.0, 1.0, CHORDS + 1))
    pixels, depth = camera.project(points, distort=False)
    drawn = np.zeros((camera.height, camera.width), dtype=np.int32)
    ahead = (depth > 0.0).all(axis=1) & (np.abs(pixels) < 1e6).all(axis=(1, 2))
    for i in np.argsort(-depth.mean(axis=1)):
        if ahead[i]:
            cv2.polylines(drawn, [np.rint(pixels[i] - 0.5).astype(np.int32)], False, (float(i + 1),), 3)
    shares = np.zeros(len(struts))
    for k, strut in enumerate(struts):
        column, row = np.floor(pixels[strut, 1:-1]).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        own = drawn[row[inside], column[inside]] == strut + 1
        shares[k] = own.sum() / len(inside)
    return shares


def _visible(camera: Camera, points: np.ndarray) -> np.ndarray:
    """(N, 2) where points ahead of a camera lie in its picture; the picture's corners if there are none."""
    pixels, depth = camera.project(points, distort=False)
    ahead = pixels[depth > 0.0]
    return ahead if len(ahead) else np.array([[0.0, 0.0], [camera.width, camera.height]])


def _cut_out(view: SeenView, low: np.ndarray, high: np.ndarray, width: int) -> dict[str, Any]:
    """A part of a picture between two corners in pixels, and the camera of it: matrix and window."""
    camera = view.camera
    limit = np.array([camera.width, camera.height])
    first = np.clip(np.floor(low), 0, limit - 2).astype(int)
    last = np.maximum(np.clip(np.ceil(high), 0, limit).astype(int), first + 2)
    part = view.picture[first[1] : last[1], first[0] : last[0]]
    size = last - first
    zoom = min(1.0, width / float(size.max()))
    shown = np.maximum(np.rint(size * zoom).astype(int), 1)
    if zoom < 1.0:
        part = cv2.resize(part, (int(shown[0]), int(shown[1])), interpolation=cv2.INTER_AREA)
    scale = shown / size
    return {
        "size": shown.tolist(),
        "k": [
            camera.fl_x * scale[0],
            camera.fl_y * scale[1],
            (camera.cx - first[0]) * scale[0],
            (camera.cy - first[1]) * scale[1],
        ],
        "m": camera.world_to_camera[:3].ravel().tolist(),
        "picture": base64.b64encode(jpeg(part, QUALITY)).decode("ascii"),
    }
