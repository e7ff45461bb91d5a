"""What a robot's operator signs off: every check with its result, every limit with what comes nearest to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from frametwin.printing.job.check_record import BatchLook, JobCheck
from frametwin.printing.job.job import PrintJob

FORMAT = "frametwin-print-check"
VERSION = 1

PASS, FAIL, NOT_ASKED = "pass", "FAIL", "not looked at"

UNVERIFIED = "unverified: job.json is of an older version, which kept no hash of it; compare nozzle, speeds and limits"
"""Told of settings by which all else is checked, and which nothing shows to be those that were planned with."""


@dataclass(frozen=True)
class CheckLine:
    """One line of the page.

    Attributes
    ----------
    name : str
    result : str
        ``pass``, ``FAIL`` or ``not looked at``.
    told : str
        What was looked at, and what comes nearest to the limit.
    """

    name: str
    result: str
    told: str


@dataclass(frozen=True)
class SignOff:
    """The page.

    Attributes
    ----------
    job, design : str
        Names.
    struts, batches : int
        Of the whole job.
    check : JobCheck
    lines : tuple of CheckLine
    """

    job: str
    design: str
    struts: int
    batches: int
    check: JobCheck
    lines: tuple[CheckLine, ...]

    @property
    def verdict(self) -> str:
        """In a few words."""
        if self.check.fine:
            return "sound: nothing was found that speaks against printing"
        failed = [line.name for line in self.lines if line.result == FAIL]
        return f"NOT to be printed as it is: {', '.join(failed)}"

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "job": self.job,
            "design": self.design,
            "struts": self.struts,
            "batch_count": self.batches,
            "verdict": self.verdict,
            "lines": [vars(line) for line in self.lines],
            **self.check.as_dict(),
        }


def sign_off(job: PrintJob, check: JobCheck, order: bool = True) -> SignOff:
    """Sum up a check.

    Parameters
    ----------
    job : PrintJob
    check : JobCheck
    order : bool
        Whether the order was looked at, and not the waypoints of one batch alone.
    """
    looks, robot = check.looks, job.settings.robot
    workspace, allowed = robot.workspace, min(robot.waypoints.max_tilt_deg, robot.workspace.max_tilt_deg)
    fastest = max((look.fastest for look in looks), default=0.0)
    tilt = max((look.tilt_deg for look in looks), default=0.0)
    arm = "no robot was named" if robot.arm is None else f"all of it within reach of the {robot.arm}"
    compared = [name for name in robot.formats if name != "assembly"]  # the whole plan and no waypoints
    settings = "as the job was planned" if job.file.verified else UNVERIFIED
    told = [
        ("settings", (), settings),
        ("order", ("left out",), "every strut is laid once" if order else ""),
        ("material", ("in the air", "gap", "start", "end"), "every strut begins and ends where material is"),
        ("path", ("path",), "every strut is laid along its plan, as was asked for"),
        ("collisions", ("collision",), _air(looks)),
        ("plate", ("plate",), "the tool stays above the plate"),
        ("workspace", ("workspace",), _room(looks, workspace.lower, workspace.upper)),
        ("speed", ("speed",), f"{fastest:.3g} mm/s at most, {workspace.max_speed:.3g} allowed"),
        ("tilt", ("tilt",), f"{tilt:.3g} degrees at most, {allowed:.3g} allowed"),
        ("reach", ("reach",), arm),
        ("files", ("file",), f"{', '.join(compared)} say the same and lay the batch"),
    ]
    asked = {"settings": job.file.verified, "order": order, "reach": robot.arm is not None}
    lines = tuple(_line(check, name, kinds, words, asked.get(name, True)) for name, kinds, words in told)
    return SignOff(job.folder.name, job.design.name, job.design.strut_count, job.sequence.batch_count, check, lines)


def _line(check: JobCheck, name: str, kinds: Sequence[str], told: str, asked: bool) -> CheckLine:
    faults = [fault for fault in check.faults if fault.kind in kinds]
    if faults:
        more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
        return CheckLine(name, FAIL, f"{faults[0]}{more}")
    return CheckLine(name, PASS if asked else NOT_ASKED, told)


def _air(looks: Sequence[BatchLook]) -> str:
    near = [look for look in looks if look.nearest]
    if not near:
        return "nothing stands that could be run into"
    look = min(near, key=lambda look: look.air)
    strut, other = look.nearest
    return f"about {look.air:.2g} mm of air where it is least: batch {look.batch}, strut {strut} beside strut {other}"


def _room(looks: Sequence[BatchLook], lower: np.ndarray, upper: np.ndarray) -> str:
    if not looks:
        return "no waypoints"
    low = np.min([look.lower for look in looks], axis=0)
    high = np.max([look.upper for look in looks], axis=0)
    axes = zip("xyz", low.tolist(), high.tolist(), strict=True)
    room = float(np.minimum(low - lower, upper - high).min())
    return (
        ", ".join(f"{axis} {round(a)} to {round(b)}" for axis, a, b in axes)
        + f" mm; {room:.3g} mm to the nearest limit"
    )
