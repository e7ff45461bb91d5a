"""The report of a dataset: the errors of all samples, and the worst of them to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from frametwin.capture.capture import read_capture
from frametwin.dataset.fits import judge
from frametwin.dataset.folder import Dataset, SampleEntry, read_dataset
from frametwin.errors import FrameTwinError, InputError
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.report.scene import Scene
from frametwin.report.twin_content import add_pictures, twin_content
from frametwin.twin.findings import Detection
from frametwin.twin.twin import FILE_NAME, read_twin

WIDTH = 420
SHOWN = 12
"""Samples that are shown in 3D and in pictures, those with the largest errors, so that the page stays small."""


def dataset_content(folder: Path, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """What the page of a dataset shows.

    Raises
    ------
    InputError
        If it is no dataset, or damaged, or none of its samples has a twin.
    Cancelled
        If ``progress`` returns ``False``.
    """
    dataset = read_dataset(folder)
    rows: list[dict[str, Any]] = []
    for k, entry in enumerate(dataset.samples):
        rows.append(_row(dataset, entry))
        report(progress, Progress("judging samples", k + 1, len(dataset.samples)))
    fitted = sorted((row for row in rows if row["curves_max"] is not None), key=lambda row: -row["curves_max"])
    if not fitted:
        raise InputError.at(folder, "runs", "hold no twin", "fit the samples by frametwin dataset fit first")
    entries = {entry.index: entry for entry in dataset.samples}
    scenes = []
    for k, row in enumerate(fitted[:SHOWN]):
        scenes.append(_scene(dataset, entries[row["index"]]))
        report(progress, Progress("drawing samples", k + 1, min(SHOWN, len(fitted))))
    return {
        "kind": "dataset",
        "title": dataset.name,
        "facts": {"samples": len(dataset.samples), "fitted": len(fitted), "failed": len(dataset.failed)},
        "samples": [{**row, "scene": _place(fitted, row)} for row in rows],
        "scenes": scenes,
    }


def _place(fitted: list[dict[str, Any]], row: dict[str, Any]) -> int | None:
    """The number of a sample's scene, if it is shown."""
    return next((k for k, other in enumerate(fitted[:SHOWN]) if other is row), None)


def _row(dataset: Dataset, entry: SampleEntry) -> dict[str, Any]:
    run = dataset.run_folder(entry.index)
    row: dict[str, Any] = {"index": entry.index, "frame": None, "verdict": None, "problem": None}
    row |= {"curves_mean": None, "curves_max": None, "overlooked": None, "false": None}
    if not (run / FILE_NAME).is_file():
        return {**row, "problem": "not fitted"}
    try:
        capture, twin = read_capture(entry.folder), read_twin(run)
        twin.as_wireframe(capture.frame)
        errors, detection = judge(capture, twin)
    except FrameTwinError as error:  # a damaged sample does not keep the others from being seen
        return {**row, "problem": str(error)}
    return {
        **row,
        "frame": capture.frame.name,
        "verdict": twin.verdict.status,
        "curves_mean": errors.curves.mean,
        "curves_max": errors.curves.max,
        "overlooked": len(detection.overlooked),
        "false": len(detection.false),
    }


def _scene(dataset: Dataset, entry: SampleEntry) -> dict[str, Any]:
    capture, twin = read_capture(entry.folder), read_twin(dataset.run_folder(entry.index))
    errors, detection = judge(capture, twin)
    scene = Scene.of_twin(f"sample {entry.index}: {capture.frame.name}", capture.frame, twin, errors)
    told = twin_content(scene, twin, errors, capture.truth)
    add_pictures(told, scene, capture, WIDTH, crops=False)
    told["detection"] = _detection(detection)
    return told


def _detection(detection: Detection) -> dict[str, list[int]]:
    return {name: [int(strut) for strut in values] for name, values in detection.as_dict().items()}
