"""WebDataset: tar files whose members with one stem are one sample, as ``train-000000.tar``.

Reference: WebDataset format, version 1 (names, shards, and types by suffix). The same dataset gives the same bytes.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.dataset.exports.learning_samples import LearningSample, learning_samples
from frametwin.dataset.exports.ledger import WRITING, Ledger, Shard
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.folder import Dataset
from frametwin.files import dump_json
from frametwin.progress import ProgressCallback


def write_webdataset(
    dataset: Dataset, stage: Path, settings: ExportSettings, progress: ProgressCallback | None = None
) -> dict[str, Any]:
    """Write a dataset as shards into a folder with a ledger, going on behind those that are there.

    A sample ``000000`` has ``json`` (facts), ``image_00.png`` and so on, ``mask_00.png``, ``background_00.png``,
    ``arrays.npz`` and ``passes.npz``, the last as far as they are there.

    Returns
    -------
    dict
        Shards, and numbers of samples, by part.
    """
    ledger = Ledger(stage)
    shards = _Shards(ledger, settings.shard_bytes)
    try:
        for sample in learning_samples(dataset, settings, progress, ledger.samples):
            shards.add(sample)
        shards.finish()
    finally:
        shards.close()
    return {"shards": ledger.names(), "parts": ledger.counts()}


class _Shards:
    """Writes samples into tar files, of which another begins where one is large enough or the part is another."""

    def __init__(self, ledger: Ledger, limit: float) -> None:
        self.ledger, self.limit = ledger, limit
        self._tar: tarfile.TarFile | None = None
        self._part, self._size = "", 0.0
        self._samples: list[int] = []

    def add(self, sample: LearningSample) -> None:
        """Write a sample behind the last one."""
        members = list(_members(sample))
        size = sum(len(data) for _, data in members)
        if self._tar is None or self._part != sample.part or self._size + size > self.limit:
            self.finish()
            self._tar = tarfile.TarFile(self.ledger.folder / WRITING, "w", format=tarfile.USTAR_FORMAT)
            self._part, self._size = sample.part, 0.0
        for suffix, data in members:
            member = tarfile.TarInfo(f"{sample.name}.{suffix}")  # no date, no owner
            member.size = len(data)
            self._tar.addfile(member, io.BytesIO(data))
        self._size += size
        self._samples.append(sample.facts["index"])

    def finish(self) -> None:
        """End the last file, which is then whole."""
        if self._tar is None:
            return
        self.close()
        name = f"{self._part}-{len(self.ledger.names().get(self._part, ())):06d}.tar"
        (self.ledger.folder / WRITING).replace(self.ledger.folder / name)
        self.ledger.add(Shard(self._part, name, self._samples))
        self._samples = []

    def close(self) -> None:
        """Close the last file."""
        if self._tar is not None:
            self._tar.close()
            self._tar = None


def _members(sample: LearningSample) -> Iterator[tuple[str, bytes]]:
    """Suffix and bytes of every member of a sample."""
    yield "json", dump_json(sample.facts).encode()
    for kind, pictures in (("image", sample.images), ("mask", sample.masks), ("background", sample.backgrounds)):
        for i, picture in enumerate(pictures):
            yield f"{kind}_{i:02d}.{picture.suffix}", picture.data
    yield "arrays.npz", _archive(sample.arrays)
    if sample.passes:
        yield "passes.npz", _archive(sample.passes)


def _archive(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()
