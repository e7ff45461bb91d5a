"""``frametwin print status``: how far a job is, and what to do next."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from frametwin.cli.common import FOLDER, json_option, print_json, print_table

if TYPE_CHECKING:
    from frametwin.printing.job.job import PrintJob


@click.command("status", short_help="Show how far a job is, and what to do next.")
@click.argument("job", type=FOLDER)
@json_option
def status_command(job: Path, as_json: bool) -> None:
    """Show every batch of JOB: its struts, what stands after it, what is lost, how far it is from the design in mm,
    how long its answer took; and what to do next.

    \b
    Example:
      frametwin print status out/job
    """
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.summaries import status_summary

    work = PrintJob(job)
    work.recover()
    if as_json:
        print_json({"job": job, **status_summary(work)})
    else:
        tell_status(work)


def tell_status(job: PrintJob) -> None:
    """Print the state of a job for people."""
    from frametwin.printing.job.summaries import what_next

    rows = []
    for state in job.states():
        report = state.report
        if report is None:
            rows.append([str(state.batch), str(state.struts), "", "", "", "", state.state])
            continue
        words = [state.state]
        words += [f"accepted {doubt['kind']}" for doubt in report["accepted"]]
        words += [f"{len(report['again'])} laid again"] if report["again"] else []
        rows.append(
            [
                str(state.batch),
                str(state.struts),
                str(report["standing"]),
                str(len(report["lost"])),
                f"{report['e_max']:.2f}",
                f"{report['seconds']['total']:.1f}",
                ", ".join(words),
            ]
        )
    columns = ("batch", "struts", "standing", "lost", "E_max mm", "answer s", "state")
    print_table(f"{job.design.name}: {job.folder}", columns, rows)
    click.echo(what_next(job))
