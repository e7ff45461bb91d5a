"""A print job: a folder that goes from batch to batch, and on from wherever it was stopped.

Whatever belongs to one step is written beside its place and put there by renaming; ``report.json`` comes last and makes
the batch an answered one. What a process that was killed has left is hidden and swept by the next one, and where it was
killed between the answer and the next batch's files, these are made again from the answer.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout
from threadpoolctl import threadpool_limits

from frametwin.errors import FrameTwinError, InputError
from frametwin.files import PathLike, read_json, staged_directory, synced_together, write_json
from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.view_masks import MasksOfCapture
from frametwin.printing.adaptation.anticipation import HISTORY, Anticipation
from frametwin.printing.adaptation.compensation import SagForecast
from frametwin.printing.adaptation.material_file import read_material, write_material
from frametwin.printing.adaptation.material_fit import MaterialEstimate
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.adaptation.plate import feet_on_plate
from frametwin.printing.job import job_files as files
from frametwin.printing.job.answer import AnsweredStep, AnswerOptions, answer_batch, look_ahead
from frametwin.printing.job.creep_forecast import CreepForecast
from frametwin.printing.job.guards import Expectation
from frametwin.printing.job.job_files import JobFile, JobSettings
from frametwin.printing.job.next_batch import NextBatch, write_batch
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.records.sequence_file import read_sequence, write_sequence
from frametwin.printing.toolpath.robot_files import SUMMARY
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.twin.runs import is_run, load_run
from frametwin.twin.twin import Twin, read_twin


class JobBusy(FrameTwinError):
    """Another process is answering the print job."""


class JobUnwritable(InputError):
    """Nothing can be written into the print job's folder."""


@dataclass(frozen=True)
class BatchState:
    """How far a batch is.

    Attributes
    ----------
    batch
        Its number.
    struts
        How many are laid in it.
    state
        ``"answered"``, ``"current"`` (its waypoints are there, its pictures are awaited) or ``"to come"``.
    report
        Of an answered batch.
    """

    batch: int
    struts: int
    state: str
    report: Mapping[str, Any] | None


