"""What the commands share: options, kinds of arguments, reading frames, tables and JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from frametwin.wording import parsed_size

if TYPE_CHECKING:
    from frametwin.geometry.wireframe import Wireframe

Function = TypeVar("Function", bound=Callable[..., Any])

FOLDER = click.Path(path_type=Path)
"""A path of which the library itself checks whether it can be used."""


class Positive(click.ParamType):
    """A finite number above 0, and up to a limit where there is one."""

    name = "number"

    def __init__(self, highest: float = math.inf) -> None:
        self.highest = highest

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = math.nan
        if not (0.0 < number <= self.highest and math.isfinite(number)):
            limit = "" if math.isinf(self.highest) else f" and up to {self.highest:g}"
            self.fail(f"{value!r} is not a number above 0{limit}", param, ctx)
        return number


class Size(click.ParamType):
    """Size of pictures, written 1600x1200 with the width first; becomes (height, width), as arrays have it."""

    name = "WIDTHxHEIGHT"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        size = parsed_size(str(value))
        if size is None:
            self.fail(f"{value!r} is not width x height in pixels, such as 1600x1200", param, ctx)
        return size


def size_option(function: Function) -> Function:
    """Add ``--size``."""
    return click.option(
        "--size",
        type=Size(),
        default="1600x1200",
        show_default=True,
        metavar="WIDTHxHEIGHT",
        help="Of the pictures, in pixels.",
    )(function)


def json_option(function: Function) -> Function:
    """Add ``--json``."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object on standard output, for programs."
    )(function)


def quiet_option(function: Function) -> Function:
    """Add ``--quiet``."""
    return click.option("--quiet", is_flag=True, help="Show no progress on standard error.")(function)


def workers_option(function: Function) -> Function:
    """Add ``--workers``."""
    return click.option(
        "--workers",
        type=click.IntRange(1, 1024),
        default=1,
        show_default=True,
        help="Processes on this machine (Dask).",
    )(function)


def scheduler_option(function: Function) -> Function:
    """Add ``--scheduler``."""
    return click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="A Dask scheduler that exists, as tcp://10.0.0.1:8786; its workers need the project installed and the"
        " same folders.",
    )(function)


def overwrite_option(what: str) -> Callable[[Function], Function]:
    """Add ``--overwrite``."""
    return click.option("--overwrite", is_flag=True, help=f"Replace {what} if it exists already.")


def load_frame(name: str) -> Wireframe:
    """See `frametwin.formats.find_frame`."""
    from frametwin.formats import find_frame

    return find_frame(name)


def check_output_folder(path: Path, overwrite: bool, mark: str) -> None:
    """Refuse an output folder before the work begins; see `frametwin.twin.runs.require_free`."""
    from frametwin.twin.runs import require_free

    require_free(path, overwrite, mark, "--out", "give --overwrite")


def print_json(data: dict[str, Any]) -> None:
    """Print an object for programs."""
    from frametwin.files import dump_json

    click.echo(dump_json(data), nl=False)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; all columns but the first are aligned to the right."""
    table = [columns, *rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(columns))]
    click.echo()
    click.secho(title, bold=True)
    for row in table:
        cells = [cell.rjust(width) for cell, width in zip(row, widths, strict=True)]
        click.echo("  " + "   ".join([row[0].ljust(widths[0]), *cells[1:]]).rstrip())
        if row is columns:
            click.echo("  " + "-" * (sum(widths) + 3 * (len(widths) - 1)))
    click.echo()


def print_facts(title: str, facts: Sequence[tuple[str, str]]) -> None:
    """Print a heading and names with their values, one a line."""
    click.secho(title, bold=True)
    width = max(len(name) for name, _ in facts)
    for name, value in facts:
        click.echo(f"  {name:<{width}}  {value}")
