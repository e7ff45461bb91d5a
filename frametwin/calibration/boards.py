"""Calibration boards: how they are written on the command line, and where their corners are.

A board's own axes have their origin in the middle of the pattern, x along the columns to the right, y up the sheet and
z out of the paper, so a board that lies on a table face up has z up. Of the cuboid the origin is the middle of the
bottom, x along its first edge and y along its second. A plate is a border of tags about a place that stays free for the
print.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from frametwin.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

KINDS = ("checkerboard", "charuco", "aprilgrid", "cuboid", "plate")
DICTIONARIES = {
    name.removeprefix("DICT_"): int(getattr(cv2.aruco, name))
    for name in sorted(dir(cv2.aruco))
    if name.startswith("DICT_")
}
USUAL_DICTIONARY = {
    "charuco": "4X4_250",
    "aprilgrid": "APRILTAG_36h11",
    "cuboid": "4X4_100",
    "plate": "APRILTAG_36h11",
}
MARKER_SHARE = {"charuco": 0.75, "aprilgrid": 0.75, "cuboid": 2.0 / 3.0, "plate": 0.75}
CUBOID_EDGES: tuple[float, ...] = (50.0, 60.0, 70.0)
CUBOID_SQUARE = 12.0
"""The block of the paper's section V.B in mm, and the squares on it."""

LARGEST_COUNT, LARGEST_MM = 100, 5000.0
_FORM = "KIND:COLUMNSxROWS:SQUARE_MM[:MARKER_MM[:DICTIONARY]], such as charuco:7x5:30:22:4X4_250"
_CUBOID_FORM = "cuboid[:50x60x70[:SQUARE_MM[:MARKER_MM[:DICTIONARY]]]]"


@dataclass(frozen=True)
class Board:
    """A board, or a block with boards on its faces.

    Attributes
    ----------
    kind
        One of `KINDS`.
    columns, rows
        Inner corners of a checkerboard (as OpenCV counts), squares of a ChArUco board, tags of an AprilGrid or along
        the sides of a plate; 0 of a cuboid.
    square
        Edge of a square in mm; of an AprilGrid or a plate, the distance from one tag to the next.
    marker
        Edge of a marker in mm; 0 of a checkerboard.
    dictionary
        OpenCV's name of the markers without ``DICT_``; empty for a checkerboard.
    edges
        (3,) of a cuboid in mm.
    """

    kind: str
    columns: int
    rows: int
    square: float
    marker: float = 0.0
    dictionary: str = ""
    edges: tuple[float, ...] = ()

    @property
    def text(self) -> str:
        """The board as it is written on the command line."""
        if self.kind == "checkerboard":
            return f"checkerboard:{self.columns}x{self.rows}:{self.square:g}"
        counts = "x".join(f"{edge:g}" for edge in self.edges) if self.edges else f"{self.columns}x{self.rows}"
        return f"{self.kind}:{counts}:{self.square:g}:{self.marker:g}:{self.dictionary}"


