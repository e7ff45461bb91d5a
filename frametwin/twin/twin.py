"""The digital twin of a print, and its file ``twin.json`` (format ``frametwin-twin``, version 1)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.files import PathLike, check_format, read_json, write_json
from frametwin.geometry.wireframe import Wireframe

FORMAT = "frametwin-twin"
VERSION = 1
FILE_NAME = "twin.json"


@dataclass(frozen=True, eq=False, repr=False)
class Twin:
    """Where every strut of a frame is, in the order of the frame. Arrays are checked, copied and read-only.

    Attributes
    ----------
    control_points
        (E, 4, 3) curves in mm; those of unprinted struts are blended to meet the printed ones.
    vertices
        (V, 3) joints in mm.
    thickness
        (E, K) radius of the strut at each of its K kernels in mm.
    opacity
        (E, K) opacity of each kernel, 0..1.
    completeness
        (E,) share of the strut that is really there, 0..1; 0 where it is not printed.
    confidence
        (E,) how well the views determine the strut, 0 or more.
    loss
        Image loss after each iteration.
    timing
        Seconds by stage.
    provenance
        How the twin was made: version, preset, seed, hashes of the inputs.

    Raises
    ------
    InputError
        If a value is of another shape, not finite, or out of its range; the message names ``source``.
    """

    control_points: np.ndarray
    vertices: np.ndarray
    thickness: np.ndarray
    opacity: np.ndarray
    completeness: np.ndarray
    confidence: np.ndarray
    loss: Sequence[float] = ()
    timing: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    source: InitVar[str] = "twin"

    def __post_init__(self, source: str) -> None:
        curves = checked_array(self.control_points, "f", (None, 4, 3), source, "control_points")
        struts = len(curves)
        if struts == 0:
            raise InputError.at(source, "control_points", "the twin holds no strut", "fit the capture again")
        thickness = checked_array(self.thickness, "f", (struts, None), source, "thickness")
        arrays = {
            "control_points": curves,
            "vertices": checked_array(self.vertices, "f", (None, 3), source, "vertices"),
            "thickness": _in_range(thickness, math.inf, source, "thickness"),
            "opacity": _in_range(
                checked_array(self.opacity, "f", thickness.shape, source, "opacity"), 1.0, source, "opacity"
            ),
            "completeness": _in_range(
                checked_array(self.completeness, "f", (struts,), source, "completeness"),
                1.0,
                source,
                "completeness",
            ),
            "confidence": _in_range(
                checked_array(self.confidence, "f", (struts,), source, "confidence"),
                math.inf,
                source,
                "confidence",
            ),
        }
        for name, value in arrays.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        loss = checked_array(list(self.loss), "f", (None,), source, "loss")
        object.__setattr__(self, "loss", tuple(loss.tolist()))
        for name in ("timing", "provenance"):
            value = getattr(self, name)
            if not isinstance(value, Mapping):
                raise InputError.at(source, name, "is not an object", "write {...}")
            object.__setattr__(self, name, dict(value))

    def __repr__(self) -> str:
        return f"Twin({self.strut_count} struts, {len(self.vertices)} vertices)"

    @property
    def strut_count(self) -> int:
        """Number of struts E."""
        return len(self.control_points)

    def replace(self, **changes: Any) -> Twin:
        """A copy with other values in some fields, checked anew.

        Raises
        ------
        InputError
            If a value is of another shape, not finite, or out of its range.
        TypeError
            If there is no such field.
        """
        return dataclasses.replace(self, **changes)

    def as_wireframe(self, frame: Wireframe) -> Wireframe:
        """Give the plan ``frame`` the twin's curves.

        Raises
        ------
        InputError
            If the twin is not one of this frame: other numbers of struts or vertices, or curves that do not
            end on the vertices.
        """
        if (self.strut_count, len(self.vertices)) != (frame.strut_count, frame.vertex_count):
            raise InputError.at(
                frame.name,
                "edges",
                f"has {frame.strut_count} struts and {frame.vertex_count} vertices,"
                f" the twin {self.strut_count} and {len(self.vertices)}",
                "give the frame that the twin was made from",
            )
        return frame.replace(vertices=self.vertices, control_points=self.control_points)


_FIELDS = tuple(item.name for item in fields(Twin))


def _in_range(values: np.ndarray, highest: float, source: str, name: str) -> np.ndarray:
    wrong = np.argwhere((values < 0.0) | (values > highest))
    if wrong.size:
        place = "".join(f"[{int(i)}]" for i in wrong[0])
        wanted = "0 or more" if highest == math.inf else f"between 0 and {highest:g}"
        raise InputError.at(
            source, f"{name}{place}", f"is {values[tuple(wrong[0])]:g}", f"give a value that is {wanted}"
        )
    return values


def write_twin(folder: PathLike, twin: Twin) -> Path:
    """Write ``twin.json`` into the run folder ``folder``, which exists; reading it gives back the same bits.

    Returns
    -------
    path
        The file.

    Raises
    ------
    InputError
        If it cannot be written.
    ValueError
        If ``timing`` or ``provenance`` hold a NaN or an infinity.
    """
    path = Path(folder) / FILE_NAME
    write_json(path, {"format": FORMAT, "version": VERSION, **{name: getattr(twin, name) for name in _FIELDS}})
    return path


def read_twin(path: PathLike) -> Twin:
    """Read a twin from a run folder, or from its ``twin.json``.

    Raises
    ------
    InputError
        If the file is missing or damaged, of another format or version, or a field is missing or wrong.
    """
    file = Path(path)
    file = file / FILE_NAME if file.is_dir() else file
    data = read_json(file)
    check_format(data, file, FORMAT, VERSION)
    for name in _FIELDS:
        if name not in data:
            raise InputError.at(file, name, "is missing", "fit the capture again")
    unknown = [key for key in data if key not in (*_FIELDS, "format", "version")]
    if unknown:
        raise InputError.at(file, unknown[0], "is not a field of a twin file", "remove it")
    if not isinstance(data["loss"], list):
        raise InputError.at(file, "loss", "is not a list", "write the loss after each iteration as [number, ...]")
    return Twin(**{name: data[name] for name in _FIELDS}, source=str(file))
