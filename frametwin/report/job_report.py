"""The report of a print job, also while it runs: what has been answered is complete on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frametwin.capture.capture import read_capture
from frametwin.capture.views import has_cameras
from frametwin.files import read_json
from frametwin.formats import frame_json
from frametwin.geometry.displacement import strut_displacements
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job import job_files as files
from frametwin.printing.job.job import PrintJob
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.report.scene import SAMPLES, Scene, plan_content
from frametwin.report.twin_content import add_pictures, errors_of, twin_content
from frametwin.twin.runs import Truth, load_run

WIDTH, LAST_WIDTH = 420, 900
"""Of a view in pixels at the most: of the batches before, and of the last one."""

PICTURED = 40
"""Batches of which pictures are shown, the last ones, so that the page stays small."""

Answer = tuple[Wireframe, dict[str, Any]]
"""Of a batch: the plan it went on with, ``printed`` marking what stands, and its report."""

TRUTH, OUTCOME = "truth.json", "outcome.json"
"""What a simulated print leaves beside a batch."""


def job_content(folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """What the page of a print job shows.

    Raises
    ------
    InputError
        If it is no job, or damaged.
    Cancelled
        If ``progress`` returns ``False``.
    """
    job = PrintJob(folder)
    count = job.answered
    scenes, figures = [], []
    for batch in range(count):
        answer = (job.adapted(batch), job.report(batch))
        scenes.append(_batch(job, batch, answer, count))
        figures.append(_figures(job, batch, answer))
        report(progress, Progress("reading batches", batch + 1, count))
    states = job.states()
    return {
        "kind": "job",
        "title": job.design.name,
        "facts": {
            "struts": job.design.strut_count,
            "batches": len(states),
            "answered": count,
            "adaptation": "on" if job.settings.adapt else "off",
        },
        "plan": plan_content(job.design),
        "batches": figures,
        "scenes": scenes or [_nothing(job.design)],
    }


def _nothing(design: Wireframe) -> dict[str, Any]:
    """The design alone, before anything has been printed."""
    away = np.full(design.strut_count, np.nan)
    nothing = design.replace(printed=np.zeros(design.strut_count, dtype=bool))
    scene = Scene("planned", nothing, design.control_points, {"displacement": away})
    note = "No batch has been answered yet: this is the design."
    return {**scene.content(with_plan=False), "note": note, "worst": []}


def _batch(job: PrintJob, batch: int, answer: Answer, count: int) -> dict[str, Any]:
    """A batch that has been answered: its twin if there is one, else the plan it went on with."""
    folder, label = job.batch_folder(batch), f"batch {batch}"
    standing, answered = answer
    lost = {"lost": np.asarray(answered["lost"], dtype=np.int64)}
    if not (folder / files.RUN / "twin.json").is_file():
        design = job.design.replace(printed=standing.printed)
        away = strut_displacements(standing.control_points - design.control_points, SAMPLES)
        scene = Scene(label, design, standing.control_points, {"displacement": away}, lost)
        note = "No twin was made of this batch: the struts are shown where they were laid."
        return {**scene.content(with_plan=False), "note": note, "worst": []}
    twin, plan = load_run(folder / files.RUN)
    design = job.design.replace(printed=plan.printed)
    truth = _truth(folder, plan)
    errors = errors_of(twin, truth)
    scene = Scene.of_twin(label, design, twin, errors)
    scene = Scene(label, design, scene.curves, scene.quantities, {**scene.marks, **lost})
    told = twin_content(scene, twin, errors, None if truth is None else truth.frame, with_plan=False)
    last = batch == count - 1
    if batch >= count - PICTURED and has_cameras(folder / files.CAPTURE):
        capture = read_capture(folder / files.CAPTURE, plan)
        add_pictures(told, scene, capture, LAST_WIDTH if last else WIDTH, crops=last)
    return told


def _truth(folder: Path, plan: Wireframe) -> Truth | None:
    """What really stands after a batch of a simulated print, of the struts that were laid."""
    if not (folder / TRUTH).is_file():
        return None
    real = frame_json.read(folder / TRUTH)
    if (real.strut_count, real.vertex_count) != (plan.strut_count, plan.vertex_count):
        return None  # of another plan
    standing = real.printed & plan.printed
    return Truth(real.replace(printed=standing), None) if standing.any() else None


def _figures(job: PrintJob, batch: int, answer: Answer) -> dict[str, Any]:
    """The figures of a batch for the charts over all batches."""
    standing, told = answer
    outcome_file = job.batch_folder(batch) / OUTCOME
    outcome = read_json(outcome_file) if outcome_file.is_file() else {}
    seconds = told["seconds"] if isinstance(told["seconds"], dict) else {}
    laid = told.get("laid")
    return {
        "batch": batch,
        "laid": len(laid) if isinstance(laid, list) else None,
        "standing": told.get("standing"),
        "lost": len(told["lost"]),
        "e_max": outcome.get("e_max", told.get("e_max")),
        "deviation": _deviation(job.design, standing, job.settings.of_frame(job.design)),
        "twin_seconds": seconds.get("total") if "twin" in seconds else None,
        "printing_seconds": outcome.get("seconds"),
        "collapsed": outcome.get("collapsed") is True,
        "accepted": [str(doubt) for doubt in _accepted(told)],
    }


def _accepted(told: dict[str, Any]) -> list[str]:
    doubts = told.get("accepted", [])
    return [str(doubt.get("kind", "?")) for doubt in doubts if isinstance(doubt, dict)]


def _deviation(design: Wireframe, standing: Wireframe, judged: np.ndarray) -> float | None:
    """Mean over the standing ones of the struts ``judged`` (E,) of their largest distance from the design in mm."""
    judged = judged & standing.printed
    if not judged.any():
        return None
    away = strut_displacements(standing.control_points - design.control_points, SAMPLES)
    return float(away[judged].mean())
