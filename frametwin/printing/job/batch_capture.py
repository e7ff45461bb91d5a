"""The pictures of a batch: copied into the job, with the job's own plan in place of whatever frame lies beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frametwin.capture.capture import Capture, read_capture
from frametwin.errors import InputError
from frametwin.files import PathLike, read_bytes, read_json, write_bytes
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe

_NOTES = ("truth.json", "defects.json", "simulation.json")
"""Files of a capture that are copied for later comparison; the job itself never looks at them."""


@dataclass(frozen=True, eq=False)
class BatchCapture:
    """A capture that the job has a copy of.

    Attributes
    ----------
    capture : Capture
        As it was read from the folder that was given; its frame is the job's plan, with what should be printed by now.
    claimed : (E,) array of bool or None
        What the folder's own ``frame.json`` says is printed, if it says so.
    """

    capture: Capture
    claimed: np.ndarray | None

    @property
    def pictures(self) -> dict[str, str]:
        """Hashes of the pictures after the batch, by their names in the capture."""
        return {self.capture.name_of(view.image): view.image.sha256 for view in self.capture.views}


def take_capture(source: PathLike, target: Path, expected: Wireframe) -> BatchCapture:
    """Read a capture and write what was read into a folder that does not exist yet.

    Every file is read once: whoever writes into the source meanwhile changes nothing.

    Parameters
    ----------
    source : path
        A folder with ``transforms.json`` and its pictures; ``background/`` is taken along, ``frame.json`` is not
        needed.
    target : Path
        The folder to be.
    expected : Wireframe
        The job's plan, with what should be printed by now.

    Raises
    ------
    InputError
        As `read_capture`; if the source's ``frame.json`` is of another frame.
    """
    root = Path(source)
    capture = read_capture(root, expected)
    claimed = _claimed(root, expected)
    contents = {**capture.documents, **{capture.name_of(picture): picture.data for picture in capture.pictures}}
    contents |= {name: read_bytes(root / name) for name in _NOTES if (root / name).is_file()}
    for name, data in contents.items():
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(target / name, data)
    frame_json.write(target / "frame.json", expected)
    return BatchCapture(capture, claimed)


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
