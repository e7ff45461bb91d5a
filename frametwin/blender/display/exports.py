"""What was measured and is shown in a scene, written to files: as it was found, not as the object is by now."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from frametwin.blender.display.twins import TwinObjects
from frametwin.blender.frames.strut_curves import recorded_curves, recorded_frame
from frametwin.errors import InputError
from frametwin.files import write_text
from frametwin.formats import obj as obj_lines
from frametwin.formats import write_frame
from frametwin.formats.frame_json import UNITS
from frametwin.formats.units import scaled
from frametwin.geometry.wireframe import Wireframe


def export_twin(shown: TwinObjects, path: Path, unit: str = "mm") -> None:
    """Write a twin.

    Parameters
    ----------
    shown
        The twin. What is written is what its run holds, in double precision, wherever the object was moved to.
    path
        ``.json`` (a frame file, in which struts that are bent as no cubic can be are the cubics nearest to them) or
        ``.obj`` (lines along all curves as they are); ``.csv`` for a table with a row for every strut and
        a column for every quantity, empty where there is no value.
    unit
        Of lines, one of `frametwin.formats.frame_json.UNITS`; the other files are always in mm, and say so.

    Raises
    ------
    InputError
        If the suffix is another one, or the file cannot be written.
    """
    if path.suffix.lower() == ".csv":
        write_text(path, _table(shown))
    elif path.suffix.lower() in (".json", ".obj"):
        _write(path, shown.frame(), shown.curves(), unit)
    else:
        raise InputError.at(path, "file", "is of no kind that twins are written as", "name it .json, .obj or .csv")


def _table(shown: TwinObjects) -> str:
    columns = list(shown.values.values())
    heads = [f"{column.quantity} {column.unit}".strip().replace(" ", "_") for column in columns]
    rows = [",".join(["strut", *heads, "missing", "uncertain"])]
    flags = [set(found.tolist()) for found in (shown.missing, shown.uncertain)]
    for strut in range(len(columns[0].values)):
        values = [column.values[strut] for column in columns]
        texts = ["" if np.isnan(value) else f"{value:.6g}" for value in values]
        rows.append(",".join([str(strut), *texts, *(str(int(strut in found)) for found in flags)]))
    return "\n".join(rows) + "\n"


def _write(path: Path, frame: Wireframe, curves: np.ndarray, unit: str) -> None:
    if path.suffix.lower() == ".obj":
        factor = 1.0 / UNITS[unit]
        obj_lines.write(path, scaled(frame, factor), unit, factor * curves)
    else:
        write_frame(path, frame)


def export_struts(obj: bpy.types.Object, path: Path, unit: str = "mm") -> None:
    """Write the struts that a Curves object was made to show as a frame file (``.json``) or as lines (``.obj``).

    ``unit`` is that of lines; frame files are always in mm.

    Raises
    ------
    InputError
        If it has lost them, the suffix is another one, or the file cannot be written.
    """
    _write(path, recorded_frame(obj), recorded_curves(obj), unit)
