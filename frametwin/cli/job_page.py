"""Commands that keep a page beside a print job."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from frametwin.progress import ProgressCallback


def page_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--report/--no-report``, which is given to the command as ``page``."""
    return click.option(
        "--report/--no-report",
        "page",
        default=True,
        show_default=True,
        help="Keep JOB/report.html up to date, a page to look at the print and its twins.",
    )(function)


def write_page(job: Path, progress: ProgressCallback | None = None) -> None:
    """Write the page of a job, or say why not."""
    from frametwin.report.beside_job import write_job_page

    problem = write_job_page(job, progress)
    if problem:
        click.echo(problem, err=True)
