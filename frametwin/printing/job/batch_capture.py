"""The pictures of a batch: copied into the job, with the job's own plan in place of whatever frame lies beside them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frametwin.capture.capture import Capture, read_capture
from frametwin.errors import InputError
from frametwin.files import PathLike, read_json, write_bytes
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.masks import read_masks
from frametwin.progress import ProgressCallback

_NOTES = ("truth.json", "defects.json", "simulation.json")
"""Files of a capture that are copied for later comparison; the job itself never looks at them."""


@dataclass(frozen=True, eq=False)
class BatchCapture:
    """A capture as the job keeps it.

    Attributes
    ----------
    source
        The folder that it was copied from.
    capture
        The copy; its frame is the job's plan, with what should be printed by now.
    hashes
        SHA-256 of every file that the twin is made from, by its name in the capture.
    claimed : (E,) bool array, optional
        What the source's own ``frame.json`` says is printed, if it says so.
    """

    source: Path
    capture: Capture
    hashes: Mapping[str, str]
    claimed: np.ndarray | None

    def masks(self, progress: ProgressCallback | None = None) -> list[np.ndarray]:
        """Read the pictures; see `frametwin.imaging.masks.read_masks`."""
        with _told_of(self.capture.root, self.source):
            return read_masks(self.capture, progress)

    @property
    def pictures(self) -> dict[str, str]:
        """Hashes of the pictures alone, by their names."""
        return {self._name(view.image): self.hashes[self._name(view.image)] for view in self.capture.views}

    def _name(self, path: Path) -> str:
        return path.relative_to(self.capture.root).as_posix()


def take_capture(source: PathLike, target: Path, expected: Wireframe) -> BatchCapture:
    """Copy a capture into a folder that does not exist yet.

    What is read afterwards is the copy: whoever writes into the source meanwhile changes nothing.

    Parameters
    ----------
    source
        A folder with ``transforms.json`` and its pictures; ``background/`` is taken along, ``frame.json`` is not
        needed.
    target
        The folder to be.
    expected
        The job's plan, with what should be printed by now.

    Raises
    ------
    InputError
        As `read_capture`; if the source's ``frame.json`` is of another frame.
    """
    root = Path(source)
    original = read_capture(root, expected)
    claimed = _claimed(root, expected)
    files = [root / "transforms.json"]
    files += [path for view in original.views for path in (view.image, view.background) if path is not None]
    names = {path: path.relative_to(root).as_posix() for path in files}
    hashes = {names[path]: _copy(path, target / names[path]) for path in files}
    for name in _NOTES:
        if (root / name).is_file():
            _copy(root / name, target / name)
    frame_json.write(target / "frame.json", expected)
    with _told_of(target, root):
        capture = read_capture(target, expected)
    return BatchCapture(root, capture, hashes, claimed)


def _copy(path: Path, target: Path) -> str:
    """Copy a file and return the SHA-256 of what was copied."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError.at(path, "file", f"cannot be read ({error.strerror})", "put the file back") from error
    target.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(target, data)
    return hashlib.sha256(data).hexdigest()


def _claimed(root: Path, expected: Wireframe) -> np.ndarray | None:
    """What the capture's own frame says is printed; ``None`` where there is no frame or it does not say."""
    file = root / "frame.json"
    if not file.is_file():
        return None
    data = read_json(file)
    frame = frame_json.parse(data, file)
    if not np.array_equal(frame.edges, expected.edges):
        remedy = "give a capture of this print, or remove the file, which is not needed"
        raise InputError.at(file, "edges", "are not those of the job's design", remedy)
    return np.array(frame.printed) if "printed" in data else None


@contextmanager
def _told_of(copy: Path, original: Path) -> Iterator[None]:
    """Errors about the copy are told of the original."""
    try:
        yield
    except InputError as error:
        raise InputError(str(error).replace(str(copy), str(original))) from error
