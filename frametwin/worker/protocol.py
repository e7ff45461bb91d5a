"""What a worker and its client say to each other: one JSON object a line, UTF-8, protocol 1.

Requests, on the worker's standard input::

    {"id": "7", "request": "fit", "parameters": {...}, "curves": true}      a job of `frametwin.worker.job_table.JOBS`
    {"id": "8", "request": "versions"}    answered at once, also while a job runs; "hello" is the same
    {"request": "cancel", "id": "7"}      the job ends at its next report of progress; ignored if there is none
    {"request": "quit"}                   as the end of the input: the running job is given up, the process ends

Events, on its standard output::

    {"event": "ready", "protocol": 1, "frametwin": ..., "python": ..., "pid": ..., "cores": 8, "jobs": [...],
     "torch": version or null, ...}       once, at the start
    {"event": "progress", "id": "7", "stage": ..., "iteration": 3, "total": 40, "loss": 0.01 or null}
    {"event": "curves", "id": "7", ...as progress..., "control_points": array}
    {"event": "result", "id": "7", "result": {...}}
    {"event": "error", "id": "7" or null, "kind": "input", "message": "One sentence.", ...}

``curves`` come a few times a second, if the request asks for them: (E, 4, 3) in mm, of the printed struts in the
frame's order. Every job ends with one ``result`` or one ``error``. Kinds of errors:

- ``input``: the parameters, or a file that they name, cannot be used;
- ``held``: a print job stops, as printing on would build on something else than what is there; ``doubts`` is a list of
  objects with ``kind``, ``problem`` and ``remedy``, whose kinds are what ``print-next`` can ``accept``;
- ``cancelled``;
- ``failed``: anything else, with the traceback as ``details`` if nobody foresaw it;
- ``protocol``: a line that is no request; the id is null if it cannot be told.

Where they are known, an error also has the parts of its sentence: ``source`` (a file, or another name), ``field``,
``problem`` and ``remedy``. One job runs at a time, the others wait in their order.

Arrays, in both directions: ``{"dtype": "<f4", "shape": [12, 4, 3], "base64": "..."}``, C order, little-endian.
"""

from __future__ import annotations

import base64
import json
import math
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

PROTOCOL = 1

LONGEST_LINE = 1 << 26
"""In bytes; a frame of a hundred thousand struts is a third of it."""

DTYPES = ("<f4", "<f8", "<i4", "<i8", "|b1", "|u1")
_ARRAY_KEYS = {"dtype", "shape", "base64"}

KINDS = ("input", "held", "cancelled", "failed", "protocol")


class ProtocolError(ValueError):
    """A line that is no message; its text says why."""


def encode(message: Mapping[str, Any]) -> bytes:
    """One line, with its end. Arrays and paths are written as described above and as text.

    Raises
    ------
    ValueError
        If a number is NaN or infinite (inside of arrays they are allowed).
    TypeError
        If it holds something that has no place in JSON.
    """
    text = json.dumps(message, allow_nan=False, separators=(",", ":"), default=_plain)
    return text.encode("ascii") + b"\n"


def decode(line: bytes) -> dict[str, Any]:
    """Read one line; arrays become numpy arrays again.

    Raises
    ------
    ProtocolError
        If it is not one JSON object in UTF-8, or an array in it is damaged.
    """
    try:
        message = json.loads(line.decode("utf-8"), object_hook=_unpacked)
    except UnicodeDecodeError as error:
        raise ProtocolError("the line is not UTF-8") from error
    except ProtocolError:
        raise
    except json.JSONDecodeError as error:
        raise ProtocolError(f"the line is not JSON ({error.msg} at character {error.pos})") from error
    except (ValueError, RecursionError) as error:
        raise ProtocolError("the line is not usable JSON") from error
    if not isinstance(message, dict):
        raise ProtocolError("the line is not a JSON object")
    return message


def finite(value: float | None) -> float | None:
    """The number, or ``None`` where JSON has no word for it."""
    return None if value is None or not math.isfinite(value) else float(value)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy's arrays and scalars, without importing numpy
        return _packed(value) if getattr(value, "ndim", 0) else value.tolist()
    if isinstance(value, os.PathLike):
        # The worker has a working folder of its own.
        return os.path.abspath(os.fspath(value))
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def _packed(array: np.ndarray) -> Any:
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    if little.dtype.str not in DTYPES:
        return array.tolist()
    data = base64.b64encode(little.tobytes()).decode("ascii")
    return {"dtype": little.dtype.str, "shape": list(array.shape), "base64": data}


def _unpacked(value: dict[str, Any]) -> Any:
    if value.keys() != _ARRAY_KEYS:
        return value
    import numpy as np

    dtype, shape, text = value["dtype"], value["shape"], value["base64"]
    fine = dtype in DTYPES and isinstance(shape, list) and isinstance(text, str)
    if not fine or not all(type(side) is int and side >= 0 for side in shape):
        raise ProtocolError("an array in the line is damaged")
    try:
        data = base64.b64decode(text, validate=True)
        return np.frombuffer(data, dtype=dtype).reshape(shape)
    except ValueError as error:
        raise ProtocolError("an array in the line is damaged") from error