@dataclass(frozen=True, eq=False)
class Face:
    """A flat pattern of a board.

    Attributes
    ----------
    kind
        ``checkerboard``, ``charuco``, ``aprilgrid`` or ``plate``.
    name
        Such as ``top``; empty for a board of one face.
    columns, rows
        As those of `Board`.
    square, marker, dictionary
        As those of `Board`.
    first_marker
        Number of the first marker in the dictionary.
    first_corner
        Number of the first corner among those of the whole board.
    pose : (4, 4) array, mm
        From the face's axes to the board's.
    size
        Width and height of the face in mm, with its white margin; of a board, those of the pattern.
    """

    kind: str
    name: str
    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str
    first_marker: int
    first_corner: int
    pose: Floats
    size: tuple[float, float]

    @property
    def corner_count(self) -> int:
        """How many corners it has."""
        return len(self.flat_corners)

    @property
    def flat_corners(self) -> Floats:
        """(N, 2) corners in the face's own axes, mm: row by row from the top left, four for each tag."""
        if self.kind in ("aprilgrid", "plate"):
            return self.marker_corners.reshape(-1, 2)
        columns, rows = (self.columns, self.rows) if self.kind == "checkerboard" else (self.columns - 1, self.rows - 1)
        y, x = np.mgrid[0:rows, 0:columns].astype(np.float64)
        return self.square * np.stack([x - 0.5 * (columns - 1), 0.5 * (rows - 1) - y], axis=-1).reshape(-1, 2)

    @property
    def marker_corners(self) -> Floats:
        """(M, 4, 2) corners of the markers in the face's own axes, mm: clockwise on the sheet from the top left."""
        if self.kind == "checkerboard":
            return np.zeros((0, 4, 2))
        if self.kind == "charuco":
            found = np.array(self.charuco(False).getObjPoints(), dtype=np.float64)[..., :2]  # from the top left, y down
            middle = 0.5 * self.square * np.array([self.columns, self.rows])
            return (found - middle) * (1.0, -1.0)
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        if self.kind == "plate":
            border = (row % (self.rows - 1) == 0) | (column % (self.columns - 1) == 0)
            row, column = row[border], column[border]
        middle = self.square * np.stack([column - 0.5 * (self.columns - 1), 0.5 * (self.rows - 1) - row], axis=1)
        ring = 0.5 * self.marker * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
        return middle[:, None] + ring

    @property
    def marker_ids(self) -> Integers:
        """(M,) numbers of the markers in the dictionary."""
        count = 0 if self.kind == "checkerboard" else len(self.marker_corners)
        return self.first_marker + np.arange(count)

    @property
    def aruco(self) -> cv2.aruco.Dictionary:
        """The dictionary of the markers."""
        return cv2.aruco.getPredefinedDictionary(DICTIONARIES[self.dictionary])

    def charuco(self, legacy: bool) -> cv2.aruco.CharucoBoard:
        """OpenCV's board, in the pattern of today or that of before OpenCV 4.6."""
        count = self.columns * self.rows // 2
        ids = self.first_marker + np.arange(count, dtype=np.int32)
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, self.aruco, ids)
        if legacy:
            board.setLegacyPattern(True)
        return board


@lru_cache(maxsize=32)
def faces(board: Board) -> tuple[Face, ...]:
    """The flat patterns of a board: one, or the five visible ones of a cuboid."""
    if board.kind != "cuboid":
        pitch = board.columns + 1 if board.kind == "checkerboard" else board.columns
        high = board.rows + 1 if board.kind == "checkerboard" else board.rows
        size = (pitch * board.square, high * board.square)
        return (_face(board, board.kind, "", (board.columns, board.rows), np.eye(4), size, 0, 0),)
    a, b, c = board.edges
    x, y, z = np.eye(3)
    sides = (
        ("top", x, y, (a, b), c * z),
        ("front", x, z, (a, c), 0.5 * c * z - 0.5 * b * y),
        ("right", y, z, (b, c), 0.5 * c * z + 0.5 * a * x),
        ("back", -x, z, (a, c), 0.5 * c * z + 0.5 * b * y),
        ("left", -y, z, (b, c), 0.5 * c * z - 0.5 * a * x),
    )
    found: list[Face] = []
    marker = corner = 0
    for name, right, up, size, middle in sides:
        pose = np.eye(4)
        pose[:3] = np.column_stack([right, up, np.cross(right, up), middle])
        counts = _face_counts(size, board.square)
        found.append(_face(board, "charuco", name, counts, pose, size, marker, corner))
        marker += counts[0] * counts[1] // 2
        corner += found[-1].corner_count
    return tuple(found)


