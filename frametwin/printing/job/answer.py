"""The answer to a batch: what stands, and how the print goes on."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import read_capture
from frametwin.errors import Doubt, InputError
from frametwin.fields.base import DeformationField
from frametwin.files import PathLike, write_json
from frametwin.fitting.api import FitResult, write_run
from frametwin.fitting.camera_freedoms import RigErrors
from frametwin.fitting.photo_fit import fit_by_turns, outline_error
from frametwin.fitting.plate_cameras import through_plate
from frametwin.formats import frame_json
from frametwin.geometry.displacement import largest_deviation
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.view_masks import MasksOfCapture, read_view_masks
from frametwin.printing.adaptation.adapt import adapt, lost_struts
from frametwin.printing.adaptation.batch_fit import BatchFit, fit_batch
from frametwin.printing.adaptation.compensation import SagForecast, compensate
from frametwin.printing.adaptation.evidence import Evidence
from frametwin.printing.adaptation.material_file import NAME as MATERIAL
from frametwin.printing.adaptation.material_file import usual_after, write_material
from frametwin.printing.adaptation.observation import Observation
from frametwin.printing.adaptation.plate import feet_on_plate
from frametwin.printing.job import guards
from frametwin.printing.job import job_files as files
from frametwin.printing.job.batch_capture import BatchCapture, take_capture
from frametwin.printing.job.creep_forecast import CreepForecast
from frametwin.printing.job.guards import Expectation, hold
from frametwin.printing.job.job_files import JobSettings
from frametwin.printing.job.next_batch import NextBatch
from frametwin.printing.job.requeue import laid_again
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.records.sequence_file import write_sequence
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import check_settings
from frametwin.twin.findings import missing_struts, uncertain_struts
from frametwin.twin.twin import Twin

ACCEPTABLE = (*guards.KINDS, "contact")
"""What can be accepted by name."""


ALSO_OF_LATER_PICTURES = ("collapsed", "poor-fit", "wrong-twin", "camera-moved", "displacement")
"""Doubts that pictures of a later batch raise too: a twin of fewer struts than the pictures show may go anywhere."""

EVIDENT = 0.25
"""Share of what the next batch would add to the white in the pictures that the twin must leave unexplained before it is
asked whether they show that batch. Twins of fewer struts cover some of what the others show."""


@dataclass(frozen=True)
class AnswerOptions:
    """What is wanted of one answer.

    Attributes
    ----------
    accept
        Kinds of doubts (`frametwin.printing.job.guards.KINDS`) that shall not stop the job this time; ``"contact"``
        lets the next waypoints touch printed struts where there is no other way.
    reprint
        Lay lost struts again; ``None`` as the job's settings say.
    warm
        Start the fit from the last twin; a matter of speed alone.
    fit
        Find the twin although the job does not adapt.
    notes
        Further JSON files for the batch's folder, by name.

    Raises
    ------
    InputError
        If a kind is unknown.
    """

    accept: frozenset[str] = frozenset()
    reprint: bool | None = None
    warm: bool = True
    fit: bool = False
    notes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_settings(self)
        unknown = sorted(set(self.accept) - set(ACCEPTABLE))
        if unknown:
            remedy = f"give one of {', '.join(ACCEPTABLE)}"
            raise InputError.at("settings", "accept", f"{unknown[0]!r} is nothing that a job stops for", remedy)


@dataclass(frozen=True, eq=False)
class AnsweredStep:
    """Where a job stands when a batch is answered.

    Attributes
    ----------
    design, settings
        Of the job.
    expected
        What the cameras should see.
    earlier
        Hashes of the pictures of each batch before.
    before : (V, 3) array, mm
        Where the joints were when the batch began, and where new ones were to be laid.
    forecast
        Of how the print drifts, where the job compensates.
    seen
        How far joints drifted in the batches before: in all of them where the job compensates, else in the last ones.
    last
        The twin of the batch before.
    """

    design: Wireframe
    settings: JobSettings
    expected: Expectation
    earlier: Mapping[int, Mapping[str, str]]
    before: np.ndarray
    forecast: SagForecast | CreepForecast | None = None
    seen: Sequence[Observation] = ()
    last: Twin | None = None


@dataclass(frozen=True, eq=False)
class Continuation:
    """How the print goes on.

    Attributes
    ----------
    adapted
        The plan for what follows, ``printed`` marking what stands.
    sequence
        In which order.
    again
        Struts that are laid once more, at the start of the next batch.
    seen
        How far joints drifted in this batch and in those before; nothing where the job does not adapt.
    forecast
        What the twins so far tell of the print, where the job follows its creep.
    """

    adapted: Wireframe
    sequence: PrintSequence
    again: np.ndarray
    seen: Sequence[Observation] = ()
    forecast: CreepForecast | None = None


@dataclass(frozen=True, eq=False)
class _Found:
    """The twin of a batch, the plan that meets it, and how well the pictures bear it out.

    ``cameras`` are those that were used, ``masks`` theirs; ``left_out`` are the others, with the reasons why their
    pictures could not be used.
    """

    cameras: Sequence[Camera]
    masks: Sequence[np.ndarray]
    fit: BatchFit
    adapted: Wireframe
    evidence: Evidence
    left_out: Mapping[str, str]
    seconds: Mapping[str, float]


def answer_batch(
    stage: Path,
    step: AnsweredStep,
    capture: PathLike | None,
    options: AnswerOptions,
    progress: ProgressCallback | None = None,
    looked: MasksOfCapture | None = None,
) -> NextBatch | None:
    """Write everything of an answer into a folder that exists and is empty.

    ``looked`` are masks of pictures that were there before, and are used again where they are still the same.

    Returns
    -------
    What is printed next; ``None`` when the print is finished.

    Raises
    ------
    Held
        See `frametwin.printing.job.job.Job.answer`.
    InputError
        If the capture is missing or cannot be used.
    """
    began = perf_counter()
    wanted = step.settings.adapt or options.fit
    if capture is None and wanted:
        raise InputError.at("settings", "capture", "is missing", "give the pictures taken after the batch")
    taken = found = None
    doubts: list[Doubt] = []
    if capture is not None:
        report(progress, Progress("copying pictures", 0, 1))
        taken = take_capture(capture, stage / files.CAPTURE, step.expected.frame)
        if step.settings.adapt:
            doubts = guards.doubts_of_capture(taken, step.expected, step.earlier, step.settings.limits)
            hold(capture, doubts, options.accept)
        found = _find(taken, step, options, progress, looked) if wanted else None
    going = _continuation(step, found, options)
    if found is not None and step.settings.adapt:
        doubts += _doubts(step, found, going)
        hold(str(capture), doubts, options.accept)
    _write(stage, step, taken, found, going)
    for name, note in options.notes.items():
        write_json(stage / name, note)
    content = {
        **_capture_content(taken),
        **_plan_content(step, going),
        **({} if found is None else _twin_content(step, found)),
        "accepted": [dataclasses.asdict(doubt) for doubt in doubts],
        "contact": "contact" in options.accept,
    }
    seconds = {**({} if found is None else found.seconds), "total": perf_counter() - began}
    files.write_report(stage, {**content, "seconds": seconds})
    following = step.expected.batch + 1
    if following >= going.sequence.batch_count:
        return None
    contact = bool(content["contact"])
    return NextBatch.after(going.adapted, going.sequence, following, going.seen, step.settings, contact, going.forecast)


def look_ahead(step: AnsweredStep, capture: PathLike) -> MasksOfCapture:
    """Read pictures that may be those of a batch, before it is answered with them.

    Raises
    ------
    InputError
        If the capture cannot be used, or not yet.
    """
    read = read_capture(capture, step.expected.frame)
    return MasksOfCapture(read, read_view_masks(read))


def _find(
    taken: BatchCapture,
    step: AnsweredStep,
    options: AnswerOptions,
    progress: ProgressCallback | None,
    before: MasksOfCapture | None,
) -> _Found:
    """Read the pictures, find the twin, and move what is still to come."""
    laps = [perf_counter()]
    frame = step.expected.frame
    freedom = step.settings.cameras

    def fitted(
        cameras: list[Camera], pictures: list[np.ndarray], start: DeformationField | None, exact: bool
    ) -> BatchFit:
        chosen = "exact" if exact else freedom
        return fit_batch(
            frame,
            cameras,
            pictures,
            warm=options.warm,
            freedom=chosen,
            outline_error=outline_error(seen),
            last=step.last if taken.capture.plate is None else None,  # by a plate, each picture tells of its camera
            progress=progress,
        )

    placed = None if freedom == "exact" else through_plate(taken.capture, RigErrors(), progress)
    capture = taken.capture if placed is None else placed.capture
    known = None if before is None or capture is not taken.capture else before.of(capture)  # a plate moves cameras
    seen = read_view_masks(capture, progress=progress) if known is None else known
    laps.append(perf_counter())
    looked = fit_by_turns(capture, seen, fitted)
    fit = looked.result
    if placed is not None:
        fit = dataclasses.replace(fit, result=dataclasses.replace(fit.result, twin=placed.told(fit.twin)))
    used = [i for i, mask in enumerate(looked.masks) if mask.used]
    cameras = [taken.capture.views[i].camera.without_distortion() for i in used]
    masks = [looked.masks[i].coverage for i in used]
    result = _described(fit, taken)
    laps.append(perf_counter())
    adapted = adapt(frame, result.twin, result.field)
    laps.append(perf_counter())
    following = step.expected.next_struts
    others = None if following is None else _struts_of(adapted, following.struts)
    evidence = fit.pictures.evidence(frame, result.twin, others)
    laps.append(perf_counter())
    names = ("read", "twin", "adapt", "guards")
    seconds = dict(zip(names, np.diff(laps).tolist(), strict=True))
    left_out = {taken.capture.views[i].camera.name: mask.reason for i, mask in enumerate(looked.masks) if not mask.used}
    return _Found(cameras, masks, dataclasses.replace(fit, result=result), adapted, evidence, left_out, seconds)


def _described(fit: BatchFit, taken: BatchCapture) -> FitResult:
    """The result with a provenance that can be written and tells of the job's fit."""
    twin = fit.result.twin
    provenance = {
        **{key: value for key, value in twin.provenance.items() if key != "changes"},
        "start": fit.start,
        "inputs": taken.capture.hashes,
    }
    return fit.result.with_twin(timing={**twin.timing, "total": fit.seconds}, provenance=provenance)


