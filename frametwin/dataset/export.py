"""Handing a dataset on to other programs: reconstruction, drawing, numpy, and the data loaders of machine learning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from frametwin import __version__
from frametwin.dataset.exports.coco_files import check_coco, write_coco
from frametwin.dataset.exports.ledger import LEDGER, is_to_be_kept, open_ledger
from frametwin.dataset.exports.parquet_files import check_parquet, write_parquet
from frametwin.dataset.exports.sample_folders import (
    SampleWriter,
    write_colmap,
    write_folders,
    write_nerfstudio,
    write_npz,
    write_obj,
)
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.exports.webdataset_shards import write_webdataset
from frametwin.dataset.folder import Dataset, read_dataset, sample_name
from frametwin.files import PathLike, staged_directory, write_json
from frametwin.progress import Progress, ProgressCallback, report

__all__ = ["FORMATS", "MARK", "ExportSettings", "export_dataset"]

FORMAT = "frametwin-export"
VERSION = 1
MARK = "export.json"
"""Lies in every export, and says of what it is one."""

Writer = Callable[[Dataset, Path, ExportSettings, ProgressCallback | None], dict[str, Any]]
"""Writes a dataset into a folder; what it returns is added to ``export.json``."""


def _each(write: SampleWriter) -> Writer:
    return partial(write_folders, write)


FORMATS: dict[str, Writer] = {
    "nerfstudio": _each(write_nerfstudio),
    "colmap": _each(write_colmap),
    "obj": _each(write_obj),
    "npz": _each(write_npz),
    "webdataset": write_webdataset,
    "huggingface": write_parquet,
    "coco": write_coco,
}

RESUMABLE = ("webdataset", "huggingface")
"""Formats that go on where they were stopped: shards that were finished are kept beside ``out``, as ``out.part``."""

CHECKS: dict[str, Callable[[], None]] = {"huggingface": check_parquet, "coco": check_coco}
"""Whether the packages that a format needs are there."""


def export_dataset(
    folder: PathLike,
    out: PathLike,
    settings: ExportSettings,
    *,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> int:
    """Write all samples of a dataset in another format, whole or not at all.

    What was finished of `RESUMABLE` formats is kept when the export is stopped, and the same call goes on from there.

    Every sample becomes a folder of its own, ``000000`` and so on, of

    - ``nerfstudio``: ``transforms.json``, ``images/`` and ``plan.ply``, the plan as the point cloud to begin with.
    - ``colmap``: ``images/`` and ``sparse/0/`` with the text model; its 3D points are the plan's, without tracks.
    - ``obj``: ``plan.obj``, ``truth.obj`` and, where there is a run, ``twin.obj``: struts as lines.
    - ``npz``: ``sample.npz``, see `frametwin.dataset.exports.sample_folders.arrays_of`.

    Samples are put together in

    - ``webdataset``: ``train-000000.tar``; see `frametwin.dataset.exports.webdataset_shards`.
    - ``huggingface``: ``data/train-00000-of-00001.parquet`` and ``README.md``; see
      `frametwin.dataset.exports.parquet_files`.
    - ``coco``: ``images/`` and ``annotations/train.json``; see `frametwin.dataset.exports.coco_files`.

    Parameters
    ----------
    folder
        Of the dataset.
    out
        The folder to write.
    settings
        See `ExportSettings`.
    overwrite
        Whether ``out`` is replaced if it exists.
    progress
        Told of every sample.

    Returns
    -------
    Number of samples.

    Raises
    ------
    InputError
        If the dataset or a sample is damaged, a package that the format needs is missing, the folder cannot be
        written, or shards of another export are beside it and ``overwrite`` is not set.
    Cancelled
        If ``progress`` returns ``False``.
    """
    dataset = read_dataset(folder)
    CHECKS.get(settings.format, lambda: None)()
    resumable = settings.format in RESUMABLE
    with staged_directory(out, overwrite, keep=is_to_be_kept if resumable else None) as stage:
        if resumable:
            open_ledger(stage, _conditions(dataset, settings), anew=overwrite)
        found = FORMATS[settings.format](dataset, stage, settings, progress)
        notes = {
            "format": FORMAT,
            "version": VERSION,
            "dataset": dataset.name,
            "kind": settings.format,
            "unit": settings.units,
            **found,
            "samples": {sample_name(entry.index): entry.content for entry in dataset.samples},
        }
        write_json(stage / MARK, notes)
        (stage / LEDGER).unlink(missing_ok=True)
        report(progress, Progress("exporting samples", len(dataset.samples), len(dataset.samples)))
    return len(dataset.samples)


def _conditions(dataset: Dataset, settings: ExportSettings) -> dict[str, Any]:
    """What shards depend on, as a JSON file has it."""
    samples = {sample_name(entry.index): entry.content for entry in dataset.samples}
    options = asdict(settings) | {"split": None if settings.split is None else list(settings.split)}
    return {"frametwin": __version__, "dataset": dataset.name, "settings": options, "samples": samples}
