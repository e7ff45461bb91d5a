"""What a check of a print job has found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from frametwin.printing.sequencing.check import Fault


@dataclass(frozen=True)
class BatchLook:
    """What a robot's operator wants to know of a batch.

    Attributes
    ----------
    batch : int
    struts : tuple of int
        In their order.
    files : mapping of str to str
        SHA-256 of each file for the robot, by name.
    waypoints, poses : int
        That were looked at.
    length : float, mm
        Of the struts.
    seconds : float
        Moving and waiting, at the speeds of the file.
    fastest : float, mm/s
    tilt_deg : float
        Largest lean of the tool.
    lower, upper : tuple of float, mm
        Where the tip goes, in the robot's base.
    air : float, mm
        Least air between tool and print, to about a thirtieth of the tool's radius there, as balls fill it; infinite
        where nothing stands.
    nearest : tuple of int
        The strut that is laid there, and the one that the tool comes so near to; empty where nothing stands.
    """

    batch: int
    struts: tuple[int, ...]
    files: Mapping[str, str]
    waypoints: int
    poses: int
    length: float
    seconds: float
    fastest: float
    tilt_deg: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    air: float
    nearest: tuple[int, ...]

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file, which has no infinities."""
        return {**vars(self), "files": dict(self.files), "air": self.air if self.nearest else None}


@dataclass(frozen=True)
class JobCheck:
    """What was found.

    Attributes
    ----------
    faults
        In the order of the print; none if all is well.
    batches
        Those whose waypoints were looked at.
    waypoints, poses
        How many were looked at, of all batches together.
    looks
        What there is to know of each batch.
    """

    faults: tuple[Fault, ...]
    batches: tuple[int, ...]
    waypoints: int
    poses: int
    looks: tuple[BatchLook, ...] = ()

    @property
    def fine(self) -> bool:
        """Nothing is wrong."""
        return not self.faults

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        faults = [{**fault.as_dict(), "sentence": str(fault)} for fault in self.faults]
        looks = [look.as_dict() for look in self.looks]
        return {**vars(self), "fine": self.fine, "faults": faults, "looks": looks}
