"""The report of a dataset: the errors of all samples, and the worst of them to look at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frametwin.capture.capture import read_capture
from frametwin.dataset.fits import judge
from frametwin.dataset.folder import Dataset, SampleEntry, read_dataset
from frametwin.errors import FrameTwinError, InputError
from frametwin.evaluation.evaluate import Errors
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.report.scene import Scene
from frametwin.report.twin_content import add_pictures, twin_content
from frametwin.twin.findings import Detection
from frametwin.twin.twin import FILE_NAME, Twin, read_twin

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
    shown: list[_Judged] = []  # the worst so far
    fitted = 0
    for k, entry in enumerate(dataset.samples):
        row = _blank_row(entry)
        rows.append(row)
        judged = _judged(dataset, entry, row)
        if judged is not None:
            fitted += 1
            shown = sorted([*shown, judged], key=lambda own: -own.errors.curves.max)[:SHOWN]
        report(progress, Progress("judging samples", k + 1, len(dataset.samples)))
    if not fitted:
        raise InputError.at(folder, "runs", "hold no twin", "fit the samples by frametwin dataset fit first")
    scenes = []
    for k, judged in enumerate(shown):
        judged.row["scene"] = k
        scenes.append(_scene(judged))
        report(progress, Progress("drawing samples", k + 1, len(shown)))
    return {
        "kind": "dataset",
        "title": dataset.name,
        "facts": {"samples": len(dataset.samples), "fitted": fitted, "failed": len(dataset.failed)},
        "samples": rows,
        "scenes": scenes,
    }


@dataclass(frozen=True, eq=False)
class _Judged:
    """A sample with its twin and errors. Its pictures, which are large, are read again if it is shown."""

    entry: SampleEntry
    row: dict[str, Any]
    twin: Twin
    errors: Errors
    detection: Detection


def _blank_row(entry: SampleEntry) -> dict[str, Any]:
    row: dict[str, Any] = {"index": entry.index, "frame": None, "verdict": None, "problem": None}
    return {**row, "curves_mean": None, "curves_max": None, "overlooked": None, "false": None, "scene": None}


def _judged(dataset: Dataset, entry: SampleEntry, row: dict[str, Any]) -> _Judged | None:
    """Compare the twin of a sample with its truth and fill in its row; nothing where there is none."""
    run = dataset.run_folder(entry.index)
    if not (run / FILE_NAME).is_file():
        row["problem"] = "not fitted"
        return None
    try:
        capture, twin = read_capture(entry.folder), read_twin(run)
        twin.as_wireframe(capture.frame)
        errors, detection = judge(capture, twin)
    except FrameTwinError as error:  # a damaged sample does not keep the others from being seen
        row["problem"] = str(error)
        return None
    row |= {
        "frame": capture.frame.name,
        "verdict": twin.verdict.status,
        "curves_mean": errors.curves.mean,
        "curves_max": errors.curves.max,
        "overlooked": len(detection.overlooked),
        "false": len(detection.false),
    }
    return _Judged(entry, row, twin, errors, detection)


def _scene(judged: _Judged) -> dict[str, Any]:
    capture, twin, errors = read_capture(judged.entry.folder), judged.twin, judged.errors
    scene = Scene.of_twin(f"sample {judged.entry.index}: {capture.frame.name}", capture.frame, twin, errors)
    told = twin_content(scene, twin, errors, capture.truth)
    add_pictures(told, scene, capture, WIDTH, crops=False)
    told["detection"] = _detection(judged.detection)
    return told


def _detection(detection: Detection) -> dict[str, list[int]]:
    return {name: [int(strut) for strut in values] for name, values in detection.as_dict().items()}
