"""What the tool does to lay one batch: where it goes, how it is held, how fast, and when material flows.

For each strut: over the print at a safe height, down beside it or above it, along the tool's axis to the strut's
start, a pause with material flowing, along the strut, a pause while it hardens, and back the same way. Drawn back
along its axis a nozzle that widens upwards touches nothing that it did not touch before, and it turns only above all
that stands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import InitVar, dataclass
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.anticipation import Anticipation
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.toolpath.axes import checked_axes
from frametwin.printing.toolpath.moves import Clearing, tool_rotations

TRAVEL, APPROACH, PRINT, RETREAT = range(4)
KINDS = ("travel", "approach", "print", "retreat")


@dataclass(frozen=True)
class WaypointSettings:
    """How struts are laid.

    Attributes
    ----------
    spacing
        Distance between waypoints along a strut in mm, at most; ``None`` for two strut radii.
    speed, approach_speed, travel_speed
        Of the tip in mm/s: laying, along the tool's axis to and from the strut, and elsewhere.
    start_dwell, end_dwell
        Pauses in s: with material flowing before the strut, without after it.
    clearance
        Air between nozzle and print at the safe height in mm; ``None`` for ten strut radii.
    nozzle
        ``None`` for `Nozzle.fitting`.
    max_tilt_deg
        How far the tool may lean where a planned axis is no longer free.
    allow_contact
        Write waypoints that touch printed struts and say so, instead of refusing.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    spacing: float | None = None
    speed: float = 5.0
    approach_speed: float = 20.0
    travel_speed: float = 60.0
    start_dwell: float = 0.5
    end_dwell: float = 2.0
    clearance: float | None = None
    nozzle: Nozzle | None = None
    max_tilt_deg: float = 60.0
    allow_contact: bool = False

    def __post_init__(self) -> None:
        for field in ("spacing", "speed", "approach_speed", "travel_speed", "clearance"):
            value = getattr(self, field)
            if value is not None and not 0.0 < value < 1e6:
                raise InputError.at("settings", field, f"is {value}", "give a number above 0")
        for field in ("start_dwell", "end_dwell"):
            if not 0.0 <= getattr(self, field) < 1e6:
                raise InputError.at("settings", field, f"is {getattr(self, field)}", "give seconds from 0 up")
        if not 0.0 <= self.max_tilt_deg < 90.0:
            raise InputError.at(
                "settings", "max_tilt_deg", f"is {self.max_tilt_deg}", "give degrees from 0 up, below 90"
            )


@dataclass(frozen=True, eq=False)
class Waypoints:
    """Poses of the tool in the order in which it takes them. Arrays are checked, copied and read-only.

    Attributes
    ----------
    position
        (N, 3) of the tip in mm, in the coordinates of the frame.
    rotation
        (N, 3, 3) of the tool: its columns are x, y and z of the tool; z points out of the nozzle, against the axis.
    speed
        (N,) mm/s on the way to the waypoint.
    extrude
        (N,) bool: material flows during the pause at the waypoint and on the way to the next.
    dwell
        (N,) pause in s.
    kind
        (N,) of the way to the waypoint: `TRAVEL`, `APPROACH` (to a strut's start), `PRINT` or `RETREAT`.
    strut
        (N,) strut that is laid there, or that the way leads to or from.
    deviation
        (N,) distance in mm of waypoints on a strut from the same points of the design; 0 elsewhere.
    radius
        (N,) of the strut in mm.
    batch
        Number of the batch.
    contacts
        What is touched on the way, in sentences.
    """

    position: np.ndarray
    rotation: np.ndarray
    speed: np.ndarray
    extrude: np.ndarray
    dwell: np.ndarray
    kind: np.ndarray
    strut: np.ndarray
    deviation: np.ndarray
    radius: np.ndarray
    batch: int
    contacts: tuple[str, ...] = ()
    source: InitVar[str] = "waypoints"

    def __post_init__(self, source: str) -> None:
        count = len(self.position)
        shapes: Mapping[str, tuple[str, tuple[int, ...]]] = {
            "position": ("f", (count, 3)), "rotation": ("f", (count, 3, 3)), "speed": ("f", (count,)),
            "extrude": ("b", (count,)), "dwell": ("f", (count,)), "kind": ("i", (count,)), "strut": ("i", (count,)),
            "deviation": ("f", (count,)), "radius": ("f", (count,)),
        }  # fmt: skip
        for field, (kind, shape) in shapes.items():
            value = checked_array(getattr(self, field), kind, shape, source, field)
            value.setflags(write=False)
            object.__setattr__(self, field, value)
        for field in ("speed", "dwell"):
            if (getattr(self, field) < 0.0).any():
                raise InputError.at(source, field, "is below 0", "give no number below 0")
        gram = np.swapaxes(self.rotation, 1, 2) @ self.rotation
        if np.abs(gram - np.eye(3)).max(initial=0.0) > 1e-6 or (np.linalg.det(self.rotation) < 0.0).any():
            raise InputError.at(source, "rotation", "is not a rotation everywhere", "give right-handed unit axes")

    def __len__(self) -> int:
        return len(self.position)

    @property
    def axis(self) -> np.ndarray:
        """(N, 3) the tool's axis, from the tip upwards."""
        return -self.rotation[:, :, 2]

    @property
    def seconds(self) -> float:
        """How long it takes, accelerations left out."""
        steps = np.linalg.norm(np.diff(self.position, axis=0), axis=1)
        return float((steps / self.speed[1:]).sum() + self.dwell.sum())

    @property
    def struts(self) -> np.ndarray:
        """The struts that are laid, in their order."""
        printed = self.strut[self.kind == PRINT]
        return printed[np.sort(np.unique(printed, return_index=True)[1])]


