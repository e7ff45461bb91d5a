"""The worker's jobs for adaptive printing: plan, answer, tell the state, simulate."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

from frametwin.blender.rendering.client import blender_renderer
from frametwin.checked_json import convert_fields
from frametwin.files import staged_directory
from frametwin.printing.job.answer import AnswerOptions
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.job.summaries import answer_summary, plan_summary, status_summary
from frametwin.printing.simulation.simulate import SimulationOptions, draw_print, simulate_print
from frametwin.progress import ProgressCallback
from frametwin.report.beside_job import write_job_page
from frametwin.service.tasks import frame_of

PICTURE = "print.png"


def plan(
    frame: str | dict[str, Any],
    out: Path,
    settings: dict[str, Any] | None = None,
    order: Path | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Plan a print and write its job.

    Parameters
    ----------
    frame
        A file, the name of one of the project's frames, or the content of a frame file.
    out, overwrite
        The job folder, and whether it may be replaced if it is one.
    settings
        Fields of `frametwin.printing.job.plan_job.PlanOptions` that shall differ from the usual ones.
    order
        A file with an order to keep.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out`` and what `frametwin.printing.job.summaries.plan_summary` gives.
    """
    options = PlanOptions(**convert_fields(PlanOptions, settings or {}, "settings"))
    job = plan_job(out, frame_of(frame), options, order=order, overwrite=overwrite, progress=progress)
    return {"out": out, **plan_summary(job)}


def answer(
    job: Path,
    capture: Path,
    accept: list[str] | None = None,
    reprint: bool | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Answer the batch that was printed last, and write the page beside the job.

    Parameters
    ----------
    job, capture
        The folders.
    accept, reprint
        See `AnswerOptions`.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``job`` and what `frametwin.printing.job.summaries.answer_summary` gives.
    """
    options = AnswerOptions(accept=frozenset(accept or ()), reprint=reprint)
    work = PrintJob(job)
    report = work.answer(capture, options, progress)
    write_job_page(work.folder, progress)
    return {"job": job, **answer_summary(work, report)}


def status(job: Path) -> dict[str, Any]:
    """The state of a job.

    Returns
    -------
    ``job`` and what `frametwin.printing.job.summaries.status_summary` gives.
    """
    work = PrintJob(job)
    work.recover()
    return {"job": job, **status_summary(work)}


def simulate(
    frame: str | dict[str, Any],
    out: Path,
    settings: dict[str, Any] | None = None,
    order: Path | None = None,
    overwrite: bool = False,
    whole: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Print a frame without a robot.

    Parameters
    ----------
    frame, out, order, overwrite
        As for `plan`. A simulation that was stopped goes on.
    whole
        Write the folder whole or not at all: nothing is left of a simulation that is stopped.
    settings
        Fields of `SimulationOptions` that shall differ from the usual ones; ``plan``,
        ``print`` and ``rig`` are objects with fields of their own.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out`` and what ``frametwin print simulate --json`` prints.
    """
    wanted = dict(settings or {})
    if isinstance(wanted.get("plan"), dict):
        wanted["plan"] = {"allow_contact": True, **wanted["plan"]}
    options = SimulationOptions(**convert_fields(SimulationOptions, wanted, "settings"))
    design = frame_of(frame)
    with staged_directory(out, overwrite) if whole else nullcontext(out) as folder:
        simulated = simulate_print(
            folder,
            design,
            options,
            order=order,
            overwrite=overwrite,
            renderer=blender_renderer(),
            progress=progress,
        )
        draw_print(folder / PICTURE, simulated)
        write_job_page(Path(folder), progress)
    if simulated.held is not None:
        simulated.held.rename(str(folder), str(out))  # of the folder that stood in for it
    return {"out": out, **simulated.as_dict()}