def _struts_of(frame: Wireframe, struts: np.ndarray) -> Wireframe:
    mask = np.zeros(frame.strut_count, dtype=bool)
    mask[struts] = True
    return frame.subset(mask)[0]


def _continuation(step: AnsweredStep, found: _Found | None, options: AnswerOptions) -> Continuation:
    sequence, batch = step.expected.sequence, step.expected.batch
    none = np.zeros(0, dtype=np.int64)
    if found is None or not step.settings.adapt:
        return Continuation(step.expected.frame, sequence, none)
    again = none
    if step.settings.reprint if options.reprint is None else options.reprint:
        wanted = step.settings.of_print(step.design) & ~found.adapted.printed
        again = np.setdiff1d(sequence.struts[sequence.batch <= batch], np.flatnonzero(~wanted))
        sequence = laid_again(sequence, again, batch)
    frame, laid = step.expected.frame, len(step.expected.laid)
    seen = (*step.seen, Observation.of(batch, frame, found.fit.result.twin, before=step.before, struts=laid))
    adapted, forecast = _compensated(step, found, seen, sequence)
    # Where a strut is to be laid again from the plate, the plate has not moved.
    adapted = feet_on_plate(adapted, step.design, ~adapted.printed_vertices())
    if forecast is not None and step.settings.resize and batch + 1 < sequence.batch_count:
        sequence = forecast.following(adapted).resized(sequence, batch + 1)
    return Continuation(adapted, sequence, again, seen, forecast)