def waypoints_of(
    plan: Wireframe,
    sequence: PrintSequence,
    batch: int,
    settings: WaypointSettings | None = None,
    design: Wireframe | None = None,
    rate: np.ndarray | None = None,
) -> Waypoints:
    """The tool's way for the struts of one batch.

    Parameters
    ----------
    plan
        Where the struts are to be laid; those of earlier batches where they are.
    sequence
        The order of all struts.
    batch
        Its number, from 0.
    settings
        How struts are laid.
    design
        What deviations are counted from; default ``plan``.
    rate
        (V, 3) mm by which joints move with each strut that is laid (`anticipation.drift_rate`). Each
        strut is laid where its joints will be then; the tool keeps clear of the print as it is in the middle.

    Raises
    ------
    InputError
        If the batch or the sequence does not fit the frame, or a strut cannot be laid without contact and that is not
        allowed.
    """
    settings = WaypointSettings() if settings is None else settings
    sequence.end_in(plan)
    if not 0 <= batch < sequence.batch_count:
        problem, remedy = f"{batch} of {sequence.batch_count} does not exist", "count the batches from 0"
        raise InputError.at(plan.name, "batch", problem, remedy)
    design = plan if design is None else design
    if not np.array_equal(design.edges, plan.edges):
        raise InputError.at(design.name, "edges", "are not those of the plan", "give the design of this plan")
    part = sequence.in_batch(batch)
    ahead = Anticipation.of(plan, part, rate)
    meanwhile = ahead.frame(0.5 * len(part))
    nozzle = Nozzle.fitting(plan) if settings.nozzle is None else settings.nozzle
    max_tilt = math.radians(settings.max_tilt_deg)
    axes = checked_axes(meanwhile, sequence, batch, nozzle, max_tilt, settings.allow_contact)
    clearing = _clearing(meanwhile, sequence.laid_before(batch + 1, plan.strut_count), nozzle, settings)
    tools = zip(axes.axis, tool_rotations(axes.axis), strict=True)
    ways = zip(part.struts.tolist(), ahead.curves(), part.directed_curves(design), tools, strict=True)
    rows: list[dict[str, Any]] = []
    for strut, curve, designed, tool in ways:
        spacing = 2.0 * float(plan.radius[strut]) if settings.spacing is None else settings.spacing
        rows.append(_laid((curve, designed), spacing, settings, clearing, tool))
        rows[-1] |= {
            name: np.full(len(rows[-1]["kind"]), value)
            for name, value in (("strut", strut), ("radius", plan.radius[strut]))
        }
    columns: dict[str, Any] = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    return Waypoints(**columns, batch=batch, contacts=axes.contacts)


def _clearing(plan: Wireframe, standing: np.ndarray, nozzle: Nozzle, settings: WaypointSettings) -> Clearing:
    """How the tool keeps clear of the struts ``standing`` (E,) bool on its ways between struts."""
    points = plan.control_points[standing].reshape(-1, 3)
    bounds = np.stack([points.min(axis=0) - plan.radius.max(), points.max(axis=0) + plan.radius.max()])
    air = 10.0 * float(np.median(plan.radius)) if settings.clearance is None else settings.clearance
    return Clearing(bounds, nozzle.long_enough(plan), air, math.radians(settings.max_tilt_deg))


def _laid(
    curves: tuple[np.ndarray, np.ndarray],
    spacing: float,
    settings: WaypointSettings,
    clearing: Clearing,
    tool: tuple[np.ndarray, np.ndarray],
) -> dict[str, np.ndarray]:
    """The rows of one strut: hover, stand off, start, along the strut, stand off, hover.

    ``curves`` are the strut as it is to be and as designed, ``tool`` the axis and the rotation.
    """
    (curve, designed), (axis, rotation) = curves, tool
    count = max(1, math.ceil(float(bezier.arc_length(curve)) / spacing - 1e-9))
    u = np.arange(count + 1) / count
    points = bezier.evaluate(curve, u)
    away = np.linalg.norm(points - bezier.evaluate(designed, u), axis=1)
    near, far = clearing.stand_off(points[0], axis), clearing.stand_off(points[-1], axis)
    position = np.concatenate([[clearing.hover(near), near], points, [far, clearing.hover(far)]])
    total = len(position)
    kind = np.array([TRAVEL, TRAVEL, APPROACH, *[PRINT] * count, RETREAT, TRAVEL])
    speed = np.where(kind == PRINT, settings.speed, settings.travel_speed)
    speed[[2, total - 2]] = settings.approach_speed
    extrude, dwell, deviation = np.zeros(total, dtype=bool), np.zeros(total), np.zeros(total)
    extrude[2 : total - 3] = True
    dwell[2], dwell[total - 3] = settings.start_dwell, settings.end_dwell
    deviation[2 : total - 2] = away
    return {
        "position": position, "rotation": np.broadcast_to(rotation, (total, 3, 3)), "speed": speed, "extrude": extrude,
        "dwell": dwell, "kind": kind, "deviation": deviation,
    }  # fmt: skip
