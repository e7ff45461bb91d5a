"""``frametwin print status``: how far a job is, and what to do next."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from frametwin.cli.common import FOLDER, json_option, print_json, print_table

if TYPE_CHECKING:
    from frametwin.printing.job import BatchState, Job


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
    from frametwin.printing.job import Job

    work = Job(job)
    work.settle()
    if as_json:
        print_json({"job": job, **status_summary(work)})
    else:
        tell_status(work)


def status_summary(job: Job) -> dict[str, Any]:
    """The state of a job, as for a JSON file."""
    current = job.current
    return {
        "frame": job.design.name,
        "struts": job.design.strut_count,
        "adapted": job.settings.adapt,
        "current": current,
        "finished": current is None,
        "next": what_next(job),
        "batches": [_batch_summary(job, state) for state in job.states()],
    }


def _batch_summary(job: Job, state: BatchState) -> dict[str, Any]:
    data: dict[str, Any] = {"batch": state.batch, "struts": state.struts, "state": state.state}
    if state.report is not None:
        kept = ("standing", "lost", "again", "e_max", "accepted", "capture", "seconds")
        data.update({key: state.report[key] for key in kept})
        data["twin"] = state.report.get("twin")
    if state.state != "to come":
        summary = job.waypoint_summary(state.batch)
        data["printing_seconds"], data["contacts"] = summary["seconds"], summary["contacts"]
    return data


def what_next(job: Job) -> str:
    """What to do, in a sentence."""
    batch = job.current
    if batch is None:
        return "The print is finished."
    waypoints = job.batch_folder(batch) / "waypoints"
    return (
        f"Print batch {batch} ({waypoints}), take pictures, then: frametwin print next {job.folder} --capture CAPTURE"
    )


def tell_status(job: Job) -> None:
    """Print the state of a job for people."""
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
