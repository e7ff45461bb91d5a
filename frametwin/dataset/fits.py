"""Fitting every sample of a dataset, and the table of errors: ``runs/``, ``errors.csv`` and ``fit.json``."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from frametwin import __version__
from frametwin.capture.capture import Capture, read_capture
from frametwin.dataset.farm import SampleSteps, run_tasks
from frametwin.dataset.folder import Dataset, SampleEntry, read_dataset
from frametwin.dataset.true_curves import intervals_of
from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.evaluation.evaluate import Errors, evaluate
from frametwin.files import PathLike, write_json, write_text
from frametwin.fitting.api import fit_capture, settings_of, write_run
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import Seed, check_settings
from frametwin.twin.findings import Detection, missing_struts
from frametwin.twin.twin import FILE_NAME as TWIN_FILE
from frametwin.twin.twin import Twin, read_twin

FORMAT = "frametwin-dataset-fit"
VERSION = 1
TABLE_FILE, CSV_FILE = "fit.json", "errors.csv"


@dataclass(frozen=True)
class DatasetFitSettings:
    """Preset, seed, and settings that differ from the preset's. See `frametwin.fitting.api.fit_capture`.

    Raises
    ------
    InputError
        If one of them is unknown or out of range.
    """

    preset: str = "fast"
    seed: Seed = 0
    changes: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_settings(self)
        settings_of(self.preset, self.seed, self.changes)


@dataclass(frozen=True)
class FitRow:
    """A line of the table. Lengths are in mm; what is not known, because the fit failed, is ``None``.

    Attributes
    ----------
    index, frame, struts, printed, views : the sample.
    seconds : which the fit took, with reading the pictures.
    curves_mean, curves_p95, curves_max : distance between the twin's curves and the true ones.
    joints_mean, joints_max : distance between joints.
    equal_mean, equal_max : distance at equal parameter.
    found, overlooked, false : how many missing struts were found and overlooked, and how many others suspected.
    error : why there is no twin.
    kept : whether the run was there already.
    """

    index: int
    frame: str | None = None
    struts: int | None = None
    printed: int | None = None
    views: int | None = None
    seconds: float | None = None
    curves_mean: float | None = None
    curves_p95: float | None = None
    curves_max: float | None = None
    joints_mean: float | None = None
    joints_max: float | None = None
    equal_mean: float | None = None
    equal_max: float | None = None
    found: int | None = None
    overlooked: int | None = None
    false: int | None = None
    error: str | None = None
    kept: bool = False


COLUMNS = tuple(item.name for item in fields(FitRow) if item.name != "kept")
"""Of ``errors.csv``."""

_MEANS = ("seconds", "curves_mean", "curves_p95", "joints_mean", "equal_mean")
_LARGEST = ("curves_max", "joints_max", "equal_max")
_SUMS = ("found", "overlooked", "false")


def fit_dataset(
    folder: PathLike,
    settings: DatasetFitSettings | None = None,
    *,
    again: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: ProgressCallback | None = None,
) -> list[FitRow]:
    """Fit every sample, evaluate the twins against the truth, and write the table of errors.

    A sample that has a run already, made from the same files with the same settings, is not fitted again. A sample
    that fails does not stop the others. The table is written when all are done.

    Parameters
    ----------
    folder
        Of the dataset.
    settings
        See `DatasetFitSettings`.
    again
        Whether runs that are there are made again.
    workers, scheduler
        See `frametwin.dataset.farm.run_tasks`.
    progress
        Told of every sample, and with one worker of every step.

    Returns
    -------
    The table, by rising index.

    Raises
    ------
    InputError
        If there is no dataset, or the table cannot be written.
    Cancelled
        If ``progress`` returns ``False``. Runs that are done stay.
    """
    settings = DatasetFitSettings() if settings is None else settings
    dataset = read_dataset(folder)
    total = len(dataset.samples)
    shown = SampleSteps(progress, total)
    inside = shown if workers <= 1 and scheduler is None else None  # a callback does not reach other processes
    function = partial(fit_sample, settings=settings, again=again, progress=inside)
    tasks = [SampleTask(entry, dataset.run_folder(entry.index)) for entry in dataset.samples]
    rows: list[FitRow] = []
    report(progress, Progress("fitting samples", 0, total))
    for task, outcome in run_tasks(function, tasks, workers, scheduler):
        if isinstance(outcome, Cancelled):
            raise outcome
        row = FitRow(task.entry.index, error=str(outcome)) if isinstance(outcome, Exception) else outcome
        rows.append(row)
        shown.done = len(rows)
        report(progress, Progress("fitting samples", len(rows), total))
    rows.sort(key=lambda row: row.index)
    write_table(dataset, settings, rows)
    return rows


@dataclass(frozen=True)
class SampleTask:
    """A sample and where its run belongs."""

    entry: SampleEntry
    run: Path


def fit_sample(
    task: SampleTask, settings: DatasetFitSettings, again: bool = False, progress: ProgressCallback | None = None
) -> FitRow:
    """Fit one sample, unless its run is there already, and evaluate the twin.

    Raises
    ------
    Cancelled
        If ``progress`` returns ``False``.

    Notes
    -----
    Every other failure is returned in the row.
    """
    row = FitRow(task.entry.index)
    try:
        capture = read_capture(task.entry.folder)
        frame = capture.frame
        row = replace(
            row,
            frame=frame.name,
            struts=frame.strut_count,
            printed=int(frame.printed.sum()),
            views=len(capture.views),
        )
        twin = None if again else current_twin(task.run, capture, settings)
        kept = twin is not None
        if twin is None:
            result = fit_capture(
                capture, settings.preset, seed=settings.seed, changes=settings.changes, callback=progress
            )
            write_run(task.run, result, capture, overwrite=True)
            twin = result.twin
        return replace(row, kept=kept, **measure(capture, twin))
    except Cancelled:
        raise
    except FrameTwinError as error:
        return replace(row, error=str(error))
    except Exception as error:  # whatever it is, the other samples can still be fitted
        return replace(row, error=f"{type(error).__name__}: {error}")


def current_twin(run: Path, capture: Capture, settings: DatasetFitSettings) -> Twin | None:
    """The twin in a run folder, if a fit with these settings would read the very files that it was made from."""
    if not (run / TWIN_FILE).is_file():
        return None
    try:
        twin = read_twin(run)
        twin.as_wireframe(capture.frame)
    except InputError:
        return None  # damaged, or of another frame
    wanted = {
        "preset": settings.preset,
        "seed": settings.seed,
        "changes": json.loads(json.dumps(dict(settings.changes))),  # tuples become lists, as in the file
        "inputs": capture.hashes,
    }
    return twin if all(twin.provenance.get(key) == value for key, value in wanted.items()) else None


def judge(capture: Capture, twin: Twin) -> tuple[Errors, Detection]:
    """Compare a twin with the truth of its capture: errors in mm, and which missing struts were found.

    Raises
    ------
    InputError
        If the capture has no truth, or the twin is not one of its frame.
    """
    if capture.truth is None:
        raise InputError.at(capture.root, "truth.json", "is missing", "make the sample again")
    printed = capture.frame.printed
    present = intervals_of(capture.root, printed)
    errors = evaluate(twin.curves, twin.vertices, capture.truth.replace(printed=printed), present)
    return errors, Detection.of(missing_struts(twin, printed), present, printed)


def measure(capture: Capture, twin: Twin) -> dict[str, Any]:
    """The errors of a twin under the names of `FitRow`; see `judge`."""
    errors, detection = judge(capture, twin)
    return figures_of(errors, detection) | {"seconds": float(twin.timing.get("total", 0.0))}


def figures_of(errors: Errors, detection: Detection) -> dict[str, Any]:
    """Errors and counts under the names of `FitRow`."""
    return {
        "curves_mean": errors.curves.mean,
        "curves_p95": errors.curves.p95,
        "curves_max": errors.curves.max,
        "joints_mean": errors.joints.mean,
        "joints_max": errors.joints.max,
        "equal_mean": errors.equal_parameter.mean,
        "equal_max": errors.equal_parameter.max,
        **{name: len(values) for name, values in vars(detection).items()},
    }


def summarise(rows: Sequence[FitRow]) -> dict[str, Any]:
    """Means, greatest values and sums over the samples that were fitted, by the names of `FitRow`."""
    good = [row for row in rows if row.error is None]
    data: dict[str, Any] = {"fitted": len(good), "failed": len(rows) - len(good)}
    for names, of in ((_MEANS, np.mean), (_LARGEST, np.max), (_SUMS, np.sum)):
        for name in names:
            values = [getattr(row, name) for row in good]
            data[name] = of(values).item() if values else None
    return data


def write_table(dataset: Dataset, settings: DatasetFitSettings, rows: Sequence[FitRow]) -> None:
    """Write ``fit.json`` and ``errors.csv`` into a dataset's folder.

    Raises
    ------
    InputError
        If they cannot be written.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([getattr(row, name) for name in COLUMNS] for row in rows)
    write_text(dataset.folder / CSV_FILE, stream.getvalue())
    write_json(
        dataset.folder / TABLE_FILE,
        {
            "format": FORMAT,
            "version": VERSION,
            "frametwin": __version__,
            "unit": "mm",
            "preset": settings.preset,
            "seed": settings.seed,
            "changes": dict(settings.changes),
            "summary": summarise(rows),
            "samples": [{name: value for name, value in asdict(row).items() if name != "kept"} for row in rows],
        },
    )
