"""Whether a dataset is what it says it is: files, cameras, truth, and the pictures to a pixel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.capture.capture import Capture, View, read_capture
from frametwin.dataset.camera_errors import with_true_cameras
from frametwin.dataset.farm import run_tasks
from frametwin.dataset.folder import (
    SAMPLE_FILE,
    SAMPLES,
    Dataset,
    SampleEntry,
    check_sample,
    read_dataset,
    read_sample,
    sample_folder,
    sample_indices,
    sample_name,
)
from frametwin.dataset.hashes import hash_file
from frametwin.dataset.pass_checks import check_passes
from frametwin.dataset.picture_checks import check_pictures
from frametwin.dataset.true_curves import read_true_curves
from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.files import PathLike, read_json
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.wording import shortened

JOIN_TOLERANCE = 1e-6
"""In mm: how far the end of a true strut may be from its vertex."""

RIGID = 1e-6
"""Largest entry of R R^T - 1 of a camera."""

ROUND_TRIP = 1e-6
"""Share of the depth by which a point may move when it is projected and brought back."""


@dataclass(frozen=True)
class Finding:
    """A bad sample and everything that is wrong with it, in words."""

    index: int
    folder: Path
    problems: tuple[str, ...]


@dataclass(frozen=True)
class Validation:
    """What was found.

    Attributes
    ----------
    dataset : what was validated.
    checked : number of samples that were looked at.
    findings : the bad samples, by rising index.
    problems : what is wrong with the dataset as a whole.
    """

    dataset: Dataset
    checked: int
    findings: tuple[Finding, ...]
    problems: tuple[str, ...]

    @property
    def fine(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings and not self.problems

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {
            "dataset": str(self.dataset.folder),
            "fine": self.fine,
            "checked": self.checked,
            "problems": list(self.problems),
            "bad": [
                {"index": found.index, "folder": found.folder.as_posix(), "problems": list(found.problems)}
                for found in self.findings
            ],
            "failed": [{"index": entry.index, "reason": entry.reason} for entry in self.dataset.failed],
            "absent": self.dataset.absent,
        }


def validate_dataset(
    folder: PathLike,
    *,
    partial: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    progress: ProgressCallback | None = None,
) -> Validation:
    """Check every sample of a dataset.

    Parameters
    ----------
    folder
        Of the dataset.
    partial
        Whether samples may be absent, as in one shard of several. Samples that are noted as failed may always.
    workers, scheduler
        See `frametwin.dataset.farm.run_tasks`.
    progress
        Told of every sample.

    Raises
    ------
    InputError
        If there is no dataset, or its ``dataset.json`` is damaged.
    Cancelled
        If ``progress`` returns ``False``.
    """
    dataset = read_dataset(folder)
    entries = {entry.folder: entry for entry in dataset.samples}
    found: list[Finding] = []
    report(progress, Progress("validating samples", 0, len(entries)))
    tasks = run_tasks(validate_sample, list(entries), workers, scheduler)
    for done, (path, outcome) in enumerate(tasks, start=1):
        if isinstance(outcome, Cancelled):
            raise outcome
        problems = [str(outcome)] if isinstance(outcome, Exception) else outcome
        problems = [*_entry_problems(entries[path]), *problems]
        if problems:
            found.append(Finding(entries[path].index, path, tuple(problems)))
        report(progress, Progress("validating samples", done, len(entries)))
    found.sort(key=lambda finding: finding.index)
    return Validation(dataset, len(entries), tuple(found), tuple(_dataset_problems(dataset, partial)))


def validate_sample(folder: Path) -> list[str]:
    """Check one sample by itself.

    Returns
    -------
    What is wrong, in words; nothing if all is well. What cannot be checked because something else is wrong is left
    out.
    """
    problems = check_sample(folder) or _content_problems(folder)
    if problems:
        return problems
    try:
        capture = read_capture(folder)
        if capture.truth is None:
            return ["truth.json is missing"]
        truth = capture.truth
        problems = [*_join_problems(capture, truth), *_camera_problems(capture)]
        capture = with_true_cameras(capture)
        if not np.array_equal(truth.printed, capture.frame.printed):
            problems.append("truth.json: printed is not as in frame.json")
        truth = truth.replace(printed=capture.frame.printed)
        curves, wrong = read_true_curves(capture, truth)
        problems += wrong
        look = read_sample(folder).specification.get("render", {}).get("look")
        problems += check_pictures(capture, truth, curves, look)
        return problems + check_passes(capture, curves)
    except FrameTwinError as error:
        return [*problems, str(error)]
    except Exception as error:  # whatever it is, the other samples can still be checked
        return [*problems, f"cannot be checked ({type(error).__name__}: {error})"]


def _entry_problems(entry: SampleEntry) -> list[str]:
    """Whether ``dataset.json`` and ``sample.json`` speak of the same sample."""
    try:
        sample = read_sample(entry.folder)
    except InputError:
        return []  # told with the files
    problems = []
    if sample.index != entry.index or entry.folder.name != sample_name(entry.index):
        problems.append(f"{SAMPLE_FILE}: index is {sample.index} where dataset.json has {entry.index}")
    if sample.content != entry.content:
        problems.append(f"{SAMPLE_FILE}: the hash of the sample is not that in dataset.json")
    return problems


def _dataset_problems(dataset: Dataset, partial: bool) -> list[str]:
    known = {entry.folder.name for entry in dataset.samples}
    strange = [i for i in sample_indices(dataset.folder) if sample_folder(dataset.folder, i).name not in known]
    problems = [] if dataset.samples or partial else ["there are no samples"]
    if strange:
        problems.append(f"dataset.json does not list what is in {SAMPLES}/: {shortened(strange, 10)}; generate again")
    absent = [index for index in dataset.absent if index not in strange]
    if absent and not partial:
        problems.append(
            f"{len(absent)} of {dataset.count} samples are neither there nor noted as failed: {shortened(absent, 10)};"
            " generate again to complete the dataset, or allow a partial one"
        )
    return problems


def _content_problems(folder: Path) -> list[str]:
    """Whether the content of every file, decoded, has the hash that is noted."""
    problems = []
    for name, noted in read_sample(folder).files.items():
        try:
            if hash_file(folder / name).content != noted.content:
                problems.append(f"{name} holds something else than {SAMPLE_FILE} says (another content hash)")
        except InputError as error:
            problems.append(str(error))
    return problems


def _join_problems(capture: Capture, truth: Wireframe) -> list[str]:
    """Whether struts end on their vertices; in the file, since reading moves ends that are a little off."""
    problems = []
    for name, frame in (("frame.json", capture.frame), ("truth.json", truth)):
        written = read_json(capture.root / name).get("control_points")
        if written is None:
            continue
        ends = np.asarray(written, dtype=np.float64)[:, [0, 3]]
        away = np.linalg.norm(ends - frame.vertices[frame.edges], axis=2).max(axis=1)
        worst = int(away.argmax())
        if away[worst] > JOIN_TOLERANCE:
            problems.append(f"{name}: strut {worst} ends {away[worst]:.3g} mm beside its vertex")
    return problems


def _camera_problems(capture: Capture) -> list[str]:
    """Whether poses are rigid, and points that are projected can be brought back."""
    printed = capture.frame.printed
    points = bezier.evaluate(capture.frame.control_points[printed], np.linspace(0.0, 1.0, 5)).reshape(-1, 3)
    checks: tuple[Callable[[View, np.ndarray], str | None], ...] = (_rigid_problem, _round_trip_problem)
    found = (check(view, points) for view in capture.views for check in checks)
    return [text for text in found if text is not None]


def _rigid_problem(view: View, points: np.ndarray) -> str | None:
    pose = view.camera.camera_to_world
    error = np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max()
    return f"transforms.json: the pose of {view.camera.name} is not rigid" if error > RIGID else None


def _round_trip_problem(view: View, points: np.ndarray) -> str | None:
    camera = view.camera
    pixels, depth = camera.project(points)
    x, y = pixels.T
    with np.errstate(invalid="ignore"):
        seen = (depth > 0.0) & (x >= 0) & (x <= camera.width) & (y >= 0) & (y <= camera.height)
    found = camera.unproject(pixels[seen], depth[seen])
    if (np.linalg.norm(found - points[seen], axis=1) <= ROUND_TRIP * depth[seen]).all():
        return None
    return f"transforms.json: {camera.name} cannot be inverted (points that it projects do not come back)"
