"""Settings of the fast fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from frametwin.errors import InputError
from frametwin.fields.lattice_fit import MOST_COEFFICIENTS
from frametwin.fitting.camera_freedoms import RigErrors
from frametwin.fitting.changes import Changeable
from frametwin.ranges import Share, above, check_settings, in_words, one_of, some, within

Detail = Annotated[float, within(0.01, 1000.0)]
Blur = Annotated[float, within(0.0, 100.0)]
Steps = Annotated[int, within(1, 10_000)]
Pieces = Annotated[int, within(1, 1000)]
Weight = Annotated[float, within(0.0, 1e12)]
Cap = Annotated[float, above(0.0, up_to=1e6)]

CELLS_WANTED = "the cells of one level or more, from 1 to 16, such as 2 5, with one above 12 at most"
Cells = Annotated[tuple[Annotated[int, within(1, 16)], ...], some("one level or more"), in_words(CELLS_WANTED)]

CAMERAS = ("auto", "exact")
HOLDS = ("auto", "feet", "cameras")


@dataclass(frozen=True, kw_only=True)
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

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    detail: Detail
    blur: Blur
    iterations: Steps
    pieces: Pieces
    pull: Weight = 1e-3
    longest: Cap = 1.0
    gain: Share = 5e-3

    def __post_init__(self) -> None:
        check_settings(self, "stage")


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Gauss-Newton steps of every joint and strut.

    Attributes
    ----------
    detail, blur, iterations, pieces, longest : as in `CoarseStage`.
    pull : weight of the elastic energy about where the coarse stages left the frame.
    drag : weight of the elastic energy of each step.
    share : of each step that is gone. Rods that share a pixel are taken one by one, so that at joints, where they all
        move together, a whole step in sharp pictures would swing from side to side.
    longest_bow : cap on how far a step bows a strut between its ends, in pixels, where there is one. In the last
        pictures no strut that is seen has to bow far any more, and one that is hidden would by chance.
    spread : of the rods' edges in pixels, where it shall not be that of a pixel and the blur.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    detail: Detail
    blur: Blur
    iterations: Steps
    pieces: Pieces
    pull: Weight
    drag: Weight
    longest: Cap = 1.0
    share: Annotated[float, above(0.0, up_to=1.0, noun="a share")] = 1.0
    longest_bow: Cap | None = None
    spread: Annotated[float, within(0.01, 10.0)] | None = None

    def __post_init__(self) -> None:
        check_settings(self, "stage")


_CRISP = Stage(
    detail=14.0, blur=0.0, spread=0.14, iterations=1, pieces=8, pull=0.01, drag=0.04, longest=1.5, longest_bow=1.5
)


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
    crisp : stages after these, in pictures of black and white alone and at their full size. A rod with edges as hard
        as those of such pictures is held by the pixels next to its outline, each of which is either in or out. These
        bound its place more closely than a mean over them tells it.
    crisp_reduced : the same where pictures of their full size are larger than these stages ask for. Edges are as hard
        as the pixels of reduced pictures then.
    learn_thickness, learn_opacity : whether radius and presence are found.
    learn_torn : whether ends of struts may be found torn off their joints.
    degree : of the curves of struts that are bent as no cubic can be; 3 takes every strut for a cubic.
    suspicious : a strut whose pixels are less white than this share is astray or missing.
    troubled : with more than this share of the struts astray after the frame's own motions, others are tried too;
        stubs do not count.
    absent : a piece whose pixels are less white than this share is missing.
    field_cells : cells of the lattices of the field that is fitted to the result, along the longest side.
    cameras : one of `CAMERAS`: ``exact`` takes the rig as it is; ``auto`` lets cameras move within its errors where the
        pictures ask for it.
    leave_out_views : whether views that disagree with all others are left out.
    hold : one of `HOLDS`: what holds the world when cameras move. ``feet`` on the plate, the ``cameras``, or ``auto``:
        the feet, unless all cameras would have to have moved together for it.
    rig_errors : standard deviations of cameras whose calibration does not say how well they are known.
    outline_error : pixels by which the outlines in the pictures may be wrong all along a strut, as light and shading
        leave them in photographs.

    Raises
    ------
    InputError
        If a value is out of its range, or there is no stage where one is needed.
    """

    preset: str = "fast"
    seed: Annotated[int, within(0, 2**63 - 1)] = 0
    kernels_per_strut: Annotated[int, within(1, 1000)] = 20
    cells: Annotated[int, within(1, 6)] = 1
    coarse: tuple[CoarseStage, ...] = (
        CoarseStage(detail=0.25, blur=0.75, iterations=14, pieces=2, longest=0.5),
        CoarseStage(detail=0.45, blur=0.75, iterations=10, pieces=2, longest=0.5),
        CoarseStage(detail=0.9, blur=0.7, iterations=6, pieces=4),
    )
    refine: Annotated[tuple[Stage, ...], some("one stage or more")] = (
        Stage(detail=0.9, blur=1.0, iterations=3, pieces=4, pull=0.12, drag=1.2),
        Stage(detail=0.9, blur=1.0, iterations=3, pieces=4, pull=0.04, drag=0.4),
        Stage(detail=0.9, blur=0.7, iterations=3, pieces=4, pull=0.04, drag=0.12),
        Stage(detail=1.8, blur=0.7, iterations=4, pieces=6, pull=0.04, drag=0.12, longest=1.5),
    )
    recover: tuple[Stage, ...] = (
        Stage(detail=1.8, blur=1.0, iterations=1, pieces=6, pull=0.04, drag=0.12, longest=1.5),
        Stage(detail=1.8, blur=0.7, iterations=2, pieces=6, pull=0.04, drag=0.12, longest=1.5),
    )
    finish: Annotated[tuple[Stage, ...], some("one stage or more")] = (
        Stage(detail=3.6, blur=0.4, iterations=3, pieces=8, pull=0.02, drag=0.08, longest=1.5, share=0.7),
        Stage(detail=8.0, blur=0.3, iterations=3, pieces=8, pull=0.01, drag=0.04, longest=1.5, share=0.6),
    )
    crisp: tuple[Stage, ...] = (_CRISP, replace(_CRISP, spread=0.07))
    crisp_reduced: tuple[Stage, ...] = (
        Stage(detail=10.0, blur=0.0, iterations=2, pieces=8, pull=0.01, drag=0.04, longest=1.5, longest_bow=1.5),
    )
    learn_thickness: bool = True
    learn_opacity: bool = True
    learn_torn: bool = True
    degree: Annotated[int, within(3, 8)] = 5
    suspicious: Share = 0.9
    troubled: Share = 0.03
    absent: Share = 0.5
    field_cells: Cells = (2, 5)
    cameras: Annotated[str, one_of(CAMERAS)] = "auto"
    leave_out_views: bool = True
    hold: Annotated[str, one_of(HOLDS)] = "auto"
    rig_errors: RigErrors = RigErrors()
    outline_error: Annotated[float, within(0.0, 10.0)] = 0.0

    def __post_init__(self) -> None:
        check_settings(self)
        self._check_field_cells()

    def _check_field_cells(self) -> None:
        """A field that could not be fitted shall not be found out after the fit."""
        if sum((count + 3) ** 3 for count in self.field_cells) > MOST_COEFFICIENTS:
            raise InputError.at("settings", "field_cells", f"is {self.field_cells!r}", f"give {CELLS_WANTED}")