def _compensated(
    step: AnsweredStep, found: _Found, seen: Sequence[Observation], sequence: PrintSequence
) -> tuple[Wireframe, CreepForecast | None]:
    """The adapted plan, what is still to come being aimed against the sag still to come where that is wanted."""
    if step.forecast is None:
        return found.adapted, None
    batch = step.expected.batch
    if isinstance(step.forecast, CreepForecast):
        forecast = step.forecast.answered(step.expected.sequence.in_batch(batch), seen[-1], found.adapted)
        aims = forecast.aimed(sequence, batch + 1, step.expected.frame.vertices, resize=step.settings.resize)
        return aims, forecast
    known = [one for one in seen if one.batch < len(step.forecast.drift)]  # struts may be laid again in one more
    return compensate(found.adapted, step.design, step.forecast.remaining_drift(known, batch + 1)), None


def _doubts(step: AnsweredStep, found: _Found, going: Continuation) -> list[Doubt]:
    expected, limits, twin = step.expected, step.settings.limits, found.fit.result.twin
    doubts = guards.doubts_of_twin(expected, twin, found.adapted, found.evidence, limits)
    if any(doubt.kind in ALSO_OF_LATER_PICTURES for doubt in doubts) and _shows_next_batch(step, found):
        return [guards.too_early(expected)]
    if expected.batch + 1 < going.sequence.batch_count:
        doubts += guards.doubts_of_starts(going.adapted, twin, going.sequence, expected.batch + 1, limits)
        doubts += guards.doubts_of_depth(step.design, going.adapted, going.sequence, expected.batch + 1)
    return doubts


