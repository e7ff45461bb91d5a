"""The twin of a batch: from where the last twin left the print, and from afresh only where that goes astray."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from frametwin.cameras import Camera
from frametwin.fields.base import DeformationField, enlarged_box
from frametwin.fields.lattice import LatticeField
from frametwin.fitting.api import FitResult, fit_views
from frametwin.fitting.camera_corrections import as_found
from frametwin.fitting.fast_settings import Stage
from frametwin.fitting.known_start import KnownStart
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.adapt import lost_struts
from frametwin.printing.adaptation.evidence import Pictures
from frametwin.printing.adaptation.last_twin import start_after
from frametwin.progress import ProgressCallback
from frametwin.twin.twin import Twin

EVERY_VIEW: dict[str, Any] = {"leave_out_views": False}
"""A job judges its views itself, batch by batch: pictures of another moment are a reason to stop."""

WARM: dict[str, Any] = {
    **EVERY_VIEW,
    "refine": (
        Stage(detail=0.9, blur=1.5, iterations=1, pieces=4, pull=0.12, drag=1.2),
        Stage(detail=0.9, blur=1.0, iterations=1, pieces=4, pull=0.12, drag=0.4),
        Stage(detail=1.8, blur=0.7, iterations=2, pieces=6, pull=0.04, drag=0.12, longest=1.5),
    ),
    "finish": (
        Stage(detail=3.6, blur=0.4, iterations=2, pieces=8, pull=0.005, drag=0.08, longest=1.5, share=0.7),
        Stage(detail=6.0, blur=0.33, iterations=1, pieces=8, pull=0.002, drag=0.04, longest=1.5, share=0.8),
    ),
}
"""What is left of the schedule of ``fast`` where the plan is the last twin: everything is within a few radii of where
it starts, so that one more blurred stage does for the coarse ones, and fewer steps do. The error is the same. The last
stages pull less towards the start, which is no smooth motion of the frame here but the plan. Without the first stage,
joints that moved by more than about four radii would be lost; with more of its steps, more go astray. Pictures that are
finer than those of the last stage gain nothing."""

MOST_UNCOVERED = 1.0
"""A warm fit is doubted where as many white pixels lie beside the twin as so many typical struts have. Whole prints
have 0.0; struts that hang free at one end, which no twin can have, count about 0.1 each."""

CROP_MARGIN = 32
"""Pixels that are kept around the struts: their silhouettes, and blurred ones more so, reach beyond centrelines."""

WORKERS = 2
"""Pictures that are cropped together."""

MOST_CONTRADICTED = 0.1
"""It is doubted too where a larger share of the twin lies on black; whole prints have 0.02 to 0.05."""


@dataclass(frozen=True, eq=False)
class BatchFit:
    """The twin of a batch and how it was found.

    Attributes
    ----------
    result
        Twin and field, relative to the plan.
    start
        ``"warm"``, ``"cold"``, or ``"warm, then cold"`` where the warm one was doubted.
    seconds
        That the fit took.
    pictures
        As it was compared with them, through the cameras where it found them.
    """

    result: FitResult
    start: str
    seconds: float
    pictures: Pictures

    @property
    def twin(self) -> Twin:
        """The twin of the whole frame."""
        return self.result.twin

    @property
    def field(self) -> DeformationField:
        """The field that moved it."""
        return self.result.field


def fit_batch(
    expected: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    *,
    warm: bool = True,
    freedom: str = "exact",
    outline_error: float = 0.0,
    last: Twin | None = None,
    progress: ProgressCallback | None = None,
) -> BatchFit:
    """Find the twin of a batch.

    Parameters
    ----------
    expected
        The plan that the robot followed, its printed struts being where the last twin saw them, or, those of the
        batch, where they were laid.
    cameras, masks
        Cameras without distortion, and (H, W) masks 0..1.
    warm
        Start from the plan as it is. Struts that are then not found, or pictures that are not explained, are taken for
        a reason to start afresh; the twin that explains the pictures better is given back.

    freedom
        ``auto`` lets cameras move within the errors of their rig where the pictures ask for it, ``exact`` does not; as
        the setting ``cameras`` of the preset ``fast``.
    outline_error
        Pixels by which the outlines in the masks may be wrong; that preset's setting of the name.
    last
        The twin of the batch before, if the cameras are where they were then: a warm fit starts from what it found of
        them and of the joints' material.

    Raises
    ------
    Cancelled
        If ``progress`` returns ``False``.
    """
    seeing = {"cameras": freedom, "outline_error": outline_error}
    afresh = {**EVERY_VIEW, **seeing}
    began = perf_counter()
    cameras, masks = cropped(expected, cameras, masks)
    # The matrices are small: threads of the linear algebra would wait for those of the splatter, and these for them.
    with threadpool_limits(limits=1, user_api="blas"):
        if not warm:
            result = fit_views(expected, cameras, masks, changes=afresh, callback=progress)
            seen = pictures_through(expected, cameras, masks, result.twin)
            return BatchFit(result, "cold", perf_counter() - began, seen)
        still = LatticeField.zeros(enlarged_box(expected.bounds), [(1, 1, 1)])
        known = KnownStart(still) if last is None else start_after(last, still, expected, cameras)
        changes = {**WARM, **seeing}
        result, start = fit_views(expected, cameras, masks, changes=changes, start=known, callback=progress), "warm"
        seen = pictures_through(expected, cameras, masks, result.twin)
        if _is_doubtful(seen, expected, result):
            other = fit_views(expected, cameras, masks, changes=afresh, callback=progress)
            both = [(result, seen), (other, pictures_through(expected, cameras, masks, other.twin))]
            result, seen = min(both, key=lambda found: _disagreement(found[1], expected, found[0]))
            start = "warm, then cold"
    return BatchFit(result, start, perf_counter() - began, seen)


def _is_doubtful(pictures: Pictures, expected: Wireframe, result: FitResult) -> bool:
    """Whether the pictures show struts elsewhere than the twin has them.

    Lost struts alone, which the pictures do not show either, are no reason to start afresh.
    """
    evidence = pictures.evidence(expected, result.twin)
    return (
        evidence.uncovered * int(expected.printed.sum()) > MOST_UNCOVERED or evidence.contradicted > MOST_CONTRADICTED
    )


def pictures_through(
    expected: Wireframe, cameras: Sequence[Camera], masks: Sequence[np.ndarray], twin: Twin
) -> Pictures:
    """The pictures seen through the cameras where a twin found them to be."""
    return Pictures(expected, as_found(cameras, twin.cameras), masks)


def _disagreement(pictures: Pictures, expected: Wireframe, result: FitResult) -> float:
    """How badly a twin fits the pictures: share that does not match, and share of the struts that it misses."""
    missing = len(lost_struts(expected, result.twin)) / int(expected.printed.sum())
    return pictures.evidence(expected, result.twin).mismatch + missing


def cropped(
    frame: Wireframe, cameras: Sequence[Camera], masks: Sequence[np.ndarray]
) -> tuple[list[Camera], list[np.ndarray]]:
    """Views cut to what is white in them and where the printed struts should be seen, with some room.

    The pictures show all of the frame to be, and most of them are empty for most of the print.

    Parameters
    ----------
    frame
        What is printed of it counts.
    cameras, masks
        Cameras without distortion, and (H, W) masks of their sizes.
    """
    points = frame.control_points[frame.printed].reshape(-1, 3)
    with ThreadPoolExecutor(WORKERS) as pool:  # most of it is done by OpenCV
        views = list(pool.map(partial(_cropped, points), cameras, masks))
    return [part for part, _ in views], [mask for _, mask in views]


def _cropped(points: np.ndarray, camera: Camera, mask: np.ndarray) -> tuple[Camera, np.ndarray]:
    """One view cut to what is white in it, and where points (N, 3) should be seen."""
    pixels, depth = camera.project(points)
    corners = [pixels[depth > 0.0].reshape(-1, 2)]
    x, y, across, down = cv2.boundingRect((mask > 0.0).view(np.uint8))
    if across > 0:
        corners.append(np.array([[x, y], [x + across, y + down]], dtype=np.float64))
    extent = np.concatenate(corners)
    size = np.array([camera.width, camera.height])
    low = np.clip(np.floor(extent.min(axis=0, initial=size.max())) - CROP_MARGIN, 0, size - 1).astype(int)
    high = np.clip(np.ceil(extent.max(axis=0, initial=0.0)) + CROP_MARGIN, low + 1, size).astype(int)
    (left, top), (right, bottom) = low.tolist(), high.tolist()
    part = replace(camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top)
    return part, np.ascontiguousarray(mask[top:bottom, left:right])
