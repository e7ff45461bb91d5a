"""Writing the report of whatever is given: a run, a print job or a dataset."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frametwin.errors import InputError
from frametwin.files import PathLike, write_text
from frametwin.progress import ProgressCallback
from frametwin.report.page import page
from frametwin.twin.runs import is_run

SUFFIXES = (".html", ".htm")


@dataclass(frozen=True)
class Report:
    """What has been written: the page, of what kind its source is, how many scenes it shows, and its size in bytes."""

    path: Path
    kind: str
    scenes: int
    size: int


def write_report(
    source: PathLike,
    out: PathLike,
    *,
    capture: PathLike | None = None,
    truth: PathLike | None = None,
    progress: ProgressCallback | None = None,
) -> Report:
    """Write a page that shows a run, a print job or a dataset.

    Parameters
    ----------
    source
        The folder of a run, of a job (also of one that goes on) or of a dataset.
    out
        The page, ending in ``.html``; it is replaced.
    capture
        Of a run: the capture it was made from, for its pictures and its truth.
    truth
        Of a run: the frame file of the real geometry.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If the source is none of these, or damaged, or the page cannot be written.
    Cancelled
        If ``progress`` returns ``False``; nothing is written.
    """
    target = Path(out)
    if target.suffix.lower() not in SUFFIXES or target.is_dir():
        raise InputError.at("--out", str(target), "is no page", "give a file that ends in .html")
    content = _content(
        Path(source),
        None if capture is None else Path(capture),
        None if truth is None else Path(truth),
        progress,
    )
    text = page(content)
    write_text(target, text)
    return Report(target, content["kind"], len(content["scenes"]), len(text.encode("utf-8")))


def _content(
    source: Path, capture: Path | None, truth: Path | None, progress: ProgressCallback | None
) -> dict[str, Any]:
    if is_run(source):
        from frametwin.report.run_report import run_content

        return run_content(source, capture, truth, progress)
    for name, given in (("--capture", capture), ("--truth", truth)):
        if given is not None:
            raise InputError.at(name, str(given), "belongs to a run", "leave it out: jobs and datasets have theirs")
    if (source / "job.json").is_file():
        from frametwin.report.job_report import job_content

        return job_content(source, progress)
    if (source / "dataset.json").is_file():
        from frametwin.report.dataset_report import dataset_content

        return dataset_content(source, progress)
    problem = "is no run, print job or dataset" if source.exists() else "there is no such folder"
    raise InputError.at(source, "folder", problem, "give a folder with twin.json, job.json or dataset.json")
