"""Frames in other units than the millimetre: of files that do not say so, and for programs that expect them."""

from __future__ import annotations

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.formats import foreign_unit
from frametwin.formats.frame_json import UNITS
from frametwin.geometry.wireframe import Wireframe, lowest_vertices


def taken_in(frame: Wireframe, unit: str, path: PathLike) -> Wireframe:
    """A frame as read from a file, whose lengths are in a unit that the file does not state.

    Parameters
    ----------
    frame
        As `read_frame` gives it, which takes a file without a unit to be in mm.
    unit
        One of `UNITS`.
    path
        The file.

    Returns
    -------
    In mm: all lengths multiplied, the radius too, as by ``frametwin convert --scale``.

    Raises
    ------
    InputError
        If the file states another unit.
    """
    stated = foreign_unit(path)
    if stated is not None and stated != unit:
        raise InputError.at(path, "unit", f"is {stated} by the file itself, not {unit}", "leave the unit to the file")
    return frame if stated is not None else scaled(frame, UNITS[unit])


def scaled(frame: Wireframe, factor: float) -> Wireframe:
    """A frame with all lengths multiplied by a factor.

    Where its feet are those that are taken where a file names none, they are taken anew: all of a frame in metres seems
    to lie on the plate while its numbers are read as millimetres.
    """
    if factor == 1.0:
        return frame
    result = frame.transformed(np.diag([factor, factor, factor, 1.0]))
    if np.array_equal(frame.grounded, lowest_vertices(frame.vertices, frame.edges)):
        feet = frame.grounded & lowest_vertices(result.vertices, result.edges)
        result = result.replace(grounded=feet)
    return result
