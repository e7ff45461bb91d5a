"""Hugging Face ``datasets``: Parquet files with encoded pictures, ``data/train-00000-of-00001.parquet``, and a card.

What each column is stands in the schema of every file, as the library itself writes it, so that pictures are decoded.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.dataset.exports.dataset_card import CARD_FILE, card_text
from frametwin.dataset.exports.learning_samples import ARRAY_PARTS, EncodedPicture, LearningSample, learning_samples
from frametwin.dataset.exports.ledger import WRITING, Ledger, Shard
from frametwin.dataset.exports.libraries import needed
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.folder import Dataset
from frametwin.dataset.tensor_kinds import KINDS
from frametwin.files import write_text
from frametwin.imaging.encoding import png_of_16_bits, tiff_of_floats
from frametwin.progress import ProgressCallback

ROW_GROUP_BYTES = 32e6
"""Rows are written together until they are as large: readers fetch whole groups."""

TEXTS, NUMBERS = ("frame", "content", "unit"), ("index", "scene")
PICTURES = ("images", "masks", "backgrounds", "depth", "strut")
"""Columns with a list of pictures, one for each view."""


def check_parquet() -> None:
    """Refuse where Parquet cannot be written."""
    needed("pyarrow.parquet", "pyarrow", "the format huggingface")


def write_parquet(
    dataset: Dataset, stage: Path, settings: ExportSettings, progress: ProgressCallback | None = None
) -> dict[str, Any]:
    """Write a dataset as Parquet files and a card into a folder with a ledger, going on behind files that are there.

    A row is a sample with all its views.

    Returns
    -------
    dict
        Files, and numbers of samples, by part.
    """
    (stage / "data").mkdir(exist_ok=True)
    ledger = Ledger(stage)
    files = _Files(ledger, settings.shard_bytes)
    try:
        for sample in learning_samples(dataset, settings, progress, ledger.samples):
            files.add(sample)
        files.finish()
    finally:
        files.close()
    counts = ledger.counts()
    write_text(stage / CARD_FILE, card_text(dataset, settings, counts, files.columns))
    return {"files": _named(ledger), "parts": counts}


def _named(ledger: Ledger) -> dict[str, list[str]]:
    """Give the files their names, which count them, and tell these by part."""
    names: dict[str, list[str]] = {}
    for part, places in ledger.names().items():
        names[part] = [f"{part}-{k:05d}-of-{len(places):05d}.parquet" for k in range(len(places))]
        for place, name in zip(places, names[part], strict=True):
            if (ledger.folder / place).is_file():  # else an earlier export was stopped here
                (ledger.folder / place).replace(ledger.folder / "data" / name)
    return names


class _Files:
    """Writes samples into Parquet files, of which another begins where one is large enough or the part is another."""

    def __init__(self, ledger: Ledger, limit: float) -> None:
        self.ledger, self.limit = ledger, limit
        # All files have the columns of the first sample: what a dataset has, all of its samples have.
        self.columns = list(ledger.shards[0].columns) if ledger.shards else []
        self._rows: list[Any] = []  # tables of one row
        self._waiting = self._size = 0.0
        self._part = ""
        self._samples: list[int] = []
        self._writer: Any = None
        self._arrow = needed("pyarrow", "pyarrow", "the format huggingface")
        self._parquet = needed("pyarrow.parquet", "pyarrow", "the format huggingface")

    def add(self, sample: LearningSample) -> None:
        """Write a sample behind the last one."""
        row = _row(sample)
        columns = {name: _column(self._arrow, name, value) for name, value in row.items()}
        size = sum(column.nbytes for column in columns.values())
        if self._writer is None or self._part != sample.part or self._size + size > self.limit:
            self.finish()
            self._begin(sample.part, row)
        self._rows.append(self._arrow.Table.from_pydict(columns, schema=self._writer.schema))
        self._waiting, self._size = self._waiting + size, self._size + size
        self._samples.append(sample.facts["index"])
        if self._waiting > ROW_GROUP_BYTES:
            self._write_rows()

    def finish(self) -> None:
        """End the last file, which is then whole."""
        if self._writer is None:
            return
        self._write_rows()
        self.close()
        name = f"data/{self._part}-{len(self.ledger.names().get(self._part, ())):05d}"
        (self.ledger.folder / WRITING).replace(self.ledger.folder / name)
        self.ledger.add(Shard(self._part, name, self._samples, self.columns))
        self._samples = []

    def close(self) -> None:
        """Close the last file."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _begin(self, part: str, row: dict[str, Any]) -> None:
        self.columns = self.columns or list(row)
        features = {name: _feature(name) for name in self.columns}
        notes = {"huggingface": json.dumps({"info": {"features": features}})}
        fields = [(name, _arrow_type(self._arrow, feature)) for name, feature in features.items()]
        schema = self._arrow.schema(fields, metadata=notes)
        self._writer = self._parquet.ParquetWriter(self.ledger.folder / WRITING, schema, compression="zstd")
        self._part, self._size = part, 0.0

    def _write_rows(self) -> None:
        if self._rows:
            self._writer.write_table(self._arrow.concat_tables(self._rows))
        self._rows, self._waiting = [], 0.0


