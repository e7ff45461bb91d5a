"""What the public functions take as a frame."""

from __future__ import annotations

import os
from pathlib import Path

from frametwin.files import PathLike
from frametwin.formats import read_frame
from frametwin.geometry.parametric import FRAMES, named_frame
from frametwin.geometry.wireframe import Wireframe


def frame_of(frame: Wireframe | PathLike) -> Wireframe:
    """Return a wireframe as it is, read a frame file, or build one of the built-in frames by its name.

    Raises
    ------
    InputError
        If there is no such file and no such frame, or the file is damaged.
    """
    if isinstance(frame, Wireframe):
        return frame
    name = os.fspath(frame)
    return named_frame(name) if name in FRAMES and not Path(name).exists() else read_frame(name)
