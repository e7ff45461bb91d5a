"""Boards as PDF files with nothing but vectors, at true scale."""

from __future__ import annotations

import io

from reportlab.pdfgen.canvas import Canvas

from frametwin.calibration.boards import Board
from frametwin.calibration.sheets import Sheet, sheet
from frametwin.files import PathLike, write_bytes

POINT = 72.0 / 25.4
"""Points in a mm."""

LINE = 0.1
"""Width of thin lines in mm."""


def write_board(path: PathLike, board: Board, page: str | None = None) -> Sheet:
    """Write a board to print.

    Parameters
    ----------
    path
        The PDF file to be.
    board, page
        See `frametwin.calibration.sheets.sheet`.

    Returns
    -------
    What was drawn.

    Raises
    ------
    InputError
        If it does not fit on the page, or the file cannot be written.
    """
    drawn = sheet(board, page)
    write_bytes(path, board_pdf(drawn, board.text))
    return drawn


def board_pdf(drawn: Sheet, title: str) -> bytes:
    """A sheet as a PDF file; the same sheet gives the same bytes."""
    stream = io.BytesIO()
    canvas = Canvas(stream, pagesize=(drawn.width * POINT, drawn.height * POINT), invariant=1)
    canvas.setTitle(title)
    canvas.setCreator("FrameTwin")
    canvas.setViewerPreference("PrintScaling", "None")
    canvas.scale(POINT, POINT)
    filled = canvas.beginPath()
    for polygon in drawn.black:
        filled.moveTo(*polygon[0])
        for point in polygon[1:]:
            filled.lineTo(*point)
        filled.close()
    canvas.drawPath(filled, stroke=0, fill=1)
    canvas.setLineWidth(LINE)
    for line in drawn.lines:
        canvas.line(*line[0], *line[1])
    canvas.setDash(2.0, 1.5)
    for line in drawn.folds:
        canvas.line(*line[0], *line[1])
    for text, x, y, height in drawn.words:
        canvas.setFont("Helvetica", height)
        canvas.drawString(x, y, text)
    canvas.showPage()
    canvas.save()
    return stream.getvalue()
