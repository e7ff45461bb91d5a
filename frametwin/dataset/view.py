"""A page that shows a whole dataset: one HTML file that opens from disk, with pictures beside it."""

from __future__ import annotations

import html
import os
import shutil
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from frametwin import __version__
from frametwin.dataset.farm import run_tasks
from frametwin.dataset.folder import RUNS, Dataset, SampleEntry, read_dataset, sample_name
from frametwin.dataset.sample_view import PICTURE, view_sample
from frametwin.errors import Cancelled, InputError
from frametwin.files import PathLike, file_hash, read_json, staged_directory, write_json, write_text
from frametwin.imaging.overlay import PLAN, PRINT, TRUTH, TWIN, Colour
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.script_json import script_json
from frametwin.twin.twin import FILE_NAME as TWIN_FILE

PAGE = "index.html"
TEMPLATE = "page.html"
ROW_FILE, DATA_FILE = "row.json", "data.js"
LOOK = 1
"""Of what is beside the page; raised when that changes, so that it is made anew."""

COLOURS: dict[str, Colour] = {"plan": PLAN, "truth": TRUTH, "twin": TWIN, "seen": PRINT}


@dataclass(frozen=True)
class Page:
    """What has been written: the page, how many samples it shows, and of how many there is a twin."""

    path: Path
    samples: int
    fitted: int


def write_page(
    folder: PathLike,
    out: PathLike | None = None,
    *,
    workers: int = 1,
    progress: ProgressCallback | None = None,
) -> Page:
    """Write a page of a dataset.

    The page is one file without anything from elsewhere. Small pictures of every view, and what the detail view
    draws, lie in a folder beside it; what has not changed since the last time is not made again. The pictures of the
    views themselves are those of the dataset.

    Parameters
    ----------
    folder
        Of the dataset.
    out
        The page; ``index.html`` in the dataset's folder by default, with its pictures in ``view/``. Those of a page
        elsewhere, ``NAME.html``, lie in ``NAME_view/`` beside it.
    workers
        Processes on this machine.
    progress
        Told of every sample.

    Raises
    ------
    InputError
        If the dataset is damaged, or the page cannot be written.
    Cancelled
        If ``progress`` returns ``False``.
    """
    dataset = read_dataset(folder)
    page = dataset.folder / PAGE if out is None else Path(out)
    pictures = page.parent / ("view" if out is None else f"{page.stem}_view")
    if page.is_dir():
        raise InputError.at(page, "--out", "is a folder", f"name the file, such as {page / PAGE}")
    try:
        pictures.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError.at(
            pictures, "folder", f"cannot be made ({error.strerror})", "choose a place that is writable"
        ) from error
    rows = _rows(dataset, pictures, workers, progress)
    _tidy(dataset, pictures)
    write_text(page, _page(dataset, page, pictures, rows))
    return Page(page, len(rows), sum(row["figures"] is not None for row in rows))


def _rows(dataset: Dataset, pictures: Path, workers: int, progress: ProgressCallback | None) -> list[dict[str, Any]]:
    total = len(dataset.samples)
    report(progress, Progress("drawing samples", 0, total))
    function = partial(_sample_row, dataset=dataset.folder, pictures=pictures)
    rows: list[dict[str, Any]] = []
    for entry, outcome in run_tasks(function, list(dataset.samples), workers, None):
        if isinstance(outcome, Cancelled):
            raise outcome
        rows.append(_bad_row(entry, outcome) if isinstance(outcome, Exception) else outcome)
        report(progress, Progress("drawing samples", len(rows), total))
    return sorted(rows, key=lambda row: row["index"])


def _bad_row(entry: SampleEntry, error: Exception) -> dict[str, Any]:
    """A sample that cannot be shown."""
    return {"index": entry.index, "error": str(error), "figures": None, "views": 0, "words": "damaged"}


def _sample_row(entry: SampleEntry, dataset: Path, pictures: Path) -> dict[str, Any]:
    """What the page says of a sample; its pictures are drawn if they are not there or out of date."""
    run = dataset / RUNS / sample_name(entry.index)
    place = pictures / sample_name(entry.index)
    key = _key(entry, run)
    try:
        known = read_json(place / ROW_FILE)
        if known["key"] == key:
            return dict(known["row"])
    except (InputError, KeyError):
        pass
    view = view_sample(entry, run)
    with staged_directory(place, overwrite=True) as stage:
        for i, picture in enumerate(view.pictures):
            (stage / PICTURE.format(i)).write_bytes(picture)
        write_text(stage / DATA_FILE, f"frametwin({script_json(view.detail)});\n")
        write_json(stage / ROW_FILE, {"key": key, "row": view.row})
    return view.row


def _key(entry: SampleEntry, run: Path) -> str:
    """What the pictures of a sample depend on."""
    twin = run / TWIN_FILE
    digest = file_hash(twin) if twin.is_file() else ""
    return f"{LOOK} {__version__} {entry.content} {digest}"


def _tidy(dataset: Dataset, pictures: Path) -> None:
    """Remove the pictures of samples that are gone."""
    known = {sample_name(entry.index) for entry in dataset.samples}
    for path in pictures.iterdir():
        if path.name not in known and (path / ROW_FILE).is_file():
            shutil.rmtree(path)


def _page(dataset: Dataset, page: Path, pictures: Path, rows: list[dict[str, Any]]) -> str:
    data = {
        "name": dataset.name,
        "description": dataset.description,
        "seed": dataset.seed,
        "count": dataset.count,
        "folder": _link(dataset.folder, page.parent),
        "pictures": _link(pictures, page.parent),
        "version": __version__,
        "failed": [{"index": entry.index, "reason": entry.reason} for entry in dataset.failed],
        "rows": rows,
    }
    colours = "".join(f"--{name}: rgb{colour}; " for name, colour in COLOURS.items())
    text = resources.files("frametwin.dataset").joinpath(TEMPLATE).read_text(encoding="utf-8")
    for mark, value in (
        ("/*COLOURS*/", colours),
        ("<!--TITLE-->", html.escape(dataset.name)),
        ("/*DATA*/", script_json(data)),
    ):
        text = text.replace(mark, value, 1)
    return text


def _link(target: Path, base: Path) -> str:
    """A link from a page in the folder ``base`` to a folder, without slash at its end; ``.`` for the same folder."""
    try:
        return quote(Path(os.path.relpath(target.resolve(), base.resolve())).as_posix())
    except ValueError:  # another drive
        return target.resolve().as_uri()
