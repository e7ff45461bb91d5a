"""Where a print job keeps what: names, settings and reports.

::

    JOB/
      job.json          settings, and hashes of itself and of the two files below
      design.json       the frame as designed; never changes
      sequence.json     the order of its struts
      known.json        what earlier prints tell of the material, if given
      batches/003/
        plan.json       the plan that the robot follows, with what was printed before; written with
        drift.json      how the print is expected to move meanwhile, if it does, and
        waypoints/      what the robot is told
        capture/        a copy of the pictures taken afterwards; written with
        run/            the twin and its field, relative to the plan,
        adapted.json    the plan for what follows,
        material.json   what the print tells of its material so far, where it is aimed by a forecast,
        sequence.json   the order in which it goes on, where struts are laid again, and
        report.json     which says that the batch has been answered
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from frametwin import __version__
from frametwin.arrays import checked_array
from frametwin.checked_json import convert_fields, told_of
from frametwin.errors import InputError
from frametwin.files import check_format, dump_json, file_hash, read_json, write_json
from frametwin.fitting.fast_settings import CAMERAS
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.guards import GuardLimits
from frametwin.printing.process.added_struts import without_last
from frametwin.printing.toolpath.robot_files import RobotSettings
from frametwin.ranges import at_least, check_settings, one_of

FORMAT = "frametwin-print-job"
REPORT_FORMAT = "frametwin-print-report"
DRIFT_FORMAT = "frametwin-print-drift"
VERSION = 1

JOB, DESIGN, SEQUENCE = "job.json", "design.json", "sequence.json"
BATCHES = "batches"
PLAN, DRIFT, WAYPOINTS = "plan.json", "drift.json", "waypoints"
CAPTURE, RUN, ADAPTED, REPORT = "capture", "run", "adapted.json", "report.json"
KNOWN_MATERIAL = "known.json"
FORECASTS = ("creep", "linear")
LOCK = ".lock"
OWN_HASH = "hash"
"""Field of ``job.json`` with the SHA-256 of all its others; jobs that were planned before there was one have none."""


@dataclass(frozen=True)
class JobSettings:
    """What a job is to do; kept in ``job.json``.

    Attributes
    ----------
    robot
        What the robot is told, with which tool, and where it may go.
    adapt
        Move what is still to be printed to meet the twin; without, the plan stays the design.
    anticipate
        Aim at where the joints will be when the next struts are laid, by how they have moved; without, at where the
        last twin saw them.
    compensate
        Print against the sag that is still to come.
    forecast
        What tells that sag: ``creep`` follows the print with a model of its creep that learns from every twin
        (`frametwin.printing.adaptation.aiming`); ``linear`` is that of older jobs
        (`frametwin.printing.adaptation.compensation`).
    reprint
        Lay lost struts again at the start of the next batch.
    resize
        Where a forecast is trusted, give each batch as many struts as suit the drift that is expected while it is laid.
    cameras
        One of `CAMERAS`: ``auto`` finds cameras along with each batch, within the errors of their rig, where the
        pictures ask for it; ``exact`` takes them as they are.
    limits
        When the job stops.
    coupon
        How many of the last struts are a test coupon, by which no print is judged; see
        `frametwin.printing.process.coupon`.
    support_struts
        How many struts before those are pieces of temporary supports, by which no print is judged either; see
        `frametwin.printing.process.supports`.

    Raises
    ------
    InputError
        If something is wanted that only a job which adapts can do.
    """

    robot: RobotSettings
    adapt: bool = True
    anticipate: bool = False
    compensate: bool = False
    forecast: Annotated[str, one_of(FORECASTS)] = "creep"
    reprint: bool = False
    resize: bool = False
    cameras: Annotated[str, one_of(CAMERAS)] = "auto"
    limits: GuardLimits = field(default_factory=GuardLimits)
    coupon: Annotated[int, at_least(0)] = 0
    support_struts: Annotated[int, at_least(0)] = 0

    def __post_init__(self) -> None:
        check_settings(self)
        for name in ("anticipate", "compensate", "reprint"):
            if getattr(self, name) and not self.adapt:
                raise InputError.at("settings", name, "needs twins to go by", "let the job adapt, or leave it out")

    def of_frame(self, design: Wireframe) -> np.ndarray:
        """(E,) bool: struts of the frame itself, without those of supports and a coupon."""
        return without_last(design.strut_count, self.added)

    def of_print(self, design: Wireframe) -> np.ndarray:
        """(E,) bool: struts that have to stand while the print goes on: those of the frame and of its supports."""
        return without_last(design.strut_count, self.coupon)

    @property
    def added(self) -> int:
        """How many of the last struts are not the frame's."""
        return self.coupon + self.support_struts

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        own = {item.name: getattr(self, item.name) for item in fields(self)}
        return {**own, "robot": self.robot.as_dict(), "limits": dataclasses.asdict(self.limits)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str) -> JobSettings:
        """Settings out of a JSON file.

        Raises
        ------
        InputError
            If a setting is missing, unknown or of another kind.
        """
        # Jobs that were planned before there were these choices do what they did then.
        former = {"anticipate": False, "cameras": "exact", "forecast": "linear", "resize": False}
        data = {**former, "coupon": 0, "support_struts": 0, **data}
        missing = [item.name for item in fields(cls) if item.name not in data]
        if missing:
            raise InputError.at(source, f"settings.{missing[0]}", "is missing", "plan the job again")
        if not isinstance(data["robot"], dict):
            raise InputError.at(source, "settings.robot", "is no object", "plan the job again")
        own = {key: value for key, value in data.items() if key != "robot"}
        robot = RobotSettings.from_dict(data["robot"], source)
        with told_of(source, "settings"):
            return cls(robot, **convert_fields(cls, own, source))


