"""The state of a job, an answer and a plan, as for programs."""

from __future__ import annotations

from typing import Any

from frametwin.printing.job.job import BatchState, PrintJob
from frametwin.printing.process.supports import columns_of
from frametwin.wording import typed


def plan_summary(job: PrintJob) -> dict[str, Any]:
    """What was planned, as for a JSON file."""
    summary = job.waypoint_summary(0)
    workspace = job.settings.robot.workspace
    return {
        "frame": job.design.name,
        "struts": job.design.strut_count,
        "coupon": job.settings.coupon,
        "support_struts": job.settings.support_struts,
        "supported": supported_joints(job),
        "batches": job.file.batches,
        "batch_sizes": [state.struts for state in job.states()],
        "workspace": [workspace.lower, workspace.upper],
        "max_speed": workspace.max_speed,
        "first": {**summary, "struts": len(summary["struts"])},
    }


def supported_joints(job: PrintJob) -> list[int]:
    """Vertices of the design that have a column below them, in their order."""
    pieces = job.settings.support_struts
    return sorted(columns_of(job.design, job.design.strut_count - job.settings.added, pieces))


def answer_summary(job: PrintJob, report: dict[str, Any]) -> dict[str, Any]:
    """An answer, as for programs."""
    following = job.current
    ahead = None if following is None else {"batch": following, **job.waypoint_summary(following)}
    kept = ("batch", "laid", "standing", "lost", "again", "e_max", "accepted", "seconds")
    return {
        **{key: report[key] for key in kept},
        "twin": report.get("twin"),
        "finished": following is None,
        "next": ahead,
    }


def status_summary(job: PrintJob) -> dict[str, Any]:
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


def _batch_summary(job: PrintJob, state: BatchState) -> dict[str, Any]:
    data: dict[str, Any] = {"batch": state.batch, "struts": state.struts, "state": state.state}
    if state.report is not None:
        kept = ("standing", "lost", "again", "e_max", "accepted", "capture", "seconds")
        data.update({key: state.report[key] for key in kept})
        data["twin"] = state.report.get("twin")
    if state.state != "to come":
        summary = job.waypoint_summary(state.batch)
        data["printing_seconds"], data["contacts"] = summary["seconds"], summary["contacts"]
    return data


def what_next(job: PrintJob) -> str:
    """What to do, in a sentence."""
    batch = job.current
    if batch is None:
        return "The print is finished."
    waypoints = job.batch_folder(batch) / "waypoints"
    command = f"frametwin print next {typed(job.folder)} --capture CAPTURE"
    return f"Print batch {batch} ({waypoints}), take pictures, then: {command}"
