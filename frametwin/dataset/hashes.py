"""Hashes of what a file holds, which are the same wherever and whenever it was written.

PNG and EXR files carry dates and depend on the writer's compression, npz files on the order in which arrays were added;
what counts is the pixels and the arrays.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike, read_bytes
from frametwin.imaging.decoding import decoded

REMEDY = "make the sample again"


@dataclass(frozen=True)
class FileHash:
    """What is noted of one file.

    Attributes
    ----------
    bytes : its size.
    sha256 : SHA-256 of its bytes, hexadecimal.
    content : SHA-256 of its pixels, channels or arrays; of its bytes where there is nothing of the kind.
    """

    bytes: int
    sha256: str
    content: str


def canonical_json(value: Any) -> str:
    """The one way to write ``value`` as JSON: sorted keys, no spaces, numbers in full.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def sample_content(files: Mapping[str, FileHash], specification: Mapping[str, Any]) -> str:
    """Hash of a whole sample, hexadecimal: of the content of its files by name, and of its specification."""
    pairs = sorted([name, entry.content] for name, entry in files.items())
    return hashlib.sha256(canonical_json([pairs, specification]).encode()).hexdigest()


def hash_file(path: PathLike) -> FileHash:
    """Size and hashes of one file.

    Raises
    ------
    InputError
        If it cannot be read, or is damaged so that its content cannot be decoded.
    """
    data = read_bytes(path, remedy=REMEDY)
    return FileHash(len(data), hashlib.sha256(data).hexdigest(), content_hash(Path(path), data))


def content_hash(path: Path, data: bytes | None = None) -> str:
    """SHA-256 of what a file holds, hexadecimal; ``data`` are its bytes where they have been read already.

    Raises
    ------
    InputError
        If it cannot be read or decoded.
    """
    data = read_bytes(path, remedy=REMEDY) if data is None else data
    readers = {".png": _pixels, ".exr": _channels, ".npz": _arrays}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        return hashlib.sha256(data).hexdigest()
    digest = hashlib.sha256()
    for name, array in reader(path, data):
        # Little-endian and row by row, whatever the machine.
        plain = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        digest.update(canonical_json([name, list(plain.shape), plain.dtype.str]).encode())
        digest.update(plain.tobytes())
    return digest.hexdigest()


def _pixels(path: Path, data: bytes) -> Iterable[tuple[str, np.ndarray]]:
    yield "pixels", decoded(data, path, REMEDY)


def _channels(path: Path, data: bytes) -> Iterable[tuple[str, np.ndarray]]:
    """All channels of all parts of an OpenEXR file, sorted by the part's and the channel's name."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            found = [
                ([str(part.name() or ""), str(name)], np.array(channel.pixels))
                for part in file.parts
                for name, channel in part.channels.items()
            ]
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError.at(path, "image", "the EXR file is damaged", REMEDY) from error
    for names, pixels in sorted(found, key=lambda item: item[0]):
        yield canonical_json(names), pixels


def _arrays(path: Path, data: bytes) -> Iterable[tuple[str, np.ndarray]]:
    return sorted(load_npz(path, data).items())


def load_npz(path: PathLike, data: bytes | None = None) -> dict[str, np.ndarray]:
    """The arrays of an npz file; ``data`` are its bytes where they have been read already.

    Raises
    ------
    InputError
        If it is missing, damaged, or holds pickled objects, which are never loaded.
    """
    data = read_bytes(path, remedy=REMEDY) if data is None else data
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, AttributeError, TypeError) as error:
        raise InputError.at(path, "file", "is damaged, or no npz file of plain arrays", REMEDY) from error