class PrintJob:
    """A print job on disk.

    Parameters
    ----------
    folder
        As made by `PrintJob.create`.

    Raises
    ------
    InputError
        If it is no job, or damaged.
    """

    def __init__(self, folder: PathLike) -> None:
        self.folder = Path(folder)
        self.file: JobFile = files.read_job_file(self.folder)
        self.design: Wireframe = frame_json.read(self.folder / files.DESIGN)
        self._first_sequence: PrintSequence = read_sequence(self.folder / files.SEQUENCE)
        self._first_sequence.end_in(self.design)
        for name in ("coupon", "support_struts"):
            if self.settings.added >= self.design.strut_count and (count := getattr(self.settings, name)):
                problem = f"is {count}, and there are only {self.design.strut_count} struts in all"
                raise InputError.at(self.folder / files.JOB, f"settings.{name}", problem, "plan the job again")
        self._forecasts: dict[int, CreepForecast] = {}
        self._observed: dict[int, Observation] = {}
        self._ready: tuple[int, Any, AnsweredStep] | None = None
        self._looked: MasksOfCapture | None = None

    @classmethod
    def create(
        cls,
        folder: PathLike,
        design: Wireframe,
        sequence: PrintSequence,
        settings: JobSettings,
        notes: Mapping[str, Mapping[str, Any]] | None = None,
        overwrite: bool = False,
        material: MaterialEstimate | None = None,
    ) -> PrintJob:
        """Write a new job with the waypoints of its first batch, whole or not at all; ``notes`` are more files by name.

        ``material`` is what earlier prints tell of it.

        Raises
        ------
        InputError
            If the folder holds something already, the sequence is not one of the design, or a waypoint lies where the
            robot may not go.
        """
        sequence.end_in(design)
        if (np.diff(sequence.batch) > 1).any():
            raise InputError.at(design.name, "batch", "leaves numbers out", "number the batches 0, 1, 2 ...")
        plan = design.replace(printed=[False] * design.strut_count)
        with staged_directory(folder, overwrite) as stage:
            frame_json.write(stage / files.DESIGN, plan.replace(printed=[True] * design.strut_count))
            write_sequence(stage / files.SEQUENCE, sequence)
            files.write_job_file(stage, design.name, design.strut_count, sequence.batch_count, settings)
            if material is not None:
                write_material(stage / files.KNOWN_MATERIAL, material)
            for name, note in (notes or {}).items():
                write_json(stage / name, note)
            first = _batch_folder(stage, 0)
            first.mkdir(parents=True)
            write_batch(first, _first_batch(design, sequence, settings, material), settings, design)
        return cls(folder)

    @property
    def settings(self) -> JobSettings:
        """What the job is to do."""
        return self.file.settings

    # --- what is there

    def batch_folder(self, batch: int) -> Path:
        """Where a batch is kept."""
        return _batch_folder(self.folder, batch)

    def is_answered(self, batch: int) -> bool:
        """Whether the batch has been answered."""
        return (self.batch_folder(batch) / files.REPORT).is_file()

    @property
    def answered(self) -> int:
        """How many batches have been answered: all below this number."""
        batch = 0
        while self.is_answered(batch):
            batch += 1
        return batch

    @property
    def sequence(self) -> PrintSequence:
        """The sequence as it goes on now."""
        return self.sequence_at(self.answered)

    def sequence_at(self, batch: int) -> PrintSequence:
        """The sequence by which a batch is printed: the first one, or that of the last answer that changed it."""
        for earlier in range(batch - 1, -1, -1):
            path = self.batch_folder(earlier) / files.SEQUENCE
            if path.is_file():
                return read_sequence(path)
        return self._first_sequence

    @property
    def current(self) -> int | None:
        """The batch that is to be printed and answered next; ``None`` when the print is finished."""
        batch = self.answered
        return batch if batch < self.sequence_at(batch).batch_count else None

    def plan(self, batch: int) -> Wireframe:
        """The plan that the robot follows in a batch, ``printed`` marking what stands before."""
        return frame_json.read(self.batch_folder(batch) / files.PLAN)

    def anticipation(self, batch: int) -> Anticipation:
        """How the print is expected to move while a batch is laid, and so where the robot lays its struts."""
        rate = files.read_drift(self.batch_folder(batch), self.design.vertex_count)
        return Anticipation.of(self.plan(batch), self.sequence_at(batch).in_batch(batch), rate)

    def adapted(self, batch: int) -> Wireframe:
        """The plan after a batch was answered, ``printed`` marking what stands."""
        return frame_json.read(self.batch_folder(batch) / files.ADAPTED)

    def report(self, batch: int) -> dict[str, Any]:
        """The report of an answered batch."""
        return files.read_report(self.batch_folder(batch))

    def waypoint_summary(self, batch: int) -> dict[str, Any]:
        """What the robot was told for a batch; see `frametwin.printing.toolpath.robot_files.write_robot_files`."""
        return read_json(self.batch_folder(batch) / files.WAYPOINTS / SUMMARY)

    def expectation(self, batch: int) -> Expectation:
        """What the cameras should see after a batch has been printed."""
        return self._expectation(batch, self.anticipation(batch))

    def _expectation(self, batch: int, ahead: Anticipation) -> Expectation:
        printed = ahead.plan.printed.copy()
        printed[ahead.laying.struts] = True
        soon = ahead.frame(len(ahead.laying)).replace(printed=printed)
        expected = feet_on_plate(soon, self.design, soon.printed_vertices())
        return Expectation(batch, self.sequence_at(batch), expected, self.settings.coupon)

    def states(self) -> list[BatchState]:
        """All batches, those of the sequence as it goes on now."""
        answered, sequence = self.answered, self.sequence
        result = []
        for batch in range(sequence.batch_count):
            struts = len(self.sequence_at(batch).in_batch(batch)) if batch < answered else 0
            struts = struts or len(sequence.in_batch(batch))
            state = "answered" if batch < answered else "current" if batch == answered else "to come"
            result.append(BatchState(batch, struts, state, self.report(batch) if batch < answered else None))
        return result

    # --- going on

    def answer(
        self,
        capture: PathLike | None = None,
        options: AnswerOptions | None = None,
        progress: ProgressCallback | None = None,
    ) -> dict[str, Any]:
        """Answer the current batch: find the twin, move what is still to come, write the next batch's waypoints.

        Parameters
        ----------
        capture
            Folder of the pictures taken after the batch: ``transforms.json`` and the pictures it names. Can be left out
            where the job does not adapt.
        options
            See `AnswerOptions`.
        progress
            See `ProgressCallback`.

        Returns
        -------
        The report, as it is written to ``report.json``.

        Raises
        ------
        Held
            If the pictures, or the twin found from them, are not such that one may print on; the job is as it was.
        InputError
            If the capture cannot be used, the print is finished, or the folder cannot be written.
        JobBusy
            If another process is at it.
        Cancelled
            If ``progress`` returns ``False``; the job is as it was.
        """
        with self._locked():
            self._recover()
            batch = self.current
            if batch is None:
                raise InputError.at(self.folder, "job", "is finished", "plan another job to print on")
            stage, following = self._stage(batch), self._stage(batch + 1)
            try:
                stage.mkdir()
                # The matrices are small: threads of the linear algebra would wait for each other, forecasts above all.
                with synced_together(), threadpool_limits(limits=1, user_api="blas"):
                    step, looked = self._step(batch), self._looked
                    going = answer_batch(stage, step, capture, options or AnswerOptions(), progress, looked)
                    if going is not None:
                        following.mkdir()
                        write_batch(following, going, self.settings, self.design)
                report(progress, Progress("writing", 1, 1))  # the last moment at which nothing is done yet
                self._commit(batch, stage, following)
                self._forecasts = {} if going is None or going.forecast is None else {batch + 1: going.forecast}
                self._looked = None
            except BaseException:
                for folder in (stage, following):
                    shutil.rmtree(folder, ignore_errors=True)
                raise
        return self.report(batch)

    def recover(self) -> None:
        """Finish what a process that was killed has left undone; does nothing while another one is at work."""
        with suppress(JobBusy, JobUnwritable), self._locked():
            self._recover()

    def prepare(self, capture: PathLike | None = None) -> None:
        """Make ready what the next answer needs, while the robot prints; a matter of speed alone.

        What is damaged is told of by the answer.

        Parameters
        ----------
        capture
            Pictures that may be those of the current batch, and may still change: those that do not need not be read
            again.
        """
        batch = self.current
        if batch is not None:
            with suppress(InputError, OSError):
                step = self._step(batch)
                self._looked = None if capture is None else look_ahead(step, capture)

    def _step(self, batch: int) -> AnsweredStep:
        """What an answer starts from; the one that was made before where the batch's files are still the same."""
        plan = self.batch_folder(batch) / files.PLAN
        written = [
            (stat.st_size, stat.st_mtime_ns)
            for stat in (path.stat() for path in (plan, plan.with_name(files.DRIFT)) if path.is_file())
        ]
        if self._ready is None or self._ready[:2] != (batch, written):
            self._ready = (batch, written, self._made_step(batch))
        return self._ready[2]

    def _made_step(self, batch: int) -> AnsweredStep:
        earlier = {k: self.report(k)["pictures"] for k in range(batch)}
        compensates, ahead = self.settings.adapt and self.settings.compensate, self.anticipation(batch)
        return AnsweredStep(
            self.design,
            self.settings,
            self._expectation(batch, ahead),
            earlier,
            before=ahead.plan.vertices,
            forecast=self._forecast_before(batch) if compensates else None,
            seen=self._seen_before(batch, batch if compensates and self.settings.forecast == "linear" else HISTORY),
            last=self._twin_before(batch),
        )

    def _twin_before(self, batch: int) -> Twin | None:
        """The twin of the batch before, if there is one."""
        folder = self.batch_folder(batch - 1) / files.RUN
        return read_twin(folder) if is_run(folder) else None

    def _forecast_before(self, batch: int) -> SagForecast | CreepForecast:
        return self._linear_forecast if self.settings.forecast == "linear" else self._creep_forecast(batch)

    def _creep_forecast(self, batch: int) -> CreepForecast:
        """The forecast before a batch: the last one, or what the batches before it come to, gone through anew."""
        known = max((k for k in self._forecasts if k <= batch), default=0)
        if known == 0:
            path = self.folder / files.KNOWN_MATERIAL
            material = read_material(path) if path.is_file() else None
            speed = self.settings.robot.waypoints.speed
            forecast = CreepForecast.start(self.design, material, self.settings.coupon, speed)
        else:
            forecast = self._forecasts[known]
        for k in range(known, batch):
            laying = self.sequence_at(k).in_batch(k)
            forecast = forecast.following(self.plan(k)).answered(laying, self._observation(k), self.adapted(k))
        forecast = forecast.following(self.plan(batch)) if self.batch_folder(batch).is_dir() else forecast
        self._forecasts = {batch: forecast}
        return forecast

    @cached_property
    def _linear_forecast(self) -> SagForecast:
        return SagForecast.build(self.design, self._first_sequence)

    def _seen_before(self, batch: int, most: int) -> list[Observation]:
        """How far joints drifted in the last batches that have been answered."""
        if not (self.settings.anticipate or self.settings.compensate):
            return []
        return [self._observation(k) for k in range(max(0, batch - most), batch)]

    def _observation(self, batch: int) -> Observation:
        if batch not in self._observed:  # an answered batch does not change any more
            self._observed[batch] = self._observe(batch)
        return self._observed[batch]

    def _observe(self, batch: int) -> Observation:
        twin, plan = load_run(self.batch_folder(batch) / files.RUN)
        laid = len(self.sequence_at(batch).in_batch(batch))
        return Observation.of(batch, plan, twin, before=self.plan(batch).vertices, struts=laid)

    def _stage(self, batch: int) -> Path:
        return self.folder / files.BATCHES / f".{batch:03d}.part"

    def _commit(self, batch: int, stage: Path, following: Path) -> None:
        """Put the answer into place, its report last, and then the next batch."""
        target = self.batch_folder(batch)
        for item in sorted(stage.iterdir(), key=lambda path: path.name == files.REPORT):
            place = target / item.name
            if place.is_dir():  # left by a process that was killed before the report
                shutil.rmtree(place)
            os.replace(item, place)
        stage.rmdir()
        if following.is_dir():
            os.rename(following, self.batch_folder(batch + 1))

    def _recover(self) -> None:
        """Sweep what a killed process has left, and make the current batch's files if it did not come to that."""
        for rest in (self.folder / files.BATCHES).glob(".*.part"):
            shutil.rmtree(rest)
        batch = self.current
        if batch is not None and self.batch_folder(batch + 1).exists():  # no process leaves it like that
            problem = f"has files of batch {batch + 1} and no {files.REPORT} of batch {batch}"
            raise InputError.at(self.folder, "batches", problem, "put it back, or take the later batches away")
        if batch is None or self.batch_folder(batch).is_dir():
            return
        stage = self._stage(batch)
        stage.mkdir()
        contact = bool(self.report(batch - 1)["contact"])
        adapted, sequence = self.adapted(batch - 1), self.sequence_at(batch)
        creeps = self.settings.compensate and self.settings.forecast == "creep"
        forecast = self._creep_forecast(batch) if creeps else None
        seen = self._seen_before(batch, HISTORY)
        going = NextBatch.after(adapted, sequence, batch, seen, self.settings, contact, forecast)
        write_batch(stage, going, self.settings, self.design)
        os.rename(stage, self.batch_folder(batch))

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other processes out; the lock dies with the process."""
        try:
            with self._lock.acquire(timeout=0):
                yield
        except Timeout as error:
            raise JobBusy(f"{self.folder}: another process is answering this job; wait for it, or end it.") from error
        except OSError as error:
            where, problem = error.filename or self.folder, f"cannot be written ({error.strerror})"
            remedy = "make the job's folder writable, or copy it to where there is room"
            raise JobUnwritable.at(where, "file", problem, remedy) from error

    @cached_property
    def _lock(self) -> FileLock:
        return FileLock(self.folder / files.LOCK)


def _first_batch(
    design: Wireframe, sequence: PrintSequence, settings: JobSettings, material: MaterialEstimate | None
) -> NextBatch:
    """The first batch; aimed already where earlier prints tell how the material creeps."""
    plan = design.replace(printed=[False] * design.strut_count)
    if material is None or not (settings.compensate and settings.forecast == "creep"):
        return NextBatch(0, plan, sequence)
    forecast = CreepForecast.start(design, material, settings.coupon, settings.robot.waypoints.speed)
    plan = forecast.aimed(sequence, 0, resize=settings.resize)
    return NextBatch.after(plan, sequence, 0, (), settings, False, forecast)


def _batch_folder(folder: Path, batch: int) -> Path:
    return folder / files.BATCHES / f"{batch:03d}"
