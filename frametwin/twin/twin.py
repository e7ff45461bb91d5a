"""The digital twin of a print, and its file ``twin.json`` (format ``frametwin-twin``, version 2; 1 is still read)."""

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
from frametwin.geometry.displacement import curve_change
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.bent import bent_as_records, bent_from_records, checked_bent, curves_with
from frametwin.twin.verdict import Verdict

FORMAT = "frametwin-twin"
VERSION = 2
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
    sigma_across, sigma_along
        (E,) standard deviation of the strut's curve (see `curves`) across and along itself in mm; ``None`` where
        nothing is known of it.
    joint_radius
        (V,) radius of the material at each joint in mm; ``None`` likewise.
    attached
        (E, 2) bool: whether the start and the end of the strut are at their joints; ``None`` where nobody looked.
    gap
        (E, 2) how far an end that is not attached is from its joint in mm, 0 for the others; ``None`` likewise.
    bent
        Curves (n + 1, 3) of a degree n above 3, in mm, by strut, of struts that are bent as no cubic can be; their
        ``control_points`` are those of the cubics nearest to them. See `curves`.
    cameras
        What was corrected of each camera, and by how many standard deviations of its rig.
    views
        Of each view its name, whether it was used, and the shares of its white that the twin does not explain and of
        the twin that it does not show.
    verdict
        Whether the twin is to be trusted.
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
    sigma_across: np.ndarray | None = None
    sigma_along: np.ndarray | None = None
    joint_radius: np.ndarray | None = None
    attached: np.ndarray | None = None
    gap: np.ndarray | None = None
    bent: Mapping[int, np.ndarray] = field(default_factory=dict)
    cameras: Sequence[Mapping[str, Any]] = ()
    views: Sequence[Mapping[str, Any]] = ()
    verdict: Verdict = Verdict()
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
        joints = len(arrays["vertices"])
        for name, count in (("sigma_across", struts), ("sigma_along", struts), ("joint_radius", joints)):
            if getattr(self, name) is not None:
                values = checked_array(getattr(self, name), "f", (count,), source, name)
                arrays[name] = _in_range(values, math.inf, source, name)
        if self.attached is not None:
            arrays["attached"] = checked_array(self.attached, "b", (struts, 2), source, "attached")
        if self.gap is not None:
            arrays["gap"] = _in_range(checked_array(self.gap, "f", (struts, 2), source, "gap"), math.inf, source, "gap")
        for name, value in arrays.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "bent", checked_bent(self.bent, struts, source))
        loss = checked_array(list(self.loss), "f", (None,), source, "loss")
        object.__setattr__(self, "loss", tuple(loss.tolist()))
        for name in ("cameras", "views"):
            items = getattr(self, name)
            if not isinstance(items, Sequence) or not all(isinstance(item, Mapping) for item in items):
                raise InputError.at(source, name, "is not a list of objects", "write [{...}, ...]")
            object.__setattr__(self, name, tuple(dict(item) for item in items))
        object.__setattr__(self, "verdict", Verdict.checked(self.verdict, source))
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

    @property
    def curves(self) -> np.ndarray:
        """(E, n + 1, 3) array, mm: the curves at the highest degree of any strut, 3 where none is `bent`."""
        return curves_with(self.control_points, self.bent)

    def change_from(self, frame: Wireframe) -> np.ndarray:
        """(E, n + 1, 3) array, mm: curves of the displacement of each strut from the plan ``frame``."""
        return curve_change(frame.control_points, self.curves)

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
        """Give the plan ``frame`` the twin's curves, and those of `bent` struts the cubics nearest to them.

        Ends that are torn off their joints get vertices of their own after those of the plan.

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
        torn = np.zeros((0, 2), dtype=np.int64) if self.attached is None else np.argwhere(~self.attached)
        return frame.detached(torn, vertices=self.vertices, control_points=self.control_points)


_FIELDS = tuple(item.name for item in fields(Twin))
_SINCE_2 = ("sigma_across", "sigma_along", "joint_radius", "attached", "gap", "bent", "cameras", "views", "verdict")
_OPTIONAL = ("attached", "gap", "bent")


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
    content = {name: getattr(twin, name) for name in _FIELDS} | {"verdict": dataclasses.asdict(twin.verdict)}
    if twin.bent:
        content["bent"] = bent_as_records(twin.bent)
    else:
        del content["bent"]
    write_json(path, {"format": FORMAT, "version": VERSION, **content})
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
    version = check_format(data, file, FORMAT, VERSION, oldest=1)
    wanted = [name for name in _FIELDS if version > 1 or name not in _SINCE_2]
    for name in wanted:
        if name not in data and name not in _OPTIONAL:
            raise InputError.at(file, name, "is missing", "fit the capture again")
    unknown = [key for key in data if key not in (*wanted, "format", "version")]
    if unknown:
        raise InputError.at(file, unknown[0], "is not a field of a twin file", "remove it")
    if not isinstance(data["loss"], list):
        raise InputError.at(file, "loss", "is not a list", "write the loss after each iteration as [number, ...]")
    values = {name: data[name] for name in wanted if name in data}
    if "bent" in values:
        values["bent"] = bent_from_records(values["bent"], str(file))
    return Twin(**values, source=str(file))
