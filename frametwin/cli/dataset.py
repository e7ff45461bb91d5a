"""``frametwin dataset``: make datasets, check them, look at them, hand them on, fit them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from frametwin.cli.common import (
    FOLDER,
    json_option,
    print_facts,
    print_json,
    quiet_option,
    scheduler_option,
    workers_option,
)
from frametwin.cli.dataset_checks import validate_command
from frametwin.cli.dataset_export import export_command
from frametwin.cli.dataset_fit import fit_command
from frametwin.cli.dataset_view import view_command
from frametwin.cli.display import Display
from frametwin.wording import shortened


class Shard(click.ParamType):
    """Which part of the samples, written 2/3."""

    name = "i/n"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", str(value).strip())
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            self.fail(f"{value!r} is not i/n with i from 1 to n, such as 2/3", param, ctx)
        return int(found[1]), int(found[2])


@click.group("dataset", short_help="Make, check, view, export and fit datasets of captures.")
def command() -> None:
    """Captures with exact truth by the thousand.

    A RECIPE is a TOML file (datasets/*.toml) that says what frames, deformations, states of printing, cameras and
    pictures samples are drawn from. A sample is a capture folder and depends on the dataset's seed and its own index
    alone, so every sample can be made again by itself, on any machine.

    \b
    Try it:
      frametwin dataset generate datasets/demo.toml --out out/demo
      frametwin dataset validate out/demo
      frametwin dataset fit out/demo
      frametwin dataset view out/demo
    """


@command.command("generate", short_help="Make the samples of a recipe; go on where an earlier run stopped.")
@click.argument("recipe", type=FOLDER)
@click.option("--out", type=FOLDER, required=True, metavar="DIR", help="The dataset's folder.")
@click.option("--count", type=click.IntRange(1), help="Number of samples.  [default: the recipe's]")
@click.option("--seed", type=click.IntRange(0), help="Of all that is drawn.  [default: the recipe's]")
@click.option(
    "--shard", type=Shard(), default="1/1", help="Make only every n-th sample, from the i-th on; for render farms."
)
@workers_option
@scheduler_option
@click.option(
    "--per-process",
    type=click.IntRange(1),
    default=25,
    show_default=True,
    help="Samples after which a fresh process takes over, since Blender's memory grows.",
)
@quiet_option
@json_option
def generate_command(recipe: Path, out: Path, quiet: bool, as_json: bool, **settings: Any) -> int:
    """Make the samples of RECIPE in DIR: captures with pictures by Blender, their exact truth, and hashes of both.

    Samples are written whole or not at all. Run the same command again to go on after an interruption: samples that
    are there are checked by their hashes, and made again only if they are damaged. A sample that fails is reported at
    the end and does not stop the run; the exit code is 1 then.

    \b
    Examples:
      frametwin dataset generate datasets/demo.toml --out out/demo
      frametwin dataset generate datasets/paper.toml --out out/paper --count 1000 --workers 2
      frametwin dataset generate datasets/photo.toml --out /share/photo --shard 3/8
    """
    from frametwin.dataset.generate import GenerateSettings, generate

    with Display(quiet) as display:
        report = generate(recipe, out, GenerateSettings(**settings), display)
    if as_json:
        print_json({"out": out, **vars(report)})
        return int(bool(report.failed))
    facts = [
        ("made", f"{len(report.made)} samples in {report.seconds:.1f} s"),
        ("there already", f"{len(report.kept)}"),
    ]
    if report.busy:
        facts.append(("left to another run", shortened(report.busy)))
    facts.append(("next", f"frametwin dataset validate {out}"))
    print_facts(f"dataset: {out}", facts)
    for index, reason in sorted((i, text) for i, text in report.damaged.items() if i in report.made):
        click.echo(f"Sample {index} was made again: {reason}", err=True)
    for index, reason in sorted(report.failed.items()):
        click.echo(f"Sample {index} failed: {reason}", err=True)
    return int(bool(report.failed))


for _command in (validate_command, fit_command, view_command, export_command):
    command.add_command(_command)
