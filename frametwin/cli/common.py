"""What the commands share: options, kinds of arguments, reading frames, tables and JSON."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from frametwin.errors import InputError

if TYPE_CHECKING:
    from frametwin.twin import Twin
    from frametwin.wireframe import Wireframe

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
    """Height and width of pictures, written 1200x1600."""

    name = "HxW"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\d{1,5})[x×X](\d{1,5})", str(value).strip())
        if found is None:
            self.fail(f"{value!r} is not height x width in pixels, such as 1200x1600", param, ctx)
        return int(found[1]), int(found[2])


def json_option(function: Function) -> Function:
    """Add ``--json``."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object on standard output, for programs."
    )(function)


def quiet_option(function: Function) -> Function:
    """Add ``--quiet``."""
    return click.option("--quiet", is_flag=True, help="Show no progress on standard error.")(function)


def overwrite_option(what: str) -> Callable[[Function], Function]:
    """Add ``--overwrite``."""
    return click.option("--overwrite", is_flag=True, help=f"Replace {what} if it exists already.")


def load_frame(name: str) -> Wireframe:
    """Read a frame file or a folder with one, or build a frame of the project's own by its name.

    Raises
    ------
    InputError
        If it is neither.
    """
    from frametwin.formats import read_frame
    from frametwin.parametric import FRAMES, named_frame

    if Path(name).exists() or name not in FRAMES:
        return read_frame(name)
    return named_frame(name)


def load_run(path: Path) -> tuple[Twin, Wireframe]:
    """Read a run folder, or its ``twin.json``: the twin, and the plan that it is a twin of.

    Raises
    ------
    InputError
        If a file is missing or damaged, or the two do not belong together.
    """
    from frametwin.formats import frame_json
    from frametwin.twin import read_twin

    twin = read_twin(path)
    frame = frame_json.read((path if path.is_dir() else path.parent) / "frame.json")
    twin.as_wireframe(frame)  # refuses a twin of another frame
    return twin, frame


def is_run(path: Path) -> bool:
    """Whether a path is that of a run folder or of its ``twin.json``."""
    return path.name == "twin.json" or (path / "twin.json").is_file()


def check_output_folder(path: Path, overwrite: bool, mark: str) -> None:
    """Refuse an output folder before the work begins, and not only when its result is written.

    Parameters
    ----------
    path
        The folder to be.
    overwrite
        Whether it may be replaced.
    mark
        The file that shows that the folder was made by the same command. Other folders are never replaced,
        lest a slip of the finger deletes somebody's work.

    Raises
    ------
    InputError
        If it is a file, or a folder with something in it that may not be replaced.
    """
    above = next(parent for parent in (path, *path.absolute().parents) if parent.exists())
    if not above.is_dir():
        problem = "is the name of a file" if above == path else f"lies below the file {above}"
        raise InputError.at(path, "--out", problem, "choose another name for the folder")
    if not os.access(above, os.W_OK):
        raise InputError.at(path, "--out", "cannot be written", "choose a place that is writable")
    if not path.is_dir() or not any(path.iterdir()):
        return
    if not overwrite:
        raise InputError.at(path, "--out", "exists and is not empty", "choose another folder, or give --overwrite")
    if not (path / mark).is_file():
        raise InputError.at(
            path, "--out", f"holds something else (there is no {mark})", "choose another folder, or empty it"
        )


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


def listed(indices: Sequence[int], most: int = 20) -> str:
    """Indices as text; beyond ``most`` only how many more there are."""
    shown = ", ".join(str(int(i)) for i in indices[:most])
    more = len(indices) - most
    return f"{shown} and {more} more" if more > 0 else shown or "none"
