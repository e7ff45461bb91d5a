"""A picture file of a capture, read once: the bytes that are checked are those that are decoded, hashed and copied."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from frametwin.capture.image_files import image_size, read_image_bytes
from frametwin.files import PathLike


@dataclass(frozen=True)
class Picture:
    """What a picture file held when it was read.

    Attributes
    ----------
    path : Path
        The file.
    data : bytes
        What it held, still encoded.
    size : tuple of int, pixels
        Width and height.
    """

    path: Path
    data: bytes = field(repr=False)
    size: tuple[int, int]

    @classmethod
    def read(cls, path: PathLike) -> Picture:
        """Read a picture and check that it is whole, without decoding it.

        Raises
        ------
        InputError
            If the file is missing, not a PNG or JPEG, cut short, or (PNG) has a wrong checksum.
        """
        data = read_image_bytes(path)
        return cls(Path(path), data, image_size(path, data))

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file, hexadecimal."""
        return hashlib.sha256(self.data).hexdigest()
