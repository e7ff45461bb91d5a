"""What is black on a board: rectangles in mm, from which it is printed and by which a picture of it is computed."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Face

Floats = NDArray[np.float64]


def black_rectangles(face: Face, legacy: bool = False) -> Floats:
    """Black parts of a face.

    Parameters
    ----------
    face
        The pattern.
    legacy
        Whether a ChArUco board has the pattern of before OpenCV 4.6.

    Returns
    -------
    (N, 4) array, mm
        Left, bottom, right and top of each, in the face's own axes; none overlap.
    """
    if face.kind == "checkerboard":
        return _squares(face, face.columns + 1, face.rows + 1, np.zeros((0, 2)))
    corners = face.marker_corners
    if face.kind == "charuco":
        board = face.charuco(legacy)
        middle = 0.5 * face.square * np.array([face.columns, face.rows])
        corners = (np.array(board.getObjPoints(), dtype=np.float64)[..., :2] - middle) * (1.0, -1.0)
    modules = [_marker(face, int(number), ring) for number, ring in zip(face.marker_ids, corners, strict=True)]
    if face.kind == "charuco":
        modules.append(_squares(face, face.columns, face.rows, corners.mean(axis=1)))
    return np.concatenate(modules)


def _squares(face: Face, columns: int, rows: int, white: Floats) -> Floats:
    """The black squares: those without a marker, or every second one from the top left."""
    row, column = np.divmod(np.arange(columns * rows), columns)
    x = face.square * (column - 0.5 * columns)
    y = face.square * (0.5 * rows - row - 1.0)
    black = (row + column) % 2 == 0
    if len(white):
        middles = np.stack([x, y], axis=1) + 0.5 * face.square
        black = np.linalg.norm(middles[:, None] - white, axis=2).min(axis=1) > 0.25 * face.square
    return np.stack([x, y, x + face.square, y + face.square], axis=1)[black]


def _marker(face: Face, number: int, ring: Floats) -> Floats:
    """The black modules of a marker, runs of a row joined into one rectangle."""
    modules = face.aruco.markerSize + 2
    bits = cv2.aruco.generateImageMarker(face.aruco, number, modules, borderBits=1) < 128
    left, top = ring[0]
    size = face.marker / modules
    found = []
    for i, row in enumerate(bits):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
        for begin, end in edges.reshape(-1, 2):
            found.append((left + begin * size, top - (i + 1) * size, left + end * size, top - i * size))
    return np.array(found)
