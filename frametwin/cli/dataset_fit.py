"""``frametwin dataset fit``: the twins of a whole dataset and their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import (
    FOLDER,
    json_option,
    print_json,
    print_table,
    quiet_option,
    scheduler_option,
    workers_option,
)
from frametwin.cli.display import Display
from frametwin.cli.fit import PRESETS, parse_changes

if TYPE_CHECKING:
    from frametwin.dataset.fits import FitRow

MOST_ROWS = 40
"""Of the table that is printed; ``errors.csv`` has all."""

HEADINGS = (
    "sample", "frame", "struts", "views", "seconds",
    "curves mean", "p95", "max", "joints mean", "max", "equal mean", "max", "missing",
)  # fmt: skip
FIGURES = ("curves_mean", "curves_p95", "curves_max", "joints_mean", "joints_max", "equal_mean", "equal_max")


@click.command("fit", short_help="Fit every sample of a dataset and make a table of the errors.")
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option("--preset", type=click.Choice(PRESETS), default="fast", show_default=True, help="See frametwin fit.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of what the preset draws.")
@click.option("--set", "assignments", multiple=True, metavar="NAME=VALUE", help="Change a setting; see frametwin fit.")
@click.option("--again", is_flag=True, help="Fit samples again that have been fitted with the same settings.")
@workers_option
@scheduler_option
@quiet_option
@json_option
def fit_command(folder: Path, quiet: bool, as_json: bool, **options: Any) -> int:
    """Fit every sample of the dataset in DIR, and compare the twins with the truth.

    The run of sample 3 is the folder DIR/runs/000003. Run the same command again to go on after an interruption: a
    run that was made from the same files with the same settings is kept. The errors go to DIR/errors.csv and
    DIR/fit.json, in mm. A sample that fails is told at the end and does not stop the others; the exit code is 1 then.

    \b
    Examples:
      frametwin dataset fit out/demo
      frametwin dataset fit out/demo --preset paper-lattice --set iterations=50
    """
    from frametwin.dataset.fits import DatasetFitSettings, fit_dataset, summarise
    from frametwin.fitting.api import settings_of

    preset, seed = options.pop("preset"), options.pop("seed")
    settings = DatasetFitSettings(preset, seed, parse_changes(options.pop("assignments"), settings_of(preset, seed)))
    with Display(quiet) as display:
        rows = fit_dataset(folder, settings, progress=display, **options)
    summary = summarise(rows)
    if as_json:
        print_json({"dataset": folder, "preset": preset, "summary": summary, "samples": [asdict(row) for row in rows]})
        return int(summary["failed"] > 0)
    _print(folder, rows, summary)
    return int(summary["failed"] > 0)


def _print(folder: Path, rows: Sequence[FitRow], summary: dict[str, Any]) -> None:
    good = [row for row in rows if row.error is None]
    shown = sorted(good, key=lambda row: -(row.curves_mean or 0.0))[:MOST_ROWS] if len(good) > MOST_ROWS else good
    title = f"Errors of {folder} in mm" + (f", the worst {MOST_ROWS} samples" if len(good) > MOST_ROWS else "")
    if good:
        print_table(title, HEADINGS, [*map(_cells, shown), _total(summary)])
    for row in rows:
        if row.error is not None:
            click.echo(f"Sample {row.index} failed: {row.error}", err=True)
    kept = sum(row.kept for row in good)
    click.echo(f"{len(good)} of {len(rows)} samples fitted ({kept} of them before); see {folder / 'errors.csv'}")


def _cells(row: FitRow) -> list[str]:
    found, missing = row.found or 0, (row.found or 0) + (row.overlooked or 0)
    seconds = "" if row.seconds is None else f"{row.seconds:.1f}"
    figures = [f"{getattr(row, name):.3f}" for name in FIGURES]
    return [
        f"{row.index:06d}", str(row.frame), str(row.struts), str(row.views), seconds, *figures, _missing(
            found, missing, row.false or 0
        ),
    ]  # fmt: skip


def _total(summary: dict[str, Any]) -> list[str]:
    figures = [f"{summary[name]:.3f}" for name in FIGURES]
    missing = _missing(summary["found"], summary["found"] + summary["overlooked"], summary["false"])
    return ["all", "mean / max", "", "", f"{summary['seconds']:.1f}", *figures, missing]


def _missing(found: int, missing: int, false: int) -> str:
    """How many missing struts were found, and how many whole ones were suspected."""
    return f"{found}/{missing}" + (f" +{false}" if false else "")