def _row(sample: LearningSample) -> dict[str, Any]:
    """The columns of a sample: values, lists of pictures, and arrays."""
    row: dict[str, Any] = {name: sample.facts[name] for name in (*NUMBERS, *TEXTS, "views")}
    row["images"] = _listed(sample.images, sample.name)
    row["masks"] = _listed(sample.masks, sample.name)
    if sample.backgrounds:
        row["backgrounds"] = _listed(sample.backgrounds, sample.name)
    if sample.passes:
        row["depth"] = _listed([_depth_file(p) for p in sample.passes["depth"]], sample.name)
        row["strut"] = _listed([_strut_file(p) for p in sample.passes["strut"]], sample.name)
    return row | sample.arrays


def _listed(pictures: list[EncodedPicture], sample: str) -> list[dict[str, Any]]:
    return [{"bytes": picture.data, "path": f"{sample}_{picture.name}"} for picture in pictures]


def _depth_file(depth: np.ndarray) -> EncodedPicture:
    """(H, W) float32 as a TIFF of one channel, which keeps every digit, and infinity."""
    return EncodedPicture("depth.tiff", tiff_of_floats(depth))


def _strut_file(strut: np.ndarray) -> EncodedPicture:
    """(H, W) int32 as a PNG of 16 bits, one more than the strut, as in the passes of a sample."""
    return EncodedPicture("strut.png", png_of_16_bits((strut + 1).astype(np.uint16)))


def _column(arrow: Any, name: str, value: Any) -> Any:
    """A column of one row; lists within lists are made of an array without going through Python's numbers."""
    if not isinstance(value, np.ndarray):
        return arrow.array([value], type=_arrow_type(arrow, _feature(name)))
    values = arrow.array(value.ravel())
    for length in reversed(value.shape):
        offsets = arrow.array(np.arange(0, len(values) + 1, length, dtype=np.int32))
        values = arrow.ListArray.from_arrays(offsets, values)
    return values


def _feature(name: str) -> dict[str, Any]:
    """What the library calls the type of a column; ``Sequence`` is known to all of its versions."""
    if name in PICTURES:
        return {"feature": {"_type": "Image"}, "_type": "Sequence"}
    if name in TEXTS or name == "views":
        text = {"dtype": "string", "_type": "Value"}
        return {"feature": text, "_type": "Sequence"} if name == "views" else text
    if name in NUMBERS:
        return {"dtype": "int64", "_type": "Value"}
    kind = KINDS[name]
    assert kind.part in ARRAY_PARTS
    feature: dict[str, Any] = {"dtype": kind.dtype, "_type": "Value"}
    for _ in kind.shape:
        feature = {"feature": feature, "_type": "Sequence"}
    return feature


def _arrow_type(arrow: Any, feature: dict[str, Any]) -> Any:
    """The same type as Arrow has it."""
    if feature["_type"] == "Sequence":
        return arrow.list_(_arrow_type(arrow, feature["feature"]))
    if feature["_type"] == "Image":
        return arrow.struct({"bytes": arrow.binary(), "path": arrow.string()})
    types = {"string": arrow.string, "int64": arrow.int64, "float32": arrow.float32, "bool": arrow.bool_}
    return types[feature["dtype"]]()
