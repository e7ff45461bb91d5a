"""Which struts of a simulated print are missing: ``defects.json`` (format ``frametwin-defects``, version 1).

``struts`` holds the indices of the struts that are missing in whole or in part, and ``present`` the interval
``[from, to]`` of the curve parameter at which each of them is there, ``[0, 0]`` where it is missing entirely.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json

FORMAT = "frametwin-defects"
VERSION = 1
FILE_NAME = "defects.json"


def to_dict(present: np.ndarray, printed: np.ndarray) -> dict[str, Any]:
    """Content of the file.

    Parameters
    ----------
    present
        (E, 2) interval at which each strut is there.
    printed
        (E,) bool; struts that were never printed are no defects.
    """
    struts = np.flatnonzero(printed & ((present[:, 0] > 0.0) | (present[:, 1] < 1.0)))
    return {"format": FORMAT, "version": VERSION, "struts": struts, "present": present[struts]}


def read(path: PathLike, printed: np.ndarray) -> np.ndarray:
    """Read the file.

    Parameters
    ----------
    path
        The file, or the folder of a capture that holds it.
    printed
        (E,) bool of the frame it belongs to.

    Returns
    -------
    (E, 2) interval of the curve parameter at which each strut is there: [0, 1] for whole struts, [0, 0] for
    struts that are missing or not printed.

    Raises
    ------
    InputError
        If the file is missing or damaged, or names struts that the frame does not have or has not printed.
    """
    file = Path(path)
    file = file / FILE_NAME if file.is_dir() else file
    data = read_json(file)
    check_format(data, file, FORMAT, VERSION)
    struts = checked_array(data.get("struts"), "i", (None,), str(file), "struts")
    intervals = checked_array(data.get("present"), "f", (len(struts), 2), str(file), "present")
    present = np.stack([np.zeros(len(printed)), printed.astype(np.float64)], axis=1)
    seen: set[int] = set()
    for i, strut in enumerate(struts.tolist()):
        if not 0 <= strut < len(printed):
            remedy = f"use strut indices from 0 to {len(printed) - 1}"
            raise InputError.at(file, f"struts[{i}]", f"is {strut}, which the frame does not have", remedy)
        if not printed[strut] or strut in seen:
            problem = f"is {strut}, which " + ("is listed twice" if strut in seen else "is not printed")
            raise InputError.at(file, f"struts[{i}]", problem, "remove it")
        seen.add(strut)
        low, high = intervals[i]
        if not 0.0 <= low <= high <= 1.0:
            problem = f"is [{low:g}, {high:g}]"
            raise InputError.at(file, f"present[{i}]", problem, "give two rising numbers from 0 to 1")
    present[struts] = intervals
    return present
