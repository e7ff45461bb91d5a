"""How a dataset is exported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from frametwin.errors import InputError
from frametwin.ranges import Seed, above, check_settings, one_of

FOLDER_FORMATS = ("nerfstudio", "colmap", "obj", "npz")
"""Every sample becomes a folder of its own."""

LEARNING_FORMATS = ("webdataset", "huggingface", "coco")
"""Files that hold many samples, in parts for training and testing."""

NAMES = (*FOLDER_FORMATS, *LEARNING_FORMATS)

UNITS = {"mm": 1.0, "m": 1e-3}

PART_NAMES = {1: ("train",), 2: ("train", "test"), 3: ("train", "validation", "test")}
"""Of so many parts."""


@dataclass(frozen=True)
class ExportSettings:
    """How a dataset is exported.

    Attributes
    ----------
    format : one of `NAMES`.
    unit : of lengths in the files, ``mm`` or ``m``; ``None`` for what is usual for the format.
    link : whether pictures are hard links to those of the dataset, where the file system has them, and not copies.
    split : shares of training and testing, or of training, validation and testing, of the formats for learning;
        ``None`` for training alone. Samples that show one print stay together.
    split_seed : of the choice.
    shard_mb : size in MB after which a format for learning begins another file; every file holds a sample at least.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    format: Annotated[str, one_of(NAMES)]
    unit: Annotated[str, one_of(UNITS)] | None = None
    link: bool = False
    split: tuple[Annotated[float, above(0.0, up_to=1.0, noun="a share")], ...] | None = None
    split_seed: Seed = 0
    shard_mb: Annotated[float, above(0.0, noun="a number of megabytes")] = 500.0

    def __post_init__(self) -> None:
        check_settings(self)
        if self.split is not None and len(self.split) not in PART_NAMES:
            raise InputError.at(
                "settings", "split", f"has {len(self.split)} shares", "give 2 or 3, such as 0.8 and 0.2"
            )
        if self.split is not None and self.format not in LEARNING_FORMATS:
            problem = f"is not for the format {self.format}"
            raise InputError.at("settings", "split", problem, f"leave it out, or use {', '.join(LEARNING_FORMATS)}")

    @property
    def units(self) -> str:
        """The unit of lengths: metres for nerfstudio, whose depths and scene boxes are in metres, else mm."""
        return self.unit or ("m" if self.format == "nerfstudio" else "mm")

    @property
    def scale(self) -> float:
        """Length in the files of one mm."""
        return UNITS[self.units]

    @property
    def shard_bytes(self) -> float:
        """`shard_mb` in bytes."""
        return 1e6 * self.shard_mb

    @property
    def shares(self) -> dict[str, float]:
        """The share of each part by its name."""
        split = self.split or (1.0,)
        return dict(zip(PART_NAMES[len(split)], split, strict=True))
