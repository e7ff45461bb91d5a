"""From a frame to a print job: the order, the tool, the workspace, and the waypoints of the first batch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Annotated, Any

import numpy as np

from frametwin.errors import InputError
from frametwin.files import PathLike
from frametwin.fitting.fast_settings import CAMERAS
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.material_file import for_next_print, read_usual
from frametwin.printing.adaptation.material_fit import GUESS, MaterialEstimate, MaterialFit
from frametwin.printing.adaptation.printability import Outlook, first_fall, outlook
from frametwin.printing.job.creep_forecast import UNTRUSTED_SIZE, CreepForecast
from frametwin.printing.job.guards import GuardLimits
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.job_files import JobSettings
from frametwin.printing.process.added_struts import frame_alone
from frametwin.printing.process.coupon import with_coupon
from frametwin.printing.process.material import USUAL_SPEED
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.check import require_feet_on_plate, require_printable_radius, require_single_struts
from frametwin.printing.sequencing.given_order import GivenOrder, order_of_frame, read_given_order
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.order import OrderSettings, plan_sequence
from frametwin.printing.sequencing.supporting import supported_frame
from frametwin.printing.toolpath.robot_files import ArmName, Formats, RobotSettings, ToolLength, check_arm
from frametwin.printing.toolpath.waypoints import WaypointSettings
from frametwin.printing.toolpath.workspace import ROUNDING, Workspace
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import Seed, Tilt, above, at_least, check_settings, check_values, in_words, one_of, sized, within
from frametwin.twin.runs import require_free

Coordinate = Annotated[float, within(-1e9, 1e9)]
Corners = Annotated[tuple[Coordinate, ...], sized(6), in_words("two corners, six numbers in mm")]
Row = Annotated[tuple[Coordinate, ...], sized(4)]
Matrix = Annotated[tuple[Row, ...], sized(4), in_words("four rows of four numbers each")]


@dataclass(frozen=True)
class PlanOptions:
    """What is wanted of a job; numbers and names only.

    Attributes
    ----------
    batch_size
        Struts between two looks of the cameras, about; ``None`` for a twentieth of all, from 4 to 12, and for more or
        fewer where a forecast of the print tells that these suit its drift.
    max_tilt_deg
        How far the tool may lean; 0 for machines of three axes.
    allow_contact
        Where there is no other way, let the tool touch what is printed.
    nozzle
        Sizes of the tool by the names of `Nozzle`, in mm; the others suit the frame.
    waypoints
        Settings of `WaypointSettings` by name.
    formats
        Of `frametwin.printing.toolpath.robot_files.FORMATS`.
    workspace
        Lower and upper corner of where the tool's tip may go, in mm in the robot's base; ``None`` for a box around the
        frame, as wide as that is long on every side and above.
    base
        4 by 4 rigid transform from the frame's coordinates to the robot's base; ``None`` for none.
    max_speed
        Of the tip in mm/s.
    robot, tool
        The arm, and the length of its tool in mm; see `frametwin.printing.toolpath.robot_files.RobotSettings`.
    coupon
        Struts of a test coupon that are laid around the frame first; see `frametwin.printing.process.coupon`.
    supports
        Columns at most, under the joints that would sag furthest; see `frametwin.printing.process.supports`.
    adapt, anticipate, compensate, reprint, cameras
        See `JobSettings`; a job that does not adapt does not anticipate
        or compensate either.
    limits
        When the job stops.
    seed
        Of the search for an order.

    Raises
    ------
    InputError
        If a value is out of its range, or no setting of what it is for.
    """

    batch_size: Annotated[int, at_least(1)] | None = None
    max_tilt_deg: Tilt = 60.0
    allow_contact: bool = False
    nozzle: dict[str, Any] = field(default_factory=dict)
    waypoints: dict[str, Any] = field(default_factory=dict)
    formats: Formats = ("json", "urscript", "gcode")
    workspace: Corners | None = None
    base: Matrix | None = None
    max_speed: Annotated[float, above(0.0, up_to=1e6, noun="mm/s")] = 250.0
    robot: ArmName | None = None
    tool: ToolLength | None = None
    coupon: Annotated[int, within(0, 1000)] = 0
    supports: Annotated[int, within(0, 100)] = 0
    adapt: bool = True
    anticipate: bool = True
    compensate: bool = True
    reprint: bool = False
    cameras: Annotated[str, one_of(CAMERAS)] = "auto"
    limits: GuardLimits = GuardLimits()
    seed: Seed = 0

    def __post_init__(self) -> None:
        check_settings(self)
        check_arm(self.robot, self.tool)
        check_values(Nozzle, self.nozzle, prefix="nozzle.")
        check_values(WaypointSettings, self.waypoints, prefix="waypoints.")

    def order(self, frame: Wireframe) -> OrderSettings:
        """Settings of the search for an order, with the tool of the whole job."""
        return OrderSettings(
            nozzle=Nozzle.fitting(frame, **self.nozzle),
            max_tilt_deg=self.max_tilt_deg,
            batch_size=self.batch_size,
            allow_contact=self.allow_contact,
            seed=self.seed,
        )

    def design(self, frame: Wireframe, known: MaterialEstimate | None) -> Wireframe:
        """What is printed: the frame with the coupon that suits what is known of the material."""
        known = GUESS if known is None else known
        return with_coupon(frame, self.coupon, float(np.exp(known.mean[0])), known.deviation[0])

    def job(self, frame: Wireframe, nozzle: Nozzle) -> JobSettings:
        """Settings of the job, which is printed with the tool for which its order was found."""
        own = {
            "nozzle": nozzle,
            "max_tilt_deg": self.max_tilt_deg,
            "allow_contact": self.allow_contact,
        }
        waypoints = WaypointSettings(**{**own, **self.waypoints})
        return JobSettings(
            robot=RobotSettings(self.place(frame), waypoints, tuple(self.formats), self.robot, self.tool),
            adapt=self.adapt,
            anticipate=self.adapt and self.anticipate,
            compensate=self.adapt and self.compensate,
            reprint=self.reprint,
            resize=self.batch_size is None,
            cameras=self.cameras,
            limits=self.limits,
            coupon=self.coupon,
        )

    def place(self, frame: Wireframe) -> Workspace:
        """Where the robot may go, in its own base."""
        base = np.eye(4) if self.base is None else np.array(self.base, dtype=np.float64)
        limits: dict[str, Any] = {"base": base, "max_speed": self.max_speed}
        if self.workspace is not None:
            return Workspace(np.array(self.workspace[:3]), np.array(self.workspace[3:]), **limits)
        around = Workspace.around(frame)
        if self.base is None:
            return Workspace(around.lower, around.upper, **limits)
        Workspace(around.lower, around.upper, **limits)  # refuses a transform that is not rigid
        corners = np.array(list(product(*zip(around.lower, around.upper, strict=True))))
        corners = corners @ base[:3, :3].T + base[:3, 3]
        return Workspace(corners.min(axis=0), corners.max(axis=0), **limits)


def plan_job(
    folder: PathLike,
    frame: Wireframe,
    options: PlanOptions | None = None,
    *,
    order: PathLike | None = None,
    material: PathLike | None = None,
    overwrite: bool = False,
    notes: Mapping[str, Mapping[str, Any]] | None = None,
    progress: ProgressCallback | None = None,
) -> PrintJob:
    """Plan a print and write its job.

    Parameters
    ----------
    folder
        The job to be.
    frame
        The design; what is marked as printed plays no part. The order of its batches, if it has more than one, is kept.
    options
        See `PlanOptions`.
    order
        A file with an order to keep; see `frametwin.printing.sequencing.given_order`.
    material
        What an earlier job has learnt of the material: that job, or its ``material.json``.
    overwrite
        Replace a job that is in the folder.
    notes
        Further JSON files for the folder, by name.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If the frame cannot be printed or supported, or would not stand by what is known of its material, something is
        outside of the workspace, or the folder cannot be written.
    """
    options = PlanOptions() if options is None else options
    require_free(folder, overwrite, "job.json")
    require_single_struts(frame)
    require_printable_radius(frame)
    require_feet_on_plate(frame)
    known = None if material is None else for_next_print(read_usual(material))
    ordering, design = options.order(frame), options.design(frame, known)
    settings = options.job(design, ordering.nozzle_for(frame))  # refuses what is wrong before the search begins
    given = order_of_frame(frame) if order is None else read_given_order(order, frame)
    cut = order is None or options.batch_size is not None or (given is not None and given.batch is None)
    if options.supports:
        alone = plan_order(frame, ordering, given, cut, progress)
        supported, given = supported_frame(frame, alone, options.supports, ordering, progress)
        settings = replace(settings, support_struts=supported.strut_count - frame.strut_count)
        design, cut = options.design(supported, known), False
    if options.coupon:
        coupon = np.flatnonzero(~settings.of_print(design))
        require_room(design, coupon, settings.robot.workspace)
        given = (GivenOrder(source=frame.name) if given is None else given).after(design, coupon, UNTRUSTED_SIZE)
    sequence = plan_order(design, ordering, given, cut, progress)
    if known is not None:
        printed, order_of_it = frame_alone(design, sequence, options.coupon)
        require_standing(printed, order_of_it, known, settings.compensate, settings.robot.waypoints.speed)
    report(progress, Progress("writing", 0, 1))
    return PrintJob.create(folder, design, sequence, settings, notes, overwrite, known)


def require_room(design: Wireframe, coupon: np.ndarray, workspace: Workspace) -> None:
    """Refuse a coupon, struts (N,) of a design, that lies outside of the workspace.

    Raises
    ------
    InputError
        The sentence says by how much.
    """
    where = workspace.in_base(design.vertices[design.edges[coupon]])
    beyond = float(np.maximum(workspace.lower - where, where - workspace.upper).max())
    if beyond > ROUNDING:
        problem = f"its struts around the frame reach {beyond:.3g} mm outside of the workspace"
        raise InputError.at(
            design.name, "coupon", problem, "move the print, ask for fewer struts, or give the robot's own workspace"
        )


def require_standing(
    frame: Wireframe,
    sequence: PrintSequence,
    material: MaterialEstimate,
    compensate: bool = False,
    speed: float = USUAL_SPEED,
) -> None:
    """Refuse a print of which a known material tells that it will not stand.

    Parameters
    ----------
    frame, sequence, material
        The print.
    compensate
        It is aimed by the forecast: what leans outwards is laid further in, and carries what it could not carry else.
    speed
        Of the nozzle, mm/s.

    Raises
    ------
    InputError
        The sentence names the strut, the reason, and what would help.
    """
    forecast = CreepForecast.start(frame, material, speed=speed)
    batches = [sequence.struts[sequence.batch == batch] for batch in range(sequence.batch_count)]

    def aimed(fit: MaterialFit) -> Wireframe:
        return replace(forecast, fit=fit).aimed(sequence, 0) if compensate else frame

    fall = first_fall(forecast.fit, aimed, batches)
    if fall is not None:
        raise InputError.at(frame.name, "material", fall.problem, fall.remedy)


def guessed_outlook(job: PrintJob, progress: ProgressCallback | None = None) -> Outlook:
    """Whether a print would stand in a material of which nothing is known yet: a warning at most."""
    report(progress, Progress("computing the print", 0, 1))
    frame, sequence = frame_alone(job.design, job.sequence, job.settings.coupon)
    batches = [sequence.struts[sequence.batch == batch] for batch in range(sequence.batch_count)]
    forecast = CreepForecast.start(frame, speed=job.settings.robot.waypoints.speed)
    return outlook(forecast.fit, frame, batches)


def plan_order(
    frame: Wireframe,
    settings: OrderSettings,
    given: GivenOrder | None,
    cut: bool,
    progress: ProgressCallback | None = None,
) -> PrintSequence:
    """The order in which a frame is printed: a given one, or one that is searched for.

    Parameters
    ----------
    frame
        The design.
    settings
        Of the search.
    given
        What is laid down of it.
    cut
        Cut given batches, which may be long layers, into even parts of at most the size that ``settings`` say.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        See `plan_sequence`.
    """
    sequence = plan_sequence(frame, settings, given, progress)
    if given is None or given.batch is None or not cut:
        return sequence
    return cut_batches(sequence, settings.batch_size_for(frame))


def cut_batches(sequence: PrintSequence, most: int) -> PrintSequence:
    """The same order with batches of more than ``most`` struts cut into parts of nearly equal size."""
    sizes = np.unique(sequence.batch, return_counts=True)[1]
    parts = [part for size in sizes for part in np.array_split(np.arange(size), -(-size // most))]
    numbers = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return replace(sequence, batch=numbers, source="sequence")
