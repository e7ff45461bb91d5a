"""How a frame is to be printed, and what the tool can reach with which orientation, past what."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.sequencing.batches import default_batch_size
from frametwin.printing.sequencing.clearance import collision_bits, joined_struts
from frametwin.printing.sequencing.directions import neighbours, tool_directions
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.removal import SearchSpace
from frametwin.printing.sequencing.tool_orientation import allowed_orientations, orientation_costs
from frametwin.progress import ProgressCallback
from frametwin.ranges import Seed, Tilt, at_least, check_settings, within

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
        the fewest contacts instead of refusing; ``frametwin print check`` lists them.
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
    max_tilt_deg: Tilt = 60.0
    batch_size: Annotated[int, at_least(1)] | None = None
    allow_contact: bool = False
    attempts: Annotated[int, within(1, 100_000)] = 8
    seed: Seed = 0

    def __post_init__(self) -> None:
        check_settings(self)

    def nozzle_for(self, frame: Wireframe) -> Nozzle:
        """The tool for ``frame``."""
        return Nozzle.fitting(frame) if self.nozzle is None else self.nozzle

    def batch_size_for(self, frame: Wireframe) -> int:
        """Struts in a batch of ``frame``, about."""
        return default_batch_size(frame) if self.batch_size is None else self.batch_size

    @property
    def axes(self) -> np.ndarray:
        """(D, 3) array of unit vectors: the tool orientations."""
        return tool_directions(math.radians(self.max_tilt_deg))


def search_space(frame: Wireframe, settings: OrderSettings, progress: ProgressCallback | None = None) -> SearchSpace:
    """Look at every strut with every tool orientation beside every other strut.

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
    allowed = allowed_orientations(frame, nozzle, axes)
    bits = collision_bits(frame, nozzle, axes, np.asarray(allowed.any(axis=2)), joined_struts(frame), progress)
    return SearchSpace.of(frame, bits, allowed, orientation_costs(frame, axes), neighbours(axes))
