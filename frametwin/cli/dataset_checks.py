"""``frametwin dataset validate``: whether a dataset is what it says it is."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, json_option, print_json, quiet_option, scheduler_option, workers_option
from frametwin.cli.display import Display

MOST_PROBLEMS = 5
"""Of one sample that are told; --json tells all."""


@click.command("validate", short_help="Check every file, camera, curve and picture of a dataset.")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option("--partial", is_flag=True, help="Samples may be absent, as in one shard of several.")
@workers_option
@scheduler_option
@quiet_option
@json_option
def validate_command(
    folder: Path, partial: bool, workers: int, scheduler: str | None, quiet: bool, as_json: bool
) -> int:
    """Check the dataset in DIR.

    Every file is there and readable, of the size and hash that is noted; no picture is black or saturated; cameras
    invert; the struts of the truth meet at their joints; the true curves, drawn into every view, agree with its
    picture to a pixel; curves.npz and the passes agree with truth, cameras and pictures.

    It says which sample is bad and why. Exit codes: 0 all is fine, 1 something is bad, 2 this is no dataset.

    \b
    Examples:
      frametwin dataset validate out/demo
      frametwin dataset validate out/paper --workers 2 --json
    """
    from frametwin.dataset.validate import validate_dataset

    with Display(quiet) as display:
        found = validate_dataset(folder, partial=partial, workers=workers, scheduler=scheduler, progress=display)
    if as_json:
        print_json(found.as_dict())
        return int(not found.fine)
    for bad in found.findings:
        click.echo(f"Sample {bad.index} ({bad.folder}) is bad:")
        for problem in bad.problems[:MOST_PROBLEMS]:
            click.echo(f"  - {problem}")
        more = len(bad.problems) - MOST_PROBLEMS
        if more > 0:
            click.echo(f"  - and {more} more; --json tells all")
    for problem in found.problems:
        click.echo(f"The dataset is not whole: {problem}.")
    for entry in found.dataset.failed:
        click.echo(f"Sample {entry.index} could not be made: {entry.reason}")
    if found.findings:
        click.echo(f"{len(found.findings)} of {found.checked} samples are bad.")
    else:
        click.echo(f"All {found.checked} samples of {folder} are fine.")
    return int(not found.fine)
