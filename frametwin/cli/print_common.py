"""What the commands for printing share."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from frametwin.cli.common import FOLDER, Positive
from frametwin.wording import enumerated

Function = TypeVar("Function", bound=Callable[..., Any])

KINDS = (
    "old-capture",
    "wrong-batch",
    "collapsed",
    "poor-fit",
    "wrong-twin",
    "camera-moved",
    "displacement",
    "lost-struts",
    "low-confidence",
    "below-plate",
    "contact",
)
"""As `frametwin.printing.job.answer.ACCEPTABLE`, which takes seconds to import."""

FORMATS = ("json", "urscript", "gcode", "rapid", "krl", "compas", "assembly")
"""As `frametwin.printing.toolpath.robot_files.FORMATS`."""

ROBOTS = ("ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e", "ur16e", "ur20", "ur30")
"""As `frametwin.printing.toolpath.ur_arms.ARMS`."""


class Numbers(click.ParamType):
    """So many numbers, with commas between them."""

    name = "numbers"

    def __init__(self, names: str) -> None:
        self.names = names
        self.count = len(names.split(","))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        parts = re.split(r"\s*[,;]\s*|\s+", str(value).strip())
        try:
            numbers = tuple(float(part) for part in parts)
        except ValueError:
            numbers = ()
        if len(numbers) != self.count or not all(abs(number) < 1e9 for number in numbers):
            self.fail(f"{value!r} is not {self.names} in mm", param, ctx)
        return numbers


class Formats(click.ParamType):
    """Names of formats, with commas between them."""

    name = "formats"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        if isinstance(value, tuple):
            return value
        names = tuple(dict.fromkeys(part for part in re.split(r"[,\s]+", str(value)) if part))
        wrong = [name for name in names if name not in FORMATS]
        if wrong or not names:
            self.fail(f"{value!r} is not a list of {', '.join(FORMATS)}", param, ctx)
        return names


def accept_option(function: Function) -> Function:
    """Add ``--accept``."""
    return click.option(
        "--accept",
        multiple=True,
        type=click.Choice(KINDS),
        help="Print on in spite of this doubt; can be given several times, and is kept in the batch's report.",
    )(function)


def order_options(function: Function) -> Function:
    """Add the options that say how a frame is printed."""
    for option in reversed(
        (
            click.option(
                "--order", type=FOLDER, help="A file with an order to keep: pychoreo, RL3DP path, or a sequence."
            ),
            click.option(
                "--batch-size",
                type=click.IntRange(1),
                help="Struts between two looks of the cameras, about.  [default: a twentieth of all, 4 to 12]",
            ),
            click.option(
                "--max-tilt",
                "max_tilt_deg",
                type=click.FloatRange(0.0, 89.0),
                default=60.0,
                show_default=True,
                help="Degrees by which the tool may lean; 0 for machines with three axes.",
            ),
            click.option(
                "--tip-radius", type=Positive(), help="Of the nozzle's flat end in mm.  [default: suits the struts]"
            ),
            click.option("--cone-length", type=Positive(), help="From the tip to the extruder's body in mm."),
            click.option("--cone-radius", type=Positive(), help="Of the cone's upper end in mm."),
            click.option("--body-radius", type=Positive(), help="Of the extruder's body in mm."),
        )
    ):
        function = option(function)
    return function


COUPON = 20
"""Struts of a coupon: each flows by 30 % faster or slower than the others, their mean by 7."""

SUPPORTS = 6
"""Columns below joints that sag: simulated prints of 70 to 250 struts came out half as far off with them."""


class OptionalCount(click.IntRange):
    """A number that may be left out, so that what follows may be meant for something else."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if isinstance(value, str) and not value.strip().lstrip("+-").isdecimal():
            self.fail(f"{value!r} is no number; give one, or put the option last", param, ctx)
        return super().convert(value, param, ctx)


