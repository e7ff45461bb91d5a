"""Fit and masks by turns: a twin tells where to look in the photographs, and what is seen there gives a better twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture
from frametwin.fields.base import DeformationField
from frametwin.imaging.photo_masks import ViewMask
from frametwin.imaging.view_masks import refine_view_masks, require_views
from frametwin.twin.twin import Twin

ROUNDS = 3
"""Further looks at the photographs; each halves about what the one before left."""


class Fitted(Protocol):
    """What a fit gives."""

    @property
    def twin(self) -> Twin:
        """The twin of the whole frame."""

    @property
    def field(self) -> DeformationField:
        """The field that moved it."""


Result = TypeVar("Result", bound=Fitted)

Fit = Callable[[list[Camera], list[np.ndarray], DeformationField | None], Result]
"""A fit to some cameras and their masks, from a field or from the plan."""


def fit_by_turns(
    capture: Capture,
    masks: Sequence[ViewMask],
    fit: Fit[Result],
    start: DeformationField | None = None,
    rounds: int = ROUNDS,
) -> tuple[Result, list[ViewMask]]:
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

    Returns
    -------
    The last fit and the masks that it was made from.

    Raises
    ------
    InputError
        If a closer look leaves too few views that can be used.
    """
    seen = list(masks)
    result = _fit_used(capture, seen, fit, start)
    if not any(mask.photo is not None and mask.used for mask in seen):
        return result, seen
    for _ in range(rounds):
        seen = refine_view_masks(capture, seen, result.twin.as_wireframe(capture.frame))
        require_views(capture, seen)
        result = _fit_used(capture, seen, fit, result.field)
    return result, seen


def _fit_used(capture: Capture, masks: Sequence[ViewMask], fit: Fit[Result], start: DeformationField | None) -> Result:
    used = [i for i, mask in enumerate(masks) if mask.used]
    cameras = [capture.views[i].camera.without_distortion() for i in used]
    return fit(cameras, [masks[i].coverage for i in used], start)
