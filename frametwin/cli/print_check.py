"""``frametwin print check``: whether a job can be printed as it stands, seen by other means than its planner's."""

from __future__ import annotations

from pathlib import Path

import click

from frametwin.cli.common import FOLDER, json_option, print_facts, print_json, quiet_option
from frametwin.cli.display import Display
from frametwin.wording import counted

MOST_FAULTS = 20
"""That are told; --json tells all."""


@click.command("check", short_help="Check a job's order and the files for the robot, independently of the planner.")
@click.argument("job", type=FOLDER)
@click.option("--batch", type=click.IntRange(0), help="Check the waypoints of this batch alone.  [default: everything]")
@click.option(
    "--out", type=FOLDER, metavar="PAGE", help="Also write the summary as one page to sign, .html, or as .json."
)
@quiet_option
@json_option
def check_command(job: Path, batch: int | None, out: Path | None, quiet: bool, as_json: bool) -> int:
    """Check that JOB can be printed: look at it anew, with nothing taken from the planner. Nothing is changed.

    \b
    The settings:   nozzle, speeds and limits are those that the job was planned with.
    The order:      every strut is laid, begins on the plate or on something printed,
                    and is laid with the nozzle inside of nothing that stands by then.
    The waypoints:  the files for the robot are read back, of every batch that has some. All formats say the same; the
                    tip stays in the workspace, within speed and tilt (and, where a robot was named, within its
                    reach); every strut of the batch is laid along its plan, at the speed and with the pauses, blends
                    and material asked for, and meets its joints; at finely sampled poses, on the ways between struts
                    too, the nozzle keeps clear of the print as it stands, of the strut's own beginning and of the
                    plate.

    What runs into what is looked for twice, by different geometry. The end is a summary of one page: every check with
    its result, and how much is left to each limit.

    What is wrong is listed by batch and strut. Contacts that were allowed when planning (--allow-contact) or accepted
    are listed too. Collisions less deep than half the distance between samples, an eighth of a strut's radius, may go
    unnoticed.

    Exit codes: 0 all is well, 1 something is wrong, 2 this is no job, or a file of it is damaged.

    \b
    Examples:
      frametwin print check out/job
      frametwin print check out/job --batch 7
      frametwin print check out/job --out out/job-check.html
      frametwin print check out/job --json
    """
    from frametwin.printing.job.check import check_job
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.sign_off import sign_off
    from frametwin.report.check_page import check_name, text_lines, write_check

    if out is not None:
        check_name(out)
    work = PrintJob(job)
    with Display(quiet) as display:
        found = check_job(work, batch, display)
    page = sign_off(work, found, order=batch is None)
    if out is not None:
        write_check(out, page)
    if as_json:
        print_json({"job": job, "settings_verified": work.file.verified, **found.as_dict()})
        return int(not found.fine)
    for fault in found.faults[:MOST_FAULTS]:
        click.echo(f"  - {fault}")
    more = len(found.faults) - MOST_FAULTS
    if more > 0:
        click.echo(f"  - and {more} more; --json tells all")
    what = "the order and " if batch is None else ""
    batches = (
        f"batch {batch}" if len(found.batches) == 1 and batch is not None else counted(len(found.batches), "batch")
    )
    looked_at = f"{what}the {found.waypoints} waypoints of {batches}, at {found.poses} poses of the tool"
    if found.fine:
        click.echo(f"All is well with {job}: {looked_at}.")
    else:
        click.echo(f"{counted(len(found.faults), 'fault')} in {job}: {looked_at}.")
    print_facts(
        f"print check: {page.design}, {counted(page.struts, 'strut')} in {counted(page.batches, 'batch')}",
        text_lines(page),
    )
    return int(not found.fine)