@dataclass(frozen=True)
class JobFile:
    """What ``job.json`` holds.

    Attributes
    ----------
    name, struts
        Of the design.
    batches
        As first planned.
    settings
        See `JobSettings`.
    hashes
        SHA-256 of ``design.json`` and ``sequence.json``.
    verified
        Whether the file has a hash of its own, by which it is as it was written; older jobs have none.
    """

    name: str
    struts: int
    batches: int
    settings: JobSettings
    hashes: Mapping[str, str]
    verified: bool = True


def write_job_file(folder: Path, name: str, struts: int, batches: int, settings: JobSettings) -> None:
    """Write ``job.json`` beside the design and the sequence, which are there."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "frametwin": __version__,
        "name": name,
        "struts": struts,
        "batches": batches,
        "hashes": {file: file_hash(folder / file) for file in (DESIGN, SEQUENCE)},
        "settings": settings.as_dict(),
    }
    write_json(folder / JOB, {**content, OWN_HASH: _hash_of(content)})


def _hash_of(content: Mapping[str, Any]) -> str:
    """SHA-256 of what ``job.json`` holds, but for the hash itself; how the text is laid out does not matter."""
    others = {key: value for key, value in json.loads(dump_json(content)).items() if key != OWN_HASH}
    return hashlib.sha256(json.dumps(others, sort_keys=True).encode("utf-8")).hexdigest()


def read_job_file(folder: Path) -> JobFile:
    """Read ``job.json`` and check that it is as it was written, and design and sequence those that it was written for.

    Raises
    ------
    InputError
        If there is none, it is damaged, or it or one of the others was changed.
    """
    if not folder.is_dir():
        raise InputError.at(folder, "folder", "there is no such folder", "give a job: see frametwin print plan")
    path = folder / JOB
    if not path.is_file():
        remedy = "give the folder of a job, or plan one by frametwin print plan"
        raise InputError.at(folder, "folder", f"is no print job (there is no {JOB})", remedy)
    data = read_json(path)
    check_format(data, path, FORMAT, VERSION)
    kinds = {"name": str, "struts": int, "batches": int, "hashes": dict, "settings": dict}
    for key, kind in kinds.items():
        if type(data.get(key)) is not kind:
            raise InputError.at(path, key, "is missing or of another kind", "plan the job again")
    for file, digest in data["hashes"].items():
        if file not in (DESIGN, SEQUENCE) or file_hash(folder / file) != digest:
            remedy = "put the file back as it was, or plan another job"
            raise InputError.at(folder / file, "file", "is not the one that the job was planned with", remedy)
    settings = JobSettings.from_dict(data["settings"], str(path))
    if OWN_HASH in data and data[OWN_HASH] != _hash_of(data):
        remedy = "put the file back as it was, or plan another job"
        raise InputError.at(path, "file", "is not as the job was planned: something in it was changed", remedy)
    return JobFile(data["name"], data["struts"], data["batches"], settings, data["hashes"], OWN_HASH in data)


def write_report(folder: Path, report: Mapping[str, Any]) -> None:
    """Write ``report.json`` of a batch."""
    write_json(folder / REPORT, {"format": REPORT_FORMAT, "version": VERSION, "frametwin": __version__, **report})


def read_report(folder: Path) -> dict[str, Any]:
    """Read ``report.json`` of a batch that has been answered.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    path = folder / REPORT
    data = read_json(path)
    check_format(data, path, REPORT_FORMAT, VERSION)
    for key in ("batch", "pictures", "lost", "seconds"):
        if key not in data:
            raise InputError.at(path, key, "is missing", "put the file back as it was")
    return data


def write_drift(folder: Path, rate: np.ndarray) -> None:
    """Write ``drift.json`` of a batch: (V, 3) mm for each strut that is laid."""
    write_json(folder / DRIFT, {"format": DRIFT_FORMAT, "version": VERSION, "rate": rate})


def read_drift(folder: Path, vertices: int) -> np.ndarray | None:
    """Read ``drift.json`` of a batch of a frame with so many vertices; ``None`` if it has none.

    Raises
    ------
    InputError
        If it is damaged.
    """
    path = folder / DRIFT
    if not path.is_file():
        return None
    data = read_json(path)
    check_format(data, path, DRIFT_FORMAT, VERSION)
    return checked_array(data.get("rate"), "f", (vertices, 3), str(path), "rate")
