"""Sheets to print: where on the paper the faces of a board lie, the ruler, the folds and the words."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from frametwin.calibration.boards import Board, Face, faces
from frametwin.calibration.patterns import black_rectangles
from frametwin.errors import InputError

Floats = NDArray[np.float64]

PAGES = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "a2": (420.0, 594.0), "a1": (594.0, 841.0), "a0": (841.0, 1189.0)}
PAGES |= {"letter": (215.9, 279.4)}
MARGIN = 6.0
"""White around everything, which printers leave."""

FOOT = 26.0
"""Height below the pattern for ruler and words."""

RULER = 100.0
TAB = 7.0
"""Width of the flaps that are glued, mm."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """A page in mm from its lower left corner.

    Attributes
    ----------
    width, height
        Of the page.
    black
        Polygons (4, 2) that are filled.
    lines
        Thin lines (2, 2): ruler and cuts.
    folds
        Dashed lines (2, 2).
    words
        Text with the place of its left end and its height in mm.
    origins : list of (4, 4) arrays
        Where each face lies: from its own axes to the page.
    """

    width: float
    height: float
    black: list[Floats] = field(default_factory=list)
    lines: list[Floats] = field(default_factory=list)
    folds: list[Floats] = field(default_factory=list)
    words: list[tuple[str, float, float, float]] = field(default_factory=list)
    origins: list[Floats] = field(default_factory=list)


def sheet(board: Board, page: str | None = None) -> Sheet:
    """Lay a board out on a page.

    Parameters
    ----------
    board
        The board.
    page
        One of `PAGES`; by default the smallest of the A series that holds it.

    Raises
    ------
    InputError
        If it does not fit.
    """
    all_faces = faces(board)
    if board.kind == "cuboid":
        a, b, c = board.edges
        wide, high = a + 2.0 * c, b + 2.0 * c  # the flaps lie within
    else:
        # A white rim of half a square (a whole one of a checkerboard is usual) lets the outer squares be found.
        rim = 0.5 * board.square
        wide, high = (side + 2.0 * min(rim, 15.0) for side in all_faces[0].size)
    width, height = _page(board, page, wide, high)
    result = Sheet(width, height)
    middle = np.array([0.5 * width, FOOT + MARGIN + 0.5 * (height - FOOT - 2.0 * MARGIN)])
    for face in all_faces:
        origin = _origin(board, face, middle)
        result.origins.append(origin)
        for left, bottom, right, top in black_rectangles(face):
            result.black.append(_placed(origin, [[left, bottom], [right, bottom], [right, top], [left, top]]))
    if board.kind == "cuboid":
        _net(result, board, middle)
    _ruler(result)
    _explain(result, board)
    return result


def _page(board: Board, page: str | None, wide: float, high: float) -> tuple[float, float]:
    names = [page.lower()] if page else ["a4", "a3", "a2", "a1", "a0"]
    if names[0] not in PAGES:
        raise InputError.at("--page", str(page), "is not a page", f"use one of {', '.join(PAGES)}")
    for name in names:
        short, long = PAGES[name]
        for width, height in ((short, long), (long, short)):
            if wide <= width - 2.0 * MARGIN and high <= height - 2.0 * MARGIN - FOOT:
                return width, height
    problem = f"{wide:.0f} x {high:.0f} mm do not fit on {names[-1]} beside the ruler"
    raise InputError.at("--board", board.text, problem, "give smaller or fewer squares, or a larger --page")


def _origin(board: Board, face: Face, middle: Floats) -> Floats:
    """From a face's axes to the page; the sides of a cuboid lie around its top, their upper edge towards it."""
    origin = np.eye(4)
    origin[:2, 3] = middle
    if board.kind != "cuboid" or face.name == "top":
        return origin
    a, b, c = board.edges
    turn, away = {
        "front": (0.0, (0.0, -0.5 * (b + c))),
        "right": (0.5 * np.pi, (0.5 * (a + c), 0.0)),
        "back": (np.pi, (0.0, 0.5 * (b + c))),
        "left": (-0.5 * np.pi, (-0.5 * (a + c), 0.0)),
    }[face.name]
    origin[:2, :2] = np.round([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]], 12)
    origin[:2, 3] += away
    return origin


def _placed(origin: Floats, points: list[list[float]]) -> Floats:
    return np.array(points) @ origin[:2, :2].T + origin[:2, 3]


def _net(result: Sheet, board: Board, middle: Floats) -> None:
    """Folds around the top, cuts around the sides, and flaps on the front and the back."""
    a, b, c = board.edges
    for face, origin in zip(faces(board), result.origins, strict=True):
        if face.name == "top":
            x, y = 0.5 * a, 0.5 * b
            ring = np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) + middle
            result.folds.extend(np.stack([ring[i], ring[(i + 1) % 4]]) for i in range(4))
            continue
        x, y = 0.5 * face.size[0], 0.5 * c
        sides = [[[-x, y], [-x, -y]], [[x, y], [x, -y]]]
        result.lines.append(_placed(origin, [[-x, -y], [x, -y]]))
        if face.name in ("left", "right"):
            result.lines.extend(_placed(origin, side) for side in sides)
            continue
        result.folds.extend(_placed(origin, side) for side in sides)
        for sign in (-1.0, 1.0):
            flap = [[x * sign, y], [(x + TAB) * sign, y - TAB], [(x + TAB) * sign, TAB - y], [x * sign, -y]]
            result.lines.extend(_placed(origin, [flap[i], flap[i + 1]]) for i in range(3))


def _ruler(result: Sheet) -> None:
    left, low = MARGIN + 4.0, MARGIN + 12.0
    result.lines.append(np.array([[left, low], [left + RULER, low]]))
    for i in range(int(RULER) + 1):
        tall = 5.0 if i % 10 == 0 else 3.5 if i % 5 == 0 else 2.0
        result.lines.append(np.array([[left + i, low], [left + i, low + tall]]))
    for i in range(0, int(RULER) + 1, 10):
        result.words.append((str(i), left + i - 0.8 * len(str(i)), low + 6.0, 2.4))


def _explain(result: Sheet, board: Board) -> None:
    words = [
        "Print at 100 %, not fitted to the page; the ruler has to be 100 mm long. Glue it on something flat.",
        f"--board {board.text}",
    ]
    if board.kind == "checkerboard":
        words[1] += f"   ({board.columns + 1} x {board.rows + 1} squares of {board.square:g} mm)"
    if board.kind == "cuboid":
        words[0] = (
            "Print at 100 %; the ruler has to be 100 mm long. Cut the lines, fold the dashed ones, glue on a block."
        )
    for i, text in enumerate(words):
        result.words.append((text, MARGIN + 4.0, MARGIN + 6.0 - 4.5 * i, 2.6))
