"""A sample as files for learning hold it: encoded pictures, arrays, and facts about it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from frametwin.capture.capture import Capture, read_capture
from frametwin.capture.image_files import encode_png
from frametwin.capture.picture import Picture
from frametwin.dataset.camera_errors import TRUE_FILE
from frametwin.dataset.exports.settings import ExportSettings
from frametwin.dataset.folder import Dataset, SampleEntry, read_sample, sample_name
from frametwin.dataset.sample_arrays import Arrays, parts_of, sample_arrays
from frametwin.dataset.splits import split_samples
from frametwin.dataset.tensor_kinds import KINDS, PARTS
from frametwin.errors import InputError
from frametwin.progress import Progress, ProgressCallback, report

ARRAY_PARTS = ("cameras", "true_cameras", "curves", "visibility")
"""Parts that are arrays in files; the others are pictures."""

PASSES = tuple(kind.name for kind in KINDS.values() if kind.part == "passes")


@dataclass(frozen=True, eq=False)
class EncodedPicture:
    """A picture file: its name with suffix, and its bytes."""

    name: str
    data: bytes

    @property
    def suffix(self) -> str:
        """Of the name, in lower case, without the dot."""
        return self.name.rpartition(".")[2].lower()


@dataclass(frozen=True, eq=False)
class LearningSample:
    """A sample with all of its views.

    Attributes
    ----------
    name : str
        ``000000`` and so on.
    part : str
        ``train``, ``validation`` or ``test``.
    facts : dict
        Index, scene, frame, the hash of its content, unit of lengths, names of the views.
    capture : Capture
        It itself.
    images, masks, backgrounds : list of EncodedPicture
        One for each view; masks are PNG, 255 where the print covers all of a pixel. Backgrounds may be none.
    arrays : dict of arrays
        Those of `ARRAY_PARTS` by name, see `frametwin.dataset.tensor_kinds.KINDS`.
    passes : dict of arrays
        Depth, normal and strut index, or none.
    share : (N, H, W) float32 array
        The masks, not encoded.
    """

    name: str
    part: str
    facts: dict[str, Any]
    capture: Capture
    images: list[EncodedPicture]
    masks: list[EncodedPicture]
    backgrounds: list[EncodedPicture]
    arrays: Arrays
    passes: Arrays
    share: np.ndarray


def learning_samples(
    dataset: Dataset,
    settings: ExportSettings,
    progress: ProgressCallback | None = None,
    without: Collection[int] = (),
) -> Iterator[LearningSample]:
    """All samples of a dataset, part by part, by rising index; but not those whose index is among ``without``.

    Raises
    ------
    InputError
        If there is no sample, one is damaged or has no ``curves.npz``, or the dataset cannot be split.
    Cancelled
        If ``progress`` returns ``False``.
    """
    entries = {entry.index: entry for entry in dataset.samples}
    if not entries:
        raise InputError.at(dataset.folder, "samples", "there is none", "generate the dataset first")
    if settings.split is None:
        parts = {"train": list(entries)}
    else:
        parts = split_samples(dataset, settings.shares, settings.split_seed)
    erring = any((entry.folder / TRUE_FILE).is_file() for entry in dataset.samples)
    extra = {"visibility", "true_cameras"} if erring else {"visibility"}
    done = 0
    for part, indices in parts.items():
        for index in indices:
            report(progress, Progress("exporting samples", done, len(entries)))
            if index not in without:
                yield _learning_sample(entries[index], part, settings, extra)
            done += 1


def _learning_sample(entry: SampleEntry, part: str, settings: ExportSettings, extra: set[str]) -> LearningSample:
    """A sample with the parts that its files give and some more, which all samples of a dataset shall have."""
    sample, capture = read_sample(entry.folder), read_capture(entry.folder)
    there = {*parts_of(sample), *extra}
    wanted = [name for name in PARTS if name in there and name not in ("images", "backgrounds")]
    arrays = sample_arrays(capture, wanted, settings.scale)
    share = arrays.pop("masks")
    passes = {name: arrays.pop(name) for name in PASSES if name in arrays}
    names = [view.camera.name for view in capture.views]
    masks = [_mask_file(name, mask) for name, mask in zip(names, share, strict=True)]
    facts = {
        "index": entry.index,
        "scene": sample.specification.get("scene", entry.index),
        "frame": capture.frame.name,
        "content": entry.content,
        "unit": settings.units,
        "views": names,
    }
    return LearningSample(
        name=sample_name(entry.index),
        part=part,
        facts=facts,
        capture=capture,
        images=[_encoded(view.image) for view in capture.views],
        masks=masks,
        backgrounds=[_encoded(view.background) for view in capture.views if view.background is not None],
        arrays=arrays,
        passes=passes,
        share=share,
    )


def _encoded(picture: Picture) -> EncodedPicture:
    return EncodedPicture(picture.path.name, picture.data)


def _mask_file(name: str, mask: np.ndarray) -> EncodedPicture:
    return EncodedPicture(f"{name}.png", encode_png(np.rint(255.0 * mask).astype(np.uint8)))
