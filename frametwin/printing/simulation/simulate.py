"""The whole loop without a robot: a simulated print, its pictures, and the job that answers them."""

from __future__ import annotations

import dataclasses
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.capture.image_files import write_png
from frametwin.errors import FrameTwinError, Held, InputError
from frametwin.files import PathLike, dump_json, file_hash, read_json, staged_directory, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.answer import ACCEPTABLE, AnswerOptions
from frametwin.printing.job.job import PrintJob
from frametwin.printing.job.plan_job import PlanOptions, plan_job
from frametwin.printing.job.summaries import supported_joints
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.simulation.growth import GrowingPrint
from frametwin.printing.simulation.outcome import BatchOutcome, PrintReport, Standing
from frametwin.printing.simulation.simulated_pictures import Renderer, SimulatedRig
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import Seed, check_settings, one_of
from frametwin.scratch import scratch_folder

FORMAT = "frametwin-print-simulation"
OUTCOME_FORMAT = "frametwin-print-outcome"
VERSION = 1
SETTINGS, OUTCOME, TRUTH, STANDING = "simulation.json", "outcome.json", "truth.json", "standing.json"
"""``truth.json`` has the design's struts and joints, those that stand whole being printed; ``standing.json`` has the
design's struts as a camera sees them, those included that hang free at one end."""

HELD = "held"
"""Folder in a batch, with the pictures for which the job is held, or that could not be used."""


