"""Raw pictures of a calibrated rig, one folder a batch, as captures for a job."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.calibration.rig_capture import capture_from_rig, pictures_named
from frametwin.cameras.rig_file import Rig
from frametwin.files import file_hash
from frametwin.geometry.wireframe import Wireframe

NOTE = "raw.json"
"""File of a batch that says which raw pictures it was answered with."""


@dataclass(frozen=True, eq=False)
class RawPictures:
    """How captures are made of the pictures that a rig's cameras drop into a folder.

    Attributes
    ----------
    rig : Rig
        In the robot's world.
    base : (4, 4) array or None, mm
        From the plan's axes to the robot's.
    background : Path or None
        The same views before printing.
    """

    rig: Rig
    base: np.ndarray | None = None
    background: Path | None = None

    def pictures(self, folder: Path) -> list[Path]:
        """Pictures of the rig's cameras that are there, named after them."""
        return sorted(path for name in self.rig.names for path in pictures_named(folder, name))

    def lacking(self, folder: Path) -> str:
        """Which camera's picture is not there yet; empty for none."""
        there = {path.stem for path in self.pictures(folder) if path.stat().st_size > 0}
        return next((f"a picture of {name}" for name in self.rig.names if name not in there), "")

    def write_capture(self, folder: Path, plan: Wireframe, out: Path) -> None:
        """Make a capture of the pictures in a folder; see `frametwin.calibration.rig_capture.capture_from_rig`."""
        capture_from_rig(self.rig, folder, plan, out, base=self.base, background=self.background)

    def note(self, folder: Path) -> dict[str, Any]:
        """What is kept of the raw pictures beside the answer: hashes by name."""
        return {"pictures": {path.name: file_hash(path) for path in self.pictures(folder)}}