def _face_counts(size: tuple[float, float], square: float) -> tuple[int, int]:
    return int((size[0] + 1e-9) // square), int((size[1] + 1e-9) // square)


def _face(
    board: Board,
    kind: str,
    name: str,
    counts: tuple[int, int],
    pose: Floats,
    size: tuple[float, float],
    marker: int,
    corner: int,
) -> Face:
    return Face(kind, name, *counts, board.square, board.marker, board.dictionary, marker, corner, pose, size)


@lru_cache(maxsize=32)
def corner_points(board: Board) -> Floats:
    """(N, 3) corners of a board in its own axes, mm, in the order of their numbers."""
    parts = []
    for face in faces(board):
        flat = face.flat_corners
        local = np.concatenate([flat, np.zeros((len(flat), 1))], axis=1)
        parts.append(local @ face.pose[:3, :3].T + face.pose[:3, 3])
    points = np.concatenate(parts)
    points.setflags(write=False)
    return points


def looks_the_same_turned(board: Board) -> bool:
    """Whether a half turn of the board cannot be seen, so that its direction is not known from a picture."""
    return board.kind == "checkerboard" and (board.columns + board.rows) % 2 == 0


def parse_board(text: str, source: str = "--board") -> Board:
    """Read a board as it is written on the command line.

    Raises
    ------
    InputError
        If it is no board, or none that can be printed.
    """
    parts = [part.strip() for part in text.split(":")]
    kind = parts[0].lower()
    if kind not in KINDS:
        raise InputError.at(source, text, f"{parts[0]!r} is not a kind of board", f"use one of {', '.join(KINDS)}")
    if kind == "cuboid":
        return _parse_cuboid(parts, text, source)
    most = 3 if kind == "checkerboard" else 5
    found = re.fullmatch(r"(\d{1,4})[x×X*](\d{1,4})", parts[1]) if len(parts) > 1 else None
    if found is None or not 3 <= len(parts) <= most:
        form = "checkerboard:COLUMNSxROWS:SQUARE_MM, such as checkerboard:9x6:25" if most == 3 else _FORM
        raise InputError.at(source, text, "is not written as a board", f"write {form}")
    columns, rows = int(found[1]), int(found[2])
    least = {"checkerboard": 3, "charuco": 3, "aprilgrid": 1, "plate": 3}[kind]
    if not least <= min(columns, rows) <= max(columns, rows) <= LARGEST_COUNT:
        remedy = f"give {least} to {LARGEST_COUNT} columns and rows"
        raise InputError.at(source, text, f"{columns} x {rows} is not a size of such a board", remedy)
    square = _millimetres(parts[2], text, source)
    if kind == "checkerboard":
        return Board(kind, columns, rows, square)
    marker, dictionary = _markers(kind, parts[3:], square, text, source)
    needed = {"charuco": columns * rows // 2, "plate": 2 * (columns + rows) - 4}.get(kind, columns * rows)
    _check_dictionary(dictionary, needed, text, source)
    return Board(kind, columns, rows, square, marker, dictionary)


def _parse_cuboid(parts: list[str], text: str, source: str) -> Board:
    edges = CUBOID_EDGES
    if len(parts) > 5:
        raise InputError.at(source, text, "is not written as a board", f"write {_CUBOID_FORM}")
    if len(parts) > 1:
        sizes = re.split(r"[x×X*]", parts[1])
        if len(sizes) != 3:
            raise InputError.at(source, text, "does not give three edges", f"write {_CUBOID_FORM}")
        edges = tuple(_millimetres(size, text, source) for size in sizes)
    square = _millimetres(parts[2], text, source) if len(parts) > 2 else CUBOID_SQUARE
    marker, dictionary = _markers("cuboid", parts[3:], square, text, source)
    counts = [_face_counts(size, square) for size in ((edges[0], edges[1]), (edges[0], edges[2]), (edges[1], edges[2]))]
    if min(min(pair) for pair in counts) < 3 or max(max(pair) for pair in counts) > LARGEST_COUNT:
        problem = f"squares of {square:g} mm do not make boards of 3 x 3 to {LARGEST_COUNT} x {LARGEST_COUNT} on it"
        raise InputError.at(source, text, problem, "give squares of a quarter of the shortest edge")
    each = [columns * rows // 2 for columns, rows in counts]
    _check_dictionary(dictionary, each[0] + 2 * each[1] + 2 * each[2], text, source)
    return Board("cuboid", 0, 0, square, marker, dictionary, edges)


def _markers(kind: str, parts: list[str], square: float, text: str, source: str) -> tuple[float, str]:
    marker = _millimetres(parts[0], text, source) if parts else MARKER_SHARE[kind] * square
    if not 0.2 * square <= marker < square:
        problem = f"markers of {marker:g} mm do not go with squares of {square:g} mm"
        raise InputError.at(source, text, problem, "give markers that are smaller than the squares, as three quarters")
    name = parts[1] if len(parts) > 1 else USUAL_DICTIONARY[kind]
    known = {key.lower(): key for key in DICTIONARIES}
    wanted = name.lower().removeprefix("dict_")
    wanted = wanted if wanted in known else f"apriltag_{wanted}"
    if wanted not in known:
        raise InputError.at(source, text, f"{name!r} is not a dictionary", f"use one of {', '.join(DICTIONARIES)}")
    return marker, known[wanted]


def _check_dictionary(dictionary: str, needed: int, text: str, source: str) -> None:
    there = len(cv2.aruco.getPredefinedDictionary(DICTIONARIES[dictionary]).bytesList)
    if needed > there:
        problem = f"it has {needed} markers and {dictionary} only {there}"
        raise InputError.at(source, text, problem, "use a dictionary with more markers, such as 4X4_1000")


def _millimetres(value: str, text: str, source: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = 0.0
    if not 0.1 <= number <= LARGEST_MM:
        problem = f"{value!r} is not a length in mm"
        raise InputError.at(source, text, problem, f"give a number from 0.1 to {LARGEST_MM:g}")
    return number
