"""What the tool does to lay one batch: where it goes, with which orientation, how fast, and when material flows.

For each strut: over the print at a safe height, down beside it or above it, along the tool's axis to the strut's
start, a pause with material flowing, along the strut, a pause while it hardens, and back the same way. Drawn back
along its axis a nozzle that widens upwards touches nothing that it did not touch before, and it turns only above all
that stands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import InitVar, dataclass
from typing import Annotated, Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.anticipation import Anticipation
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.toolpath.axes import checked_axes
from frametwin.printing.toolpath.keep_out import KeepOutBox, tool_rotations
from frametwin.ranges import Tilt, above, check_settings, within

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

    spacing: Annotated[float, above(0.0, up_to=1e6)] | None = None
    speed: Annotated[float, above(0.0, up_to=1e6)] = 5.0
    approach_speed: Annotated[float, above(0.0, up_to=1e6)] = 20.0
    travel_speed: Annotated[float, above(0.0, up_to=1e6)] = 60.0
    start_dwell: Annotated[float, within(0.0, 1e6, "seconds")] = 0.5
    end_dwell: Annotated[float, within(0.0, 1e6, "seconds")] = 2.0
    clearance: Annotated[float, above(0.0, up_to=1e6)] | None = None
    nozzle: Nozzle | None = None
    max_tilt_deg: Tilt = 60.0
    allow_contact: bool = False

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True, eq=False)
class Waypoints:
    """Poses of the tool in the order in which it takes them. Arrays are checked, copied and read-only.

    Attributes
    ----------
    position : (N, 3) array, mm
        Of the tip, in the coordinates of the frame.
    rotation : (N, 3, 3) array
        Columns are x, y and z of the tool; z points out of the nozzle, against the axis.
    speed : (N,) array, mm/s
        On the way to the waypoint.
    extrude : (N,) bool array
        Material flows during the pause at the waypoint and on the way to the next.
    dwell : (N,) array, s
        Pause at the waypoint.
    kind : (N,) int64 array
        Of the way to the waypoint: `TRAVEL`, `APPROACH` (to a strut's start), `PRINT` or `RETREAT`.
    strut : (N,) int64 array
        The strut that is laid there, or that the way leads to or from.
    deviation : (N,) array, mm
        Distance of waypoints on a strut from the same points of the design; 0 elsewhere.
    radius : (N,) array, mm
        Of the strut.
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
        """(N, 3) array: unit vectors along the tool, from the tip upwards."""
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
    """Plan the way of the tool for the struts of one batch.

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
    rate : (V, 3) array, mm, optional
        Drift of the joints with each strut that is laid (`anticipation.drift_rate`). Each strut is laid where its
        joints will be by then; the tool keeps clear of the print as it is in the middle of the batch.

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
    box = _keep_out_box(meanwhile, sequence.laid_before(batch + 1, plan.strut_count), nozzle, settings)
    tools = zip(axes.axis, tool_rotations(axes.axis), strict=True)
    ways = zip(part.struts.tolist(), ahead.curves(), part.directed_curves(design), tools, strict=True)
    rows: list[dict[str, Any]] = []
    for strut, curve, designed, tool in ways:
        spacing = 2.0 * float(plan.radius[strut]) if settings.spacing is None else settings.spacing
        rows.append(_strut_rows((curve, designed), spacing, settings, box, tool))
        rows[-1] |= {
            name: np.full(len(rows[-1]["kind"]), value)
            for name, value in (("strut", strut), ("radius", plan.radius[strut]))
        }
    columns: dict[str, Any] = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    return Waypoints(**columns, batch=batch, contacts=axes.contacts)


def _keep_out_box(plan: Wireframe, standing: np.ndarray, nozzle: Nozzle, settings: WaypointSettings) -> KeepOutBox:
    """The box around the struts that stand (E,) bool, for the tool's ways between struts."""
    points = plan.control_points[standing].reshape(-1, 3)
    bounds = np.stack([points.min(axis=0) - plan.radius.max(), points.max(axis=0) + plan.radius.max()])
    clearance = 10.0 * float(np.median(plan.radius)) if settings.clearance is None else settings.clearance
    return KeepOutBox(bounds, nozzle.long_enough(plan), clearance, math.radians(settings.max_tilt_deg))


def _strut_rows(
    curves: tuple[np.ndarray, np.ndarray],
    spacing: float,
    settings: WaypointSettings,
    box: KeepOutBox,
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
    near, far = box.stand_off(points[0], axis), box.stand_off(points[-1], axis)
    position = np.concatenate([[box.hover(near), near], points, [far, box.hover(far)]])
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
