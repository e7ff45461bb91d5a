"""Data to learn from: the samples of a dataset as tensors, and batches of them.

This module needs torch; `frametwin.dataset` hands its names out without importing it before they are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.nn.functional import pad
from torch.utils.data import Dataset as TorchDataset

from frametwin.capture.capture import read_capture
from frametwin.dataset.folder import SampleEntry, read_dataset, read_sample
from frametwin.dataset.sample_arrays import parts_of, sample_arrays
from frametwin.dataset.tensor_kinds import COUNTED, KINDS, PARTS
from frametwin.errors import InputError
from frametwin.files import PathLike

Tensors = dict[str, torch.Tensor]


class CaptureDataset(TorchDataset[Tensors]):
    """The samples of a dataset as tensors, for `torch.utils.data.DataLoader`.

    An item is one sample with all of its views. Names, shapes, types and units are those of the table on the page on
    datasets; lengths are in mm. Samples differ in the number of their struts, joints and perhaps views, so a loader of
    batches needs ``collate_fn=collate_captures``.

    Parameters
    ----------
    folder : path
        The dataset's folder.
    indices : sequence of int, optional
        Samples by their index, such as a part that `split_indices` gives; all by default.
    parts : sequence of str, optional
        Some of ``images``, ``backgrounds``, ``masks``, ``cameras``, ``curves``, ``visibility``, ``passes``; all that
        the first of the samples has by default. What is left out is not read.
    transform : callable, optional
        What to make of the dictionary of tensors of each sample. It has to be picklable for loaders with workers
        wherever these are started afresh (Windows, macOS).

    Raises
    ------
    InputError
        If the dataset is damaged or empty, has not all of ``indices``, or a part is unknown; for an item, if its
        files are damaged or a part is not there.
    """

    def __init__(
        self,
        folder: PathLike,
        *,
        indices: Sequence[int] | None = None,
        parts: Sequence[str] | None = None,
        transform: Callable[[Tensors], Any] | None = None,
    ) -> None:
        dataset = read_dataset(folder)
        self.folder = Path(folder)
        self.transform = transform
        self.entries = _chosen(dataset.folder, dataset.samples, indices)
        self.parts = parts_of(read_sample(self.entries[0].folder)) if parts is None else _checked_parts(parts)

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, place: int) -> Any:
        """The sample at a place of the list: ``index`` () int64, and the arrays of its parts."""
        entry = self.entries[place]
        arrays = sample_arrays(read_capture(entry.folder), self.parts)
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
        tensors["index"] = torch.tensor(entry.index)
        return tensors if self.transform is None else self.transform(tensors)


def _chosen(folder: Path, samples: Sequence[SampleEntry], indices: Sequence[int] | None) -> tuple[SampleEntry, ...]:
    by_index = {entry.index: entry for entry in samples}
    wanted = list(by_index) if indices is None else [int(index) for index in indices]
    absent = [index for index in wanted if index not in by_index]
    if absent:
        raise InputError.at(folder, "indices", f"sample {absent[0]} is not there", "generate it, or leave it out")
    if not wanted:
        raise InputError.at(folder, "samples", "there is none", "generate the dataset, or choose one sample or more")
    return tuple(by_index[index] for index in wanted)


def _checked_parts(parts: Sequence[str]) -> tuple[str, ...]:
    unknown = [part for part in parts if part not in PARTS]
    if unknown or not parts or isinstance(parts, str):
        problem = f"{unknown[0]!r} is unknown" if unknown and not isinstance(parts, str) else "are no list of names"
        raise InputError.at("settings", "parts", problem, f"give some of {', '.join(PARTS)}")
    return tuple(part for part in PARTS if part in parts)


def collate_captures(samples: Sequence[Tensors]) -> Tensors:
    """Put samples into one batch, B first; where they have fewer views, struts or joints than others, zeros follow.

    Parameters
    ----------
    samples : sequence of dict
        Items of a `CaptureDataset`, perhaps with further tensors of a transform, which need to have one shape.

    Returns
    -------
    dict of tensors
        Each of ``samples`` with an axis B before its own, and ``is_view`` (B, N), ``is_strut`` (B, E) and ``is_joint``
        (B, V) bool, which are false where a sample was filled up. What is filled up of ``edges`` is joint 0.

    Raises
    ------
    InputError
        If the samples have not the same names, or differ in shape otherwise, as in the size of their pictures.
    """
    names = list(samples[0])
    for sample in samples[1:]:
        if set(sample) != set(names):
            name = sorted(set(sample) ^ set(names))[0]
            raise InputError.at("batch", name, "is not in all samples", "choose parts that all samples have")
    axes = {name: KINDS[name].shape if name in KINDS else () for name in names}
    batch = {name: _filled_up(name, [sample[name] for sample in samples], axes[name]) for name in names}
    for axis, mark in COUNTED.items():
        holders = [name for name in names if axis in axes[name]]
        if holders:
            place = axes[holders[0]].index(axis)
            counts = torch.tensor([sample[holders[0]].shape[place] for sample in samples])
            batch[mark] = torch.arange(int(counts.max())) < counts[:, None]
    return batch


def _filled_up(name: str, tensors: Sequence[torch.Tensor], axes: Sequence[str | int]) -> torch.Tensor:
    """One tensor of several, of which the axes that differ from sample to sample are filled up with zeros."""
    if len({tensor.ndim for tensor in tensors}) == 1:
        largest = np.array([tensor.shape for tensor in tensors]).reshape(len(tensors), -1).max(axis=0)
        free = [k < len(axes) and axes[k] in COUNTED for k in range(len(largest))]
        if all(t.shape[k] == largest[k] for t in tensors for k in range(len(largest)) if not free[k]):
            return torch.stack([_padded(tensor, largest.tolist()) for tensor in tensors])
    raise InputError.at("batch", name, "differs in shape between samples", "use batches of 1, or resize in a transform")


def _padded(tensor: torch.Tensor, shape: Sequence[int]) -> torch.Tensor:
    """A tensor with zeros behind it along every axis that is too short."""
    missing = [wanted - found for wanted, found in zip(shape, tensor.shape, strict=True)]
    return pad(tensor, [k for count in reversed(missing) for k in (0, int(count))]) if any(missing) else tensor
