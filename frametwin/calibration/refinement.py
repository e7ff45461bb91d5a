"""Corners of boards from about a pixel to a small part of one: by edges, or where squares are small by windows."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Face
from frametwin.calibration.square_corners import square_corner

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Grey = NDArray[np.uint8]

BY_EDGES = 0.5
"""Share of the corners of a face that have to be large enough to be measured by their edges; else none is."""

LEAST_BY_EDGES = 4

LARGEST_STEP = 1.6
"""Pixels from OpenCV's corner to the refined one; beyond that another thing was found."""


def refined_charuco(grey: Grey, face: Face, numbers: Integers, pixels: Floats, windows: bool = True) -> Floats:
    """Corners of a ChArUco board, in what no marker reaches into.

    OpenCV's own are half a pixel off in some versions (4.11), and its windows may touch the markers.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    face
        The board.
    numbers : (N,) array
        Which of its corners; at least four that span it.
    pixels : (N, 2) array
        Where they are, about; pixel centres are whole numbers.
    windows
        Whether corners that are too small to be measured by their edges are wanted all the same, less certain.

    Returns
    -------
    (N, 2) array
        Where they are; NaN where none is found.
    """
    flat = face.flat_corners[numbers]
    free = 0.5 * (face.square - face.marker)
    found = _by_edges(grey, flat, pixels, face.square, free)
    if found is None and not windows:
        return np.full_like(pixels, np.nan)
    if found is None:
        plane = _homography(flat, pixels)
        scales = [float(np.linalg.svd(_axes(plane, place), compute_uv=False)[1]) for place in flat]
        halves = [int(np.clip(0.9 * free * scale, 2, 9)) for scale in scales]
        found = np.concatenate([_by_window(grey, pixels[i : i + 1], half) for i, half in enumerate(halves)])
    found[np.linalg.norm(found - pixels, axis=1) > LARGEST_STEP] = np.nan
    return found


def refined_checkerboard(grey: Grey, pixels: Floats, columns: int, rows: int) -> Floats:
    """Inner corners of a checkerboard.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    pixels : (rows * columns, 2) array
        Where they are, about; pixel centres are whole numbers.
    columns, rows
        How many there are.

    Returns
    -------
    (rows * columns, 2) array
        Where they are.
    """
    grid = pixels.reshape(rows, columns, 2)
    near = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
    plain = _by_window(grey, pixels, int(np.clip(near * 0.35, 2, 11)))
    flat = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    found = _by_edges(grey, flat, plain, 1.0, 0.5)
    return plain if found is None else np.where(np.isfinite(found), found, plain)


def _by_edges(grey: Grey, flat: Floats, pixels: Floats, square: float, free: float) -> Floats | None:
    """Corners as the crossings of edges, NaN where those are not seen; None where too few are large enough for it."""
    plane = _homography(flat, pixels)
    found = np.full_like(pixels, np.nan)
    for i, place in enumerate(flat):
        corner = square_corner(grey, pixels[i], _axes(plane, place), square, free)
        if corner is not None:
            found[i] = corner
    seen = int(np.isfinite(found[:, 0]).sum())
    return found if seen >= max(LEAST_BY_EDGES, BY_EDGES * len(found)) else None


def _by_window(grey: Grey, pixels: Floats, half: int) -> Floats:
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)
    start = np.ascontiguousarray(pixels, dtype=np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(grey, start, (half, half), (-1, -1), stop), dtype=np.float64).reshape(-1, 2)


def _homography(flat: Floats, pixels: Floats) -> Floats:
    return np.asarray(cv2.findHomography(flat, pixels)[0], dtype=np.float64)


def _axes(plane: Floats, place: Floats) -> Floats:
    """How the axes of a board look at a place of it: (2, 2) columns, px/mm."""
    w = plane[2, :2] @ place + plane[2, 2]
    at = (plane[:2, :2] @ place + plane[:2, 2]) / w
    return np.asarray((plane[:2, :2] - np.outer(at, plane[2, :2])) / w)
