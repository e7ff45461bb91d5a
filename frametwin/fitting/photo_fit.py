"""Fit and masks by turns: a twin tells where to look in the photographs, and what is seen there gives a better twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture
from frametwin.fields.base import DeformationField
from frametwin.fitting.camera_corrections import as_found
from frametwin.fitting.judgement import FAR, UNSETTLED
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.photo_masks import ViewMask
from frametwin.imaging.view_masks import refine_view_masks, require_views
from frametwin.twin.twin import Twin

ROUNDS = 6
"""Further looks at the photographs, at most; each leaves about half of what the one before left."""

OUTLINE_OF_MASKS = 0.2
"""Pixels by which a mask of a photograph may have a strut elsewhere than it is. With it between 0.83 and 0.97 of the
struts of rendered photographs lay within two standard deviations; without it 0.66 to 0.92."""

NEEDED = 1.5
"""How many times greater the misfit under the rig's own cameras must be for cameras to be believed that moved further
than the rig allows. Masks that are too thin on their dark sides ask for such cameras too, and gain nothing by them."""


class Fitted(Protocol):
    """What a fit gives."""

    @property
    def twin(self) -> Twin:
        """The twin of the whole frame."""

    @property
    def field(self) -> DeformationField:
        """The field that moved it."""


Result = TypeVar("Result", bound=Fitted)
Result_co = TypeVar("Result_co", bound=Fitted, covariant=True)


@dataclass(frozen=True, eq=False)
class Looked(Generic[Result]):
    """What came of a fit and looks at the photographs by turns.

    Attributes
    ----------
    result : the last fit.
    masks : that it was made from.
    moved : by the last look, the typical strut, in radii; 0 where there was none.
    """

    result: Result
    masks: list[ViewMask]
    moved: float


class Fit(Protocol[Result_co]):
    """A fit to some cameras and their masks, from a field or from the plan; with ``exact`` the cameras stay."""

    def __call__(
        self, cameras: list[Camera], pictures: list[np.ndarray], start: DeformationField | None, exact: bool
    ) -> Result_co:
        """The fit."""


def fit_by_turns(
    capture: Capture,
    masks: Sequence[ViewMask],
    fit: Fit[Result],
    start: DeformationField | None = None,
    rounds: int = ROUNDS,
) -> Looked[Result]:
    """Fit, and where there are photographs look again about the twin and fit from there.

    Parameters
    ----------
    capture
        The capture.
    masks
        Of all its views; see `frametwin.imaging.view_masks.read_view_masks`. Those that are not used are left out.
    fit
        See `Fit`.
    start
        From which the first fit starts.
    rounds
        How often to look again.

    Raises
    ------
    InputError
        If a closer look leaves too few views that can be used.
    """
    seen = list(masks)
    result = _fit_used(capture, seen, fit, start)
    if not shows_photographs(seen):
        return Looked(result, seen, 0.0)
    moved = 0.0
    for _ in range(rounds):
        cameras = as_found([view.camera.without_distortion() for view in capture.views], result.twin.cameras)
        twin = result.twin
        seen = refine_view_masks(capture, seen, twin.as_wireframe(capture.frame), cameras, curves=twin.curves)
        require_views(capture, seen)
        before, result = result, _fit_used(capture, seen, fit, result.field)
        moved = _moved(capture.frame, before.twin, result.twin)
        if moved < UNSETTLED:
            break
    return Looked(result, seen, moved)


def _moved(frame: Wireframe, before: Twin, after: Twin) -> float:
    """How far the typical printed strut is between two twins, in radii."""
    away = np.linalg.norm((after.control_points - before.control_points).mean(axis=1), axis=1)
    return float(np.median((away / frame.radius)[frame.printed]))


def _fit_used(capture: Capture, masks: Sequence[ViewMask], fit: Fit[Result], start: DeformationField | None) -> Result:
    used = [i for i, mask in enumerate(masks) if mask.used]
    cameras = [capture.views[i].camera.without_distortion() for i in used]
    pictures = [masks[i].coverage for i in used]
    free = fit(cameras, pictures, start, exact=False)
    if not shows_photographs(masks) or typical_correction(free.twin) <= FAR:
        return free
    exact = fit(cameras, pictures, start, exact=True)
    return exact if typical_misfit(exact.twin) < NEEDED * typical_misfit(free.twin) else free


def shows_photographs(masks: Sequence[ViewMask]) -> bool:
    """Whether any of the views that are used is a photograph and no mask."""
    return any(mask.photo is not None and mask.used for mask in masks)


def outline_error(masks: Sequence[ViewMask]) -> float:
    """Pixels by which the outlines in some masks may be wrong; see `frametwin.fitting.fast_settings.FastSettings`."""
    return OUTLINE_OF_MASKS if shows_photographs(masks) else 0.0


def outline_doubt(masks: Sequence[ViewMask]) -> float:
    """Pixels by which a strut of photographs may be elsewhere: more where they are out of focus."""
    used = [mask.blur for mask in masks if mask.used]
    return OUTLINE_OF_MASKS * (1.0 + float(np.median(used))) if used else OUTLINE_OF_MASKS


def typical_softness(masks: Sequence[ViewMask]) -> float:
    """Blur of the typical photograph that is used, in half widths of a strut; 0 where there is none."""
    used = [mask.softness for mask in masks if mask.used and mask.photo is not None]
    return float(np.median(used)) if used else 0.0


def typical_correction(twin: Twin) -> float:
    """Standard deviations of its rig by which the typical camera was corrected; 0 where all stay."""
    return float(np.median([camera["sigmas"] for camera in twin.cameras])) if twin.cameras else 0.0


def typical_misfit(twin: Twin) -> float:
    """Share of pixels of the typical view on which twin and picture disagree."""
    return float(np.median([view["unexplained"] + view["unseen"] for view in twin.views if view["used"]]))