@dataclass(frozen=True)
class SimulationOptions:
    """What is simulated. Same options, same frame: same print.

    Attributes
    ----------
    plan
        Of the job; whether it adapts stands there.
    print
        How the print behaves; the nozzle's speed is that of the plan.
    rig
        Cameras, and what takes their pictures.
    seed
        Of the print and of the noise in photos.
    fit
        Find twins also where nothing is adapted, to look at.
    accept
        Doubts that shall not stop the job; see `AnswerOptions`.
    """

    plan: PlanOptions = field(default_factory=lambda: PlanOptions(allow_contact=True))
    print: PrintSettings = PrintSettings()
    rig: SimulatedRig = SimulatedRig()
    seed: Seed = 0
    fit: bool = False
    accept: tuple[Annotated[str, one_of(ACCEPTABLE)], ...] = ()

    def __post_init__(self) -> None:
        check_settings(self)

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file: numbers and names."""
        return dataclasses.asdict(self)

    @property
    def answer(self) -> AnswerOptions:
        """Options of every answer."""
        return AnswerOptions(accept=frozenset(self.accept), fit=self.fit)


@dataclass(frozen=True, eq=False)
class SimulatedPrint:
    """What a simulated print came to.

    Attributes
    ----------
    job
        The job, with `OUTCOME` and `TRUTH` in every batch that was laid.
    report
        See `PrintReport`.
    standing
        What stands in the end.
    outcomes
        Of the batches that were laid.
    twin_seconds
        That the answer to each batch took.
    held
        Why the job stopped, if it did.
    """

    job: PrintJob
    report: PrintReport
    standing: Standing
    outcomes: tuple[BatchOutcome, ...]
    twin_seconds: tuple[float, ...]
    held: Held | None = None

    def as_dict(self) -> dict[str, Any]:
        """As ``frametwin print simulate --json`` prints it."""
        report = self.report
        return {
            "frame": self.job.design.name,
            "struts": self.job.design.strut_count,
            "coupon": self.job.settings.coupon,
            "support_struts": self.job.settings.support_struts,
            "supported": supported_joints(self.job),
            "batches": self.job.file.batches,
            "adapted": self.job.settings.adapt,
            "completed": report.completed,
            "collapsed_at_batch": report.collapsed_at_batch,
            "held": None if self.held is None else str(self.held),
            "e_max": list(report.e_max),
            "attached": list(report.attached),
            "lost": list(report.lost),
            "struts_lost": self.outcomes[-1].lost.tolist(),
            "struts_hanging": self.outcomes[-1].hanging.tolist(),
            "mean_deviation": None if np.isnan(report.mean_deviation) else report.mean_deviation,
            "twin_seconds": list(self.twin_seconds),
            "printing_seconds": list(report.seconds),
        }


def simulate_print(
    folder: PathLike,
    frame: Wireframe,
    options: SimulationOptions | None = None,
    *,
    order: PathLike | None = None,
    material: PathLike | None = None,
    overwrite: bool = False,
    renderer: Renderer | None = None,
    progress: ProgressCallback | None = None,
) -> SimulatedPrint:
    """Print a frame without a robot: lay a batch, take pictures, answer them, and so on.

    The simulated print knows nothing of twins, and the job sees nothing but pictures. It ends when all is laid, when it
    has collapsed, or when the job is held. A simulation that was stopped goes on where it was.

    Parameters
    ----------
    folder
        The job to be, or that of the same simulation, stopped before.
    frame
        The design.
    options
        See `SimulationOptions`.
    order, material
        See `plan_job`.
    overwrite
        Replace a job that is in the folder.
    renderer
        Takes masks and photos, if the rig asks for those; see `frametwin.blender.rendering.client.blender_renderer`.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If the frame cannot be printed, or the folder holds something else.
    Cancelled
        If ``progress`` returns ``False``; batches that were answered stay.
    """
    options = SimulationOptions() if options is None else options
    options.rig.require(renderer)
    options.answer  # noqa: B018  refuses unknown names before anything is done
    job = _job_in(Path(folder), frame, options, order, material, overwrite, progress)
    behaves = dataclasses.replace(options.print, speed=job.settings.robot.waypoints.speed)
    grown = GrowingPrint(job.design, job.sequence_at(0), behaves, options.seed, added=job.settings.added)
    # The matrices are small: threads of the linear algebra would wait for each other.
    with threadpool_limits(limits=1, user_api="blas"):
        held = _go_on(job, grown, options, renderer, progress)
    seconds = [job.report(batch)["seconds"] for batch in range(job.answered)]
    twin = tuple(float(item["total"]) if "twin" in item else 0.0 for item in seconds)
    return SimulatedPrint(job, grown.report(), grown.standing(), tuple(grown.outcomes), twin, held)


def _go_on(
    job: PrintJob,
    grown: GrowingPrint,
    options: SimulationOptions,
    renderer: Renderer | None,
    progress: ProgressCallback | None,
) -> Held | None:
    """Print what is left of the job, after what was printed before; why it was held, if it was."""
    for earlier in range(job.answered):
        _lay(grown, job, earlier)
    while (batch := job.current) is not None and not grown.collapsed:
        report(progress, Progress("printing", batch, job.sequence.batch_count))
        outcome = _lay(grown, job, batch)
        try:
            _answer(job, grown, outcome, options, renderer, progress)
        except Held as error:
            return error
    return None


def _job_in(
    folder: Path,
    frame: Wireframe,
    options: SimulationOptions,
    order: PathLike | None,
    material: PathLike | None,
    overwrite: bool,
    progress: ProgressCallback | None,
) -> PrintJob:
    """A new job, or the one of a simulation that was stopped."""
    digest = None if order is None else file_hash(order)
    notes = {"format": FORMAT, "version": VERSION, "order": digest, "options": options.as_dict()}
    if not (folder / SETTINGS).is_file() or overwrite:
        extra = {SETTINGS: notes}
        return plan_job(
            folder,
            frame,
            options.plan,
            order=order,
            material=material,
            overwrite=overwrite,
            notes=extra,
            progress=progress,
        )
    job = PrintJob(folder)
    if not _prints(job, frame) or dump_json(read_json(folder / SETTINGS)) != dump_json(notes):
        raise InputError.at(folder, "out", "holds another simulation", "give another folder, or allow overwriting")
    job.recover()
    return job


def _prints(job: PrintJob, frame: Wireframe) -> bool:
    """Whether a job is one of a frame, with supports and a coupon or without."""
    design, struts, joints = job.design, frame.strut_count, frame.vertex_count
    if design.name != frame.name or design.strut_count != struts + job.settings.added:
        return False
    batch = design.batch[:struts] - design.batch[:struts].min()
    pairs = (
        (design.vertices[:joints], frame.vertices),
        (design.edges[:struts], frame.edges),
        (design.control_points[:struts], frame.control_points),
        (design.radius[:struts], frame.radius),
        (design.grounded[:joints], frame.grounded),
        (batch, frame.batch - frame.batch.min()),
    )
    return all(np.array_equal(one, other) for one, other in pairs)


def _lay(grown: GrowingPrint, job: PrintJob, batch: int) -> BatchOutcome:
    ahead = job.anticipation(batch)
    return grown.lay(batch, ahead.plan, ahead.laying, ahead.curves())


def _answer(
    job: PrintJob,
    grown: GrowingPrint,
    outcome: BatchOutcome,
    options: SimulationOptions,
    renderer: Renderer | None,
    progress: ProgressCallback | None,
) -> None:
    """Take pictures where they are wanted, and let the job answer."""
    notes = _notes(grown, outcome)
    answer = dataclasses.replace(options.answer, notes=notes)
    if not (job.settings.adapt or options.fit):
        job.answer(None, answer, progress)
        return
    kept = job.batch_folder(outcome.batch) / HELD
    shutil.rmtree(kept, ignore_errors=True)
    with scratch_folder() as scratch:
        capture = scratch / f"batch_{outcome.batch:03d}"
        cameras = options.rig.cameras(job.design)
        try:
            seed, told = options.seed + outcome.batch, options.rig.told(cameras, options.seed)
            if not options.rig.take(capture, grown.standing(), cameras, seed, renderer, progress, told):
                raise Held.at(f"batch {outcome.batch}", "pictures", "nothing stands any more", "print it again")
            job.answer(capture, answer, progress)
        except Held as error:
            for name, note in notes.items():  # to look at; the batch is not answered
                write_json(job.batch_folder(outcome.batch) / name, note)
            _keep(capture, kept, error)
            raise
        except InputError as error:
            _keep(capture, kept, error)
            raise


def _keep(capture: Path, folder: Path, error: FrameTwinError) -> None:
    """Keep pictures that an error is about, which asks to look at them, and name them where they are kept."""
    if str(capture) in str(error):
        with staged_directory(folder, overwrite=True) as stage:
            shutil.copytree(capture, stage, dirs_exist_ok=True)
        error.rename(str(capture), str(folder))


def _notes(grown: GrowingPrint, outcome: BatchOutcome) -> dict[str, dict[str, Any]]:
    """What a batch came to, and what really stands, as files for its folder."""
    content = {name: value for name, value in vars(outcome).items() if name != "batch"}
    note = {"format": OUTCOME_FORMAT, "version": VERSION, "batch": outcome.batch, **content}
    stands = grown.standing()
    return {
        OUTCOME: note,
        TRUTH: frame_json.to_dict(stands.frame),
        STANDING: frame_json.to_dict(stands.pictured),
    }


def draw_print(path: PathLike, simulated: SimulatedPrint) -> None:
    """Write a picture of what stands in the end; see `frametwin.printing.simulation.print_picture`."""
    from frametwin.printing.simulation.print_picture import print_picture

    report, design = simulated.report, simulated.job.design
    lost = simulated.outcomes[-1].lost
    way = "with" if simulated.job.settings.adapt else "without"
    title = f"{design.name}, printed {way} adaptation: {verdict(simulated)}"
    subtitle = (
        f"{int(simulated.standing.pictured.printed.sum())} of {design.strut_count} struts stand, {len(lost)} are lost"
    )
    if not np.isnan(report.mean_deviation):
        off, most = report.mean_deviation, report.e_max[-1]
        subtitle += f"; they are {off:.2f} mm from the design on average, {most:.1f} mm at most"
    largest = (
        report.e_max[-1] or None if simulated.job.settings.coupon else None
    )  # a coupon droops further than all else
    write_png(path, print_picture(design, simulated.standing.pictured, lost, title, subtitle, largest))


def verdict(simulated: SimulatedPrint) -> str:
    """What became of the print, in a few words."""
    report = simulated.report
    if report.completed:
        return "completed" if simulated.held is None else f"all struts stand, held at batch {len(report.e_max) - 1}"
    if report.collapsed_at_batch is not None:
        return f"collapsed at batch {report.collapsed_at_batch}"
    if simulated.held is not None:
        return f"stopped at batch {len(report.e_max) - 1}"
    return f"all laid, {report.lost[-1]} struts lost" if report.lost[-1] else "all laid, some struts hang free"
