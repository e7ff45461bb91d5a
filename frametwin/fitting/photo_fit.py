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
from frametwin.fitting.judgement import FAR
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.photo_masks import ViewMask
from frametwin.imaging.view_masks import refine_view_masks, require_views
from frametwin.twin.twin import Twin

ROUNDS = 6
"""Further looks at the photographs, at most; each leaves about half of what the one before left."""

SETTLED = 0.02
"""Share of its radius by which a look moves the typical strut, below which there is no further one."""


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
    if not any(mask.photo is not None and mask.used for mask in seen):
        return Looked(result, seen, 0.0)
    moved = 0.0
    for _ in range(rounds):
        cameras = as_found([view.camera.without_distortion() for view in capture.views], result.twin.cameras)
        seen = refine_view_masks(capture, seen, result.twin.as_wireframe(capture.frame), cameras)
        require_views(capture, seen)
        before, result = result, _fit_used(capture, seen, fit, result.field)
        moved = _moved(capture.frame, before.twin, result.twin)
        if moved < SETTLED:
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
    if not any(masks[i].photo is not None for i in used) or not _fled(free.twin):
        return free
    exact = fit(cameras, pictures, start, exact=True)
    return exact if typical_misfit(exact.twin) < NEEDED * typical_misfit(free.twin) else free


def _fled(twin: Twin) -> bool:
    """Whether most cameras were moved by more than their rig allows."""
    return bool(twin.cameras) and float(np.median([camera["sigmas"] for camera in twin.cameras])) > FAR


def typical_misfit(twin: Twin) -> float:
    """Share of pixels of the typical view on which twin and picture disagree."""
    return float(np.median([view["unexplained"] + view["unseen"] for view in twin.views if view["used"]]))