def loop_options(function: Function) -> Function:
    """Add the options that say how a job goes on from batch to batch."""
    for option in reversed(
        (
            click.option(
                "--adapt",
                "way",
                type=click.Choice(WAYS),
                default="forecast",
                show_default=True,
                help="Print against the drift that is still to come, or, as the paper does, meet what the twin saw.",
            ),
            click.option(
                "--anticipate/--no-anticipate",
                default=None,
                help="Lay struts where their joints will be by then, or where they were seen.  [default: as --adapt]",
            ),
            click.option(
                "--compensate/--no-compensate",
                default=None,
                help="Print against the sag that is still to come.  [default: as --adapt]",
            ),
            click.option(
                "--material", type=FOLDER, help="What an earlier job has learnt: that JOB, or its material.json."
            ),
            click.option(
                "--coupon",
                type=OptionalCount(0, 1000),
                is_flag=False,
                flag_value=COUPON,
                default=0,
                metavar="[STRUTS]",
                help="First lay so many single struts around the frame, which droop and tell of the material.  "
                f"[default: none; {COUPON} where no number is given]",
            ),
            click.option(
                "--supports",
                type=OptionalCount(0, 100),
                is_flag=False,
                flag_value=SUPPORTS,
                default=0,
                metavar="[COLUMNS]",
                help="Print temporary supports, so many columns from the plate to the joints that would sag furthest.  "
                f"[default: none; {SUPPORTS} where no number is given]",
            ),
            click.option(
                "--reprint/--no-reprint",
                default=None,
                help="Lay lost struts again at the start of the next batch.  [default: in simulations that adapt]",
            ),
        )
    ):
        function = option(function)
    return function


WAYS = ("forecast", "paper")
"""``paper`` is plain adaptation, which neither anticipates nor compensates."""


def steering(way: str, anticipate: bool | None, compensate: bool | None, adapts: bool = True) -> dict[str, Any]:
    """What the options of `loop_options` mean for a job."""
    forecasts = adapts and way == "forecast"
    return {
        "adapt": adapts,
        "anticipate": forecasts if anticipate is None else anticipate,
        "compensate": forecasts if compensate is None else compensate,
    }


def supports_told(joints: Sequence[int], asked: int) -> str:
    """What to tell of columns below some joints."""
    where = f"{'a column' if len(joints) == 1 else 'columns'} below joint{'' if len(joints) == 1 else 's'}"
    fewer = "" if len(joints) == asked else f" ({len(joints)} of {asked}: no further one helps)"
    return f"{where} {enumerated(joints)}{fewer}; cut off when all has cooled"


NOZZLE = ("tip_radius", "cone_length", "cone_radius", "body_radius")


def split_nozzle(settings: dict[str, Any]) -> dict[str, Any]:
    """Settings with the sizes of the nozzle, where given, under one name."""
    sizes = {name: settings[name] for name in NOZZLE if settings.get(name) is not None}
    return {**{key: value for key, value in settings.items() if key not in NOZZLE}, "nozzle": sizes}


def read_base(value: str | None) -> tuple[tuple[float, ...], ...] | None:
    """The robot's base: X,Y,Z or X,Y,Z,DEGREES, or a rigid matrix out of a JSON file ({"base": [[4 numbers], ...]}).

    Raises
    ------
    InputError
        If it is none of these.
    """
    from frametwin.arrays import checked_array
    from frametwin.errors import InputError
    from frametwin.files import read_json

    if value is None:
        return None
    if Path(value).is_file():
        matrix = checked_array(read_json(value).get("base"), "f", (4, 4), value, "base")
        return tuple(tuple(row) for row in matrix.tolist())
    parts = value.split(",")
    try:
        x, y, z, turn = (*(float(part) for part in parts), *([0.0] * (4 - len(parts))))
    except ValueError as error:
        problem = f"{value!r} is neither numbers nor a file that exists"
        raise InputError.at("--base", "value", problem, "give X,Y,Z or X,Y,Z,DEGREES, or a JSON file") from error
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    return ((cos, -sin, 0.0, x), (sin, cos, 0.0, y), (0.0, 0.0, 1.0, z), (0.0, 0.0, 0.0, 1.0))
