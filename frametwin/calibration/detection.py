"""Corners of boards in pictures, by OpenCV's detectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import DICTIONARIES, Board, Face, corner_points, faces
from frametwin.calibration.marker_edges import edge_corners
from frametwin.calibration.refinement import refined_charuco, refined_checkerboard

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LEAST_CORNERS = 4
"""Of a board or of a face of it; fewer fix no pose."""

STRAY = 0.25
"""A corner this share of a square away from where the others of its face say it is was mistaken."""


STRAY_ON_FACE, STRAY_PX = 0.05, 0.3
"""The same for a face of a block, after refinement; and the least that is held against a corner, in px."""


@dataclass(frozen=True)
class Look:
    """In which ways a board differs from the one that was asked for.

    Attributes
    ----------
    inverted
        White where it should be black.
    mirrored
        As in a mirror.
    legacy
        A ChArUco board in the pattern of before OpenCV 4.6.
    """

    inverted: bool = False
    mirrored: bool = False
    legacy: bool = False

    @property
    def words(self) -> str:
        """Such as "inverted and mirrored"; empty for a board as it should be."""
        names = (("inverted (white on black)", self.inverted), ("mirrored", self.mirrored))
        found = [name for name, there in (*names, ("in OpenCV's pattern of before 4.6", self.legacy)) if there]
        return " and ".join(found)


@dataclass(frozen=True, eq=False)
class Sighting:
    """Corners of a board in one picture.

    Attributes
    ----------
    camera
        Its name.
    picture
        The picture's name without its ending; equal names are the same moment.
    corners : (N,) array
        Numbers of the corners.
    points : (N, 3) array, mm
        Where they are in the board's axes.
    pixels : (N, 2) array
        Where they are in the picture, pixel centres at +0.5.
    """

    camera: str
    picture: str
    corners: Integers
    points: Floats
    pixels: Floats = field(repr=False)

    def only(self, chosen: NDArray[np.bool_]) -> Sighting:
        """Some of the corners."""
        kept = self.corners[chosen], self.points[chosen], self.pixels[chosen]
        return Sighting(self.camera, self.picture, *kept)


def possible_looks(board: Board) -> tuple[Look, ...]:
    """All ways in which a board may have been printed, the right one first.

    A checkerboard is the same board when it is inverted or mirrored.
    """
    if board.kind == "checkerboard":
        return (Look(),)
    even = any(face.kind == "charuco" and face.rows % 2 == 0 for face in faces(board))
    states = [(inverted, mirrored) for mirrored in (False, True) for inverted in (False, True)]
    return tuple(Look(*state, legacy) for state in states for legacy in ((False, True) if even else (False,)))


def find_corners(grey: NDArray[np.uint8], board: Board, look: Look) -> tuple[Integers, Floats]:
    """Corners of a board in a picture.

    Parameters
    ----------
    grey : (H, W) array
        The picture.
    board, look
        The board, and the way it was printed.

    Returns
    -------
    corners : (N,) array
        Numbers of the corners found, ascending.
    pixels : (N, 2) array
        Where they are, pixel centres at +0.5.
    """
    seen = grey if not look.inverted else np.asarray(255 - grey, dtype=np.uint8)
    seen = np.ascontiguousarray(seen[:, ::-1]) if look.mirrored else seen
    several = board.kind == "cuboid"  # a face that is seen steeply is left out if there are others
    parts = [_find_face(seen, face, look.legacy, not several) for face in faces(board)]
    if several and not any(len(part[0]) for part in parts):
        parts = [_find_face(seen, face, look.legacy) for face in faces(board)]
    corners = np.concatenate([part[0] for part in parts])
    pixels = np.concatenate([part[1] for part in parts]) + 0.5
    if look.mirrored:
        pixels[:, 0] = grey.shape[1] - pixels[:, 0]
    order = np.argsort(corners)
    return corners[order], pixels[order]


def object_points(board: Board, corners: Integers, look: Look) -> Floats:
    """Where corners of a board are that was printed in a certain way, (N, 3) mm."""
    points = corner_points(board)[corners]
    return points * (-1.0, 1.0, 1.0) if look.mirrored else points


def _find_face(grey: NDArray[np.uint8], face: Face, legacy: bool, windows: bool = True) -> tuple[Integers, Floats]:
    if face.kind == "checkerboard":
        pixels = find_checkerboard(grey, face.columns, face.rows)
        numbers = np.arange(0 if pixels is None else len(pixels))
        return face.first_corner + numbers, np.zeros((0, 2)) if pixels is None else pixels
    numbers, pixels = _charuco(grey, face, legacy) if face.kind == "charuco" else _aprilgrid(grey, face)
    good = consistent(face.flat_corners[numbers], pixels, STRAY * face.square)
    numbers, pixels = numbers[good], pixels[good]
    if face.kind == "charuco" and len(numbers):
        pixels = refined_charuco(grey, face, numbers, pixels, windows)
        numbers, pixels = numbers[np.isfinite(pixels[:, 0])], pixels[np.isfinite(pixels[:, 0])]
        if face.name:  # a face of a block is so small that no lens bends it
            good = consistent(face.flat_corners[numbers], pixels, STRAY_ON_FACE * face.square)
            numbers, pixels = numbers[good], pixels[good]
            good = _on_a_plane(face.flat_corners[numbers], pixels)
            numbers, pixels = numbers[good], pixels[good]
    return face.first_corner + numbers, pixels


def consistent(flat: Floats, pixels: Floats, tolerance: float) -> NDArray[np.bool_]:
    """Which corners lie where a plane in perspective has them.

    Parameters
    ----------
    flat : (N, 2) array, mm
        The corners on the board.
    pixels : (N, 2) array
        The corners in the picture.
    tolerance
        How far a corner may be from its place on the board, mm; generous, as lenses distort.
    """
    if len(flat) < LEAST_CORNERS or np.linalg.matrix_rank(flat - flat.mean(axis=0), tol=1e-6) < 2:
        return np.zeros(len(flat), dtype=bool)
    back, inside = cv2.findHomography(pixels, flat, cv2.RANSAC, tolerance, maxIters=2000)
    if back is None or int(inside.sum()) < LEAST_CORNERS:
        return np.zeros(len(flat), dtype=bool)
    return np.asarray(inside.ravel(), dtype=bool)


def _on_a_plane(flat: Floats, pixels: Floats) -> NDArray[np.bool_]:
    """Which corners lie within a part of a pixel of where the others have them; all that is left of few is none."""
    if len(flat) < LEAST_CORNERS + 1:
        return np.zeros(len(flat), dtype=bool)
    plane, _ = cv2.findHomography(flat, pixels, cv2.LMEDS)
    if plane is None:
        return np.zeros(len(flat), dtype=bool)
    there = np.concatenate([flat, np.ones((len(flat), 1))], axis=1) @ plane.T
    off = np.linalg.norm(there[:, :2] / there[:, 2:] - pixels, axis=1)
    return np.asarray(off <= max(STRAY_PX, 4.0 * float(np.median(off))))


def find_checkerboard(grey: NDArray[np.uint8], columns: int, rows: int) -> Floats | None:
    """Inner corners of a checkerboard, row by row from the top left of the board as printed.

    Returns
    -------
    (columns * rows, 2) array
        OpenCV's pixels (centres are whole numbers); None if the board is not seen whole.
    """
    size = (columns, rows)
    quick = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    found, pixels = cv2.findChessboardCorners(grey, size, flags=quick)
    if not found:  # slower, and not nearer by itself, but sees more
        found, pixels = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    pixels = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    grid = refined_checkerboard(grey, pixels, columns, rows).reshape(rows, columns, 2)
    return _oriented(grey, grid).reshape(-1, 2)


def _oriented(grey: NDArray[np.uint8], grid: Floats) -> Floats:
    """Turn a grid so that it is seen from the front, with a black square at its top left."""
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0.0:
        grid = grid[::-1]
    middles = 0.25 * (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:])
    column, row = np.rint(middles[..., 0]).astype(int), np.rint(middles[..., 1]).astype(int)
    inside = (row >= 0) & (column >= 0) & (row < grey.shape[0]) & (column < grey.shape[1])
    light = grey[row.clip(0, grey.shape[0] - 1), column.clip(0, grey.shape[1] - 1)].astype(float)
    even = np.add.outer(np.arange(row.shape[0]), np.arange(row.shape[1])) % 2 == 0
    first, second = light[inside & even], light[inside & ~even]
    if first.size and second.size and first.mean() > second.mean():
        grid = grid[::-1, ::-1]
    return grid


@lru_cache(maxsize=64)
def _charuco_detector(face: Face, legacy: bool) -> cv2.aruco.CharucoDetector:
    markers = cv2.aruco.DetectorParameters()
    charuco = cv2.aruco.CharucoParameters()
    charuco.minMarkers = 1
    charuco.tryRefineMarkers = True
    return cv2.aruco.CharucoDetector(face.charuco(legacy), charuco, markers)


def _charuco(grey: NDArray[np.uint8], face: Face, legacy: bool) -> tuple[Integers, Floats]:
    pixels, numbers, _, _ = _charuco_detector(face, legacy).detectBoard(grey)
    if numbers is None or len(numbers) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    return numbers.ravel().astype(np.int64), np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


@lru_cache(maxsize=64)
def _marker_detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARIES[dictionary]), parameters)


def _aprilgrid(grey: NDArray[np.uint8], face: Face) -> tuple[Integers, Floats]:
    rings, numbers, _ = _marker_detector(face.dictionary).detectMarkers(grey)
    if numbers is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    found: dict[int, Floats] = {}
    for ring, number in zip(rings, numbers.ravel(), strict=True):
        if 0 <= number - face.first_marker < len(face.marker_ids):
            corners = edge_corners(grey, np.asarray(ring, dtype=np.float64).reshape(4, 2), face.aruco.markerSize + 2)
            if corners is not None:
                found[int(number - face.first_marker)] = corners
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    return np.concatenate([4 * number + np.arange(4) for number in found]), np.concatenate(list(found.values()))


def dictionaries_seen(greys: Sequence[NDArray[np.uint8]], least: int = 4) -> list[str]:
    """Dictionaries of which at least so many different markers are in the pictures, best first."""
    counts: dict[str, int] = {}
    for name in DICTIONARIES:
        seen: set[int] = set()
        for grey in greys:
            for picture in (grey, np.asarray(255 - grey, dtype=np.uint8)):
                _, numbers, _ = _marker_detector(name).detectMarkers(picture)
                seen |= set() if numbers is None else {int(number) for number in numbers.ravel()}
        if len(seen) >= least:
            counts[name] = len(seen)
    return sorted(counts, key=lambda name: (-counts[name], len(name), name))