def _shows_next_batch(step: AnsweredStep, found: _Found) -> bool:
    """Whether the pictures are well explained by a print in which the next batch has been laid too.

    They show more than the twin then. Where they do not, struts of the next batch may be fitted to what others show.
    """
    following, limits = step.expected.next_struts, step.settings.limits
    if following is None:
        return False
    printed = step.expected.frame.printed.copy()
    lengths = step.expected.frame.lengths
    more = float(lengths[following.struts].sum())
    if found.evidence.unexplained < EVIDENT * more / (float(lengths[printed].sum()) + more):
        return False
    printed[following.struts] = True
    later = step.expected.frame.replace(printed=printed)
    fit = fit_batch(later, found.cameras, found.masks, freedom=step.settings.cameras)
    absent = np.isin(following.struts, lost_struts(later, fit.twin)).mean()
    mismatch = fit.pictures.evidence(later, fit.twin).mismatch
    return bool(absent < limits.elsewhere and mismatch < min(limits.mismatch, found.evidence.mismatch))


def _write(
    stage: Path, step: AnsweredStep, taken: BatchCapture | None, found: _Found | None, going: Continuation
) -> None:
    if taken is not None and found is not None:
        write_run(stage / files.RUN, found.fit.result, taken.capture)
    frame_json.write(stage / files.ADAPTED, going.adapted)
    if going.forecast is not None:
        fit = going.forecast.fit
        learnt = dataclasses.replace(fit.estimate, prints=fit.known.prints + 1)
        write_material(stage / MATERIAL, learnt, {"trust": fit.trust}, usual=usual_after(fit.known, learnt))
    if going.sequence is not step.expected.sequence:
        write_sequence(stage / files.SEQUENCE, going.sequence)


def _capture_content(taken: BatchCapture | None) -> dict[str, Any]:
    if taken is None:
        return {"capture": None, "pictures": {}}
    return {"capture": str(taken.capture.root), "pictures": taken.pictures}


def _plan_content(step: AnsweredStep, going: Continuation) -> dict[str, Any]:
    """What was printed, what stands, and how far the plan is from the design; mm."""
    batch, frame, adapted = step.expected.batch, step.expected.frame, going.adapted
    standing = adapted.printed
    lost = step.expected.sequence.laid_before(batch + 1, frame.strut_count) & ~standing
    moved = np.flatnonzero((adapted.control_points != frame.control_points).any(axis=(1, 2)) & ~standing)
    judged = standing & step.settings.of_frame(step.design)
    return {
        "batch": batch,
        "adapted": step.settings.adapt,
        "laid": step.expected.laid,
        "standing": int(standing.sum()),
        "lost": np.flatnonzero(lost),
        "again": going.again,
        "moved": moved,
        "e_max": largest_deviation(step.design.control_points[judged], adapted.control_points[judged]),
    }


def _twin_content(step: AnsweredStep, found: _Found) -> dict[str, Any]:
    twin, frame = found.fit.result.twin, step.expected.frame
    printed = frame.printed
    return {
        "twin": {
            "start": found.fit.start,
            "mismatch": found.evidence.mismatch,
            "verdict": dataclasses.asdict(twin.verdict),
            "left_out": dict(found.left_out),
            "missing": missing_struts(twin, printed),
            "uncertain": uncertain_struts(twin, printed),
            "largest_displacement": largest_deviation(frame.control_points[printed], twin.control_points[printed]),
            "timing": dict(twin.timing),
        }
    }
