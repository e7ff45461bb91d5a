"""``frametwin calibrate board``: a board to print."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, Positive, json_option, print_facts, print_json
from frametwin.errors import InputError

KINDS = ("checkerboard", "charuco", "aprilgrid", "cuboid", "plate")
USUAL_SIZE = {"checkerboard": "9x6", "charuco": "7x5", "aprilgrid": "6x4", "plate": "10x7"}
USUAL_SQUARE = {"checkerboard": 25.0, "charuco": 35.0, "aprilgrid": 40.0, "plate": 40.0}


@click.command("board", short_help="Write a board to print, as PDF.")
@click.option(
    "--kind",
    type=click.Choice(KINDS),
    help="What to print; cuboid is a net to fold around a block, plate a border of tags to print on.",
)
@click.option("--size", metavar="COLUMNSxROWS", help="As in --board; of a cuboid its edges in mm.")
@click.option("--square", type=Positive(), help="Edge of a square in mm.")
@click.option("--marker", type=Positive(), help="Edge of a marker in mm.  [default: three quarters of the square]")
@click.option("--dictionary", help="Of the markers, as OpenCV calls it.")
@click.option("--board", metavar="BOARD", help="All of this at once, as the other commands take it.")
@click.option("--page", help="a4 to a0, or letter.  [default: the smallest of a4 to a0 that holds it]")
@click.option("--out", type=FOLDER, required=True, metavar="PDF", help="The file to write.")
@click.option("--overwrite", is_flag=True, help="Replace the file if it exists already.")
@json_option
def board_command(
    kind: str | None,
    size: str | None,
    square: float | None,
    marker: float | None,
    dictionary: str | None,
    board: str | None,
    page: str | None,
    out: Path,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Write a board at true scale, with a ruler on it to check the printer.

    \b
    Examples:
      frametwin calibrate board --kind charuco --out board.pdf
      frametwin calibrate board --kind checkerboard --size 9x6 --square 25 --out board.pdf
      frametwin calibrate board --kind cuboid --out block.pdf
      frametwin calibrate board --kind plate --size 10x7 --square 40 --out plate.pdf
    """
    text = board or _written(kind, size, square, marker, dictionary)
    if board and any(value is not None for value in (kind, size, square, marker, dictionary)):
        raise InputError.at("--board", board, "is given together with its parts", "give either --board or --kind")
    if out.exists() and not overwrite:
        raise InputError.at(out, "file", "exists", "choose another name, or give --overwrite")
    from frametwin.calibration.board_pdf import write_board
    from frametwin.calibration.boards import parse_board

    chosen = parse_board(text, "--board" if board else "--kind")
    drawn = write_board(out, chosen, page)
    if as_json:
        print_json({"out": out, "board": chosen.text, "page": [drawn.width, drawn.height]})
        return
    print_facts(
        f"board: {out}",
        [
            ("board", f"--board {chosen.text}"),
            ("page", f"{drawn.width:g} x {drawn.height:g} mm; print at 100 %, and measure the ruler: 100 mm"),
        ],
    )


def _written(
    kind: str | None, size: str | None, square: float | None, marker: float | None, dictionary: str | None
) -> str:
    if kind is None:
        raise InputError.at("--kind", "board", "is missing", f"give one of {', '.join(KINDS)}, or --board")
    parts = [kind]
    if kind != "cuboid":
        parts += [size or USUAL_SIZE[kind], f"{square or USUAL_SQUARE[kind]:g}"]
        if marker or dictionary:
            parts.append(f"{marker or 0.75 * (square or USUAL_SQUARE[kind]):g}")
    elif size or square or marker or dictionary:
        parts += [size or "50x60x70", f"{square or 12.0:g}", f"{marker or (square or 12.0) * 2.0 / 3.0:g}"]
    return ":".join([*parts, *([dictionary] if dictionary else [])])
