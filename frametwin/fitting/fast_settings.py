"""Settings of the fast fit."""

from __future__ import annotations

from dataclasses import dataclass

from frametwin.errors import InputError
from frametwin.fields.lattice_fit import MOST_COEFFICIENTS
from frametwin.fitting.camera_freedoms import RigErrors
from frametwin.fitting.changes import Changeable

CAMERAS = ("auto", "exact")
HOLDS = ("auto", "feet", "cameras")


@dataclass(frozen=True)
class CoarseStage:
    """Damped Gauss-Newton steps in the frame's smooth motions.

    Attributes
    ----------
    detail : the typical strut's apparent radius in pixels, which sets the size of the pictures; they are never
        enlarged.
    blur : of rods and target, in pixels of that size.
    iterations : steps, at most.
    pieces : straight pieces of a strut.
    pull : weight of the elastic energy.
    longest : cap on a step, in pixels of that size.
    gain : the stage ends when a step lowers the loss by less than this share.
    """

    detail: float
    blur: float
    iterations: int
    pieces: int
    pull: float = 1e-3
    longest: float = 1.0
    gain: float = 5e-3


@dataclass(frozen=True)
class Stage:
    """Gauss-Newton steps of every joint and strut.

    Attributes
    ----------
    detail, blur, iterations, pieces, longest : as in `CoarseStage`.
    pull : weight of the elastic energy about where the coarse stages left the frame.
    drag : weight of the elastic energy of each step.
    share : of each step that is gone. Rods that share a pixel are taken one by one, so that at joints, where they all
        move together, a whole step in sharp pictures would swing from side to side.
    """

    detail: float
    blur: float
    iterations: int
    pieces: int
    pull: float
    drag: float
    longest: float = 1.0
    share: float = 1.0


@dataclass(frozen=True)
class FastSettings(Changeable):
    """Schedule of the ``fast`` preset. It draws nothing at random, so the seed changes nothing.

    Attributes
    ----------
    preset, seed : kept with the result.
    kernels_per_strut : K, pieces for which thickness and opacity are given.
    cells : of the lattice of loads, along the frame's longest side.
    coarse : stages in smooth motions; skipped when the fit starts from an earlier field.
    refine : stages with every joint and strut free.
    recover : stages after struts that were seen to be astray have been put where their neighbours expect them.
    finish : last stages.
    learn_thickness, learn_opacity : whether radius and presence are found.
    suspicious : a strut whose pixels are less white than this share is astray or missing.
    troubled : with more than this share of the struts astray after the frame's own motions, others are tried too.
    absent : a piece whose pixels are less white than this share is missing.
    field_cells : cells of the lattices of the field that is fitted to the result, along the longest side.
    cameras : one of `CAMERAS`: ``exact`` takes the rig as it is; ``auto`` lets cameras move within its errors where the
        pictures ask for it.
    hold : one of `HOLDS`: what holds the world when cameras move. ``feet`` on the plate, the ``cameras``, or ``auto``:
        the feet, unless all cameras would have to have moved together for it.
    rig_errors : standard deviations of what the rig says.
    """

    preset: str = "fast"
    seed: int = 0
    kernels_per_strut: int = 20
    cells: int = 1
    coarse: tuple[CoarseStage, ...] = (
        CoarseStage(0.5, 1.5, 14, 2),
        CoarseStage(0.9, 1.5, 10, 2),
        CoarseStage(0.9, 0.7, 6, 4),
    )
    refine: tuple[Stage, ...] = (
        Stage(0.9, 1.0, 3, 4, 0.12, 1.2),
        Stage(0.9, 1.0, 3, 4, 0.04, 0.4),
        Stage(0.9, 0.7, 3, 4, 0.04, 0.12),
        Stage(1.8, 0.7, 4, 6, 0.04, 0.12, 1.5),
    )
    recover: tuple[Stage, ...] = (
        Stage(1.8, 1.0, 1, 6, 0.04, 0.12, 1.5),
        Stage(1.8, 0.7, 2, 6, 0.04, 0.12, 1.5),
    )
    finish: tuple[Stage, ...] = (
        Stage(3.6, 0.4, 3, 8, 0.02, 0.08, 1.5, 0.7),
        Stage(8.0, 0.3, 3, 8, 0.01, 0.04, 1.5, 0.6),
    )
    learn_thickness: bool = True
    learn_opacity: bool = True
    suspicious: float = 0.9
    troubled: float = 0.03
    absent: float = 0.5
    field_cells: tuple[int, ...] = (2, 5)
    cameras: str = "auto"
    hold: str = "auto"
    rig_errors: RigErrors = RigErrors()

    def __post_init__(self) -> None:
        whole = {"seed": (0, 2**63 - 1), "kernels_per_strut": (1, 1000), "cells": (1, 6)}
        for name, (low, high) in whole.items():
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                raise InputError.at("settings", name, f"is {value!r}", f"give a whole number from {low} to {high}")
        for name in ("suspicious", "troubled", "absent"):
            value = getattr(self, name)
            if not (isinstance(value, float | int) and 0.0 <= value <= 1.0):
                raise InputError.at("settings", name, f"is {value!r}", "give a share from 0 to 1")
        for name in ("learn_thickness", "learn_opacity"):
            if not isinstance(getattr(self, name), bool):
                raise InputError.at("settings", name, f"is {getattr(self, name)!r}", "give true or false")
        self._check_field_cells()

    def _check_field_cells(self) -> None:
        """A field that could not be fitted shall not be found out after the fit."""
        cells = tuple(self.field_cells) if isinstance(self.field_cells, list | tuple) else ()
        whole = all(isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= 16 for count in cells)
        if not cells or not whole or sum((count + 3) ** 3 for count in cells) > MOST_COEFFICIENTS:
            remedy = "give the cells of one level or more, from 1 to 16, such as 2 5, with one above 12 at most"
            raise InputError.at("settings", "field_cells", f"is {self.field_cells!r}", remedy)
        object.__setattr__(self, "field_cells", cells)
