"""How a frame is to be printed, and what the tool can reach in which way, past what."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.batches import default_batch_size
from frametwin.printing.sequencing.clearance import collision_bits, joined_struts
from frametwin.printing.sequencing.directions import neighbours, tool_directions
from frametwin.printing.sequencing.holds import allowed_holds, hold_costs
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.removal import Task
from frametwin.progress import ProgressCallback

LARGEST_TABLE = 4 << 30
"""Bytes that the table of collisions may take."""


@dataclass(frozen=True)
class OrderSettings:
    """How a frame is to be printed.

    Attributes
    ----------
    nozzle
        The tool; ``None`` for one that suits the frame (`Nozzle.fitting`).
    max_tilt_deg
        How far the tool's axis may lean from the vertical; 0 for machines with three axes.
    batch_size
        Struts from one look of the cameras to the next, about; ``None`` for a twentieth of all, from 4 to 12.
    allow_contact
        Where the tool cannot reach a strut without touching others, or a given order begins struts in the air, plan
        the fewest contacts instead of refusing; `frametwin.printing.sequencing.check.check_sequence` lists them.
    attempts
        Searches in all, where the first finds no order: the others shuffle the heights.
    seed
        Of the shuffling.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    nozzle: Nozzle | None = None
    max_tilt_deg: float = 60.0
    batch_size: int | None = None
    allow_contact: bool = False
    attempts: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.max_tilt_deg < 90.0:
            raise _refuse("max_tilt_deg", self.max_tilt_deg, "give degrees from 0 up, below 90")
        if self.batch_size is not None and self.batch_size < 1:
            raise _refuse("batch_size", self.batch_size, "give a whole number above 0")
        if self.attempts < 1:
            raise _refuse("attempts", self.attempts, "give a whole number above 0")
        if self.seed < 0:
            raise _refuse("seed", self.seed, "give a whole number from 0 up")

    def nozzle_for(self, frame: Wireframe) -> Nozzle:
        """The tool for ``frame``."""
        return Nozzle.fitting(frame) if self.nozzle is None else self.nozzle

    def batch_size_for(self, frame: Wireframe) -> int:
        """Struts in a batch of ``frame``, about."""
        return default_batch_size(frame) if self.batch_size is None else self.batch_size

    @property
    def axes(self) -> np.ndarray:
        """(D, 3) the ways of holding the tool."""
        return tool_directions(math.radians(self.max_tilt_deg))


def task_of(frame: Wireframe, settings: OrderSettings, progress: ProgressCallback | None = None) -> Task:
    """Look at every strut with every axis of ``settings`` beside every other strut.

    Raises
    ------
    InputError
        If the table of collisions would take more than `LARGEST_TABLE`.
    """
    nozzle, axes = settings.nozzle_for(frame).long_enough(frame), settings.axes
    size = frame.strut_count**2 * len(axes) // 8
    if size > LARGEST_TABLE:
        problem = f"{frame.strut_count} struts in {len(axes)} directions need {size / 2**30:.0f} GB"
        raise InputError.at(frame.name, "edges", problem, "allow less tilt, or print the frame in parts")
    allowed = allowed_holds(frame, nozzle, axes)
    bits = collision_bits(frame, nozzle, axes, np.asarray(allowed.any(axis=2)), joined_struts(frame), progress)
    return Task.of(frame, bits, allowed, hold_costs(frame, axes), neighbours(axes))


def _refuse(field: str, value: object, remedy: str) -> InputError:
    return InputError.at("settings", field, f"is {value}", remedy)
