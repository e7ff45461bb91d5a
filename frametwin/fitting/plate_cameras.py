"""Cameras as the markers on the plate show them.

Markers that lie still in the robot's world are seen in the very pictures that the print is found in. Each picture so
tells where its camera was at that moment, by some hundredths of a degree and tenths of a millimetre; what the rig knows
of the camera counts beside it. A camera that was touched is told at once, and the print's own pictures need not tell
cameras from struts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.plate import Plate
from frametwin.capture.capture import Capture, View
from frametwin.errors import InputError
from frametwin.fitting.camera_corrections import as_found, as_record, corrections_between
from frametwin.fitting.camera_freedoms import (
    LENS,
    RigErrors,
    corrected,
    deviations_of,
    rig_covariances,
    whitening,
)
from frametwin.fitting.judgement import FAR
from frametwin.imaging.masks import decode, undistort
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import DOUBTFUL, GOOD, Verdict

if TYPE_CHECKING:
    from frametwin.calibration.boards import Board

CORNER = 0.2
"""Standard deviation in px of a corner of a marker, with what a printed sheet is not flat."""

TYPICAL = float(np.sqrt(2.0 * np.log(2.0)))
"""Distance of the typical point of a plane from its place, in standard deviations of one direction."""

LEAST_CORNERS = 12
"""Three markers; fewer may be a mistake, and hardly hold a camera."""

STRAY = 3.0
"""Standard deviations from which a corner, or a camera's correction, counts less than its square."""

ASTRAY = 10.0
"""Standard deviations that the typical corner may be off; beyond that, the markers are not where the plate says."""

ALL_MOVED = (
    "by the plate's markers most cameras are far from where the rig has them: the plate was moved or printed at another"
    " size, or the rig is another one"
)

NONE_SEEN = "no view shows the plate's markers: the cameras are where the rig has them"

_WORKERS = 2
_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class Resected:
    """A camera as the markers in its picture have it.

    Attributes
    ----------
    freedoms : (10,) correction of the camera; see `frametwin.fitting.camera_freedoms`.
    covariance : (10, 10) of what is left to be found.
    corners : how many of the markers' corners were seen.
    error : px, of the typical corner after it.
    """

    freedoms: np.ndarray
    covariance: np.ndarray
    corners: int
    error: float


def resected(camera: Camera, points: np.ndarray, pixels: np.ndarray, covariance: np.ndarray) -> Resected:
    """The most probable correction of a camera, by points that it sees and by what is known of it.

    Parameters
    ----------
    camera
        Without lens distortion.
    points, pixels : (N, 3) array, mm, and (N, 2) array
        Where the points are, and where they are seen.
    covariance : (10, 10) array
        Of the camera.
    """
    # A quarter of a second, which fits without a plate do without.
    from scipy.optimize import OptimizeResult, least_squares

    white = whitening(covariance[None])[0]
    scale = np.sqrt(np.diag(covariance))

    def seen(freedoms: np.ndarray) -> np.ndarray:
        return np.asarray(corrected([camera], freedoms[None])[0].project(points)[0])

    def solved(noise: float, start: np.ndarray) -> OptimizeResult:
        def misses(steps: np.ndarray) -> np.ndarray:
            freedoms = steps * scale
            return np.concatenate([((seen(freedoms) - pixels) / noise).ravel(), white @ freedoms])

        return least_squares(misses, start, loss="soft_l1", f_scale=STRAY, max_nfev=_ROUNDS)

    def error_of(steps: np.ndarray) -> float:
        return float(np.median(np.linalg.norm(seen(steps * scale) - pixels, axis=1)))

    found = solved(CORNER, np.zeros(len(scale)))
    noise = error_of(found.x) / TYPICAL
    if noise > CORNER:  # markers that are seen badly are believed less
        found = solved(noise, found.x)
    left = np.linalg.inv(found.jac.T @ found.jac) * np.outer(scale, scale)
    return Resected(found.x * scale, left, len(points), error_of(found.x))


@dataclass(frozen=True, eq=False)
class Placed:
    """A capture with its cameras where the plate's markers have them.

    Attributes
    ----------
    rig : the capture as it was read.
    capture : the one with moved cameras.
    found : of each view, what its markers told; None of those that show too little of them, whose cameras stay.
    errors : standard deviations of cameras of which nothing else is known.
    """

    rig: Capture
    capture: Capture
    found: tuple[Resected | None, ...]
    errors: RigErrors

    def told(self, twin: Twin) -> Twin:
        """The twin that was fitted through these cameras, with its corrections counted from the rig's."""
        if self.rig.plate is None:
            return twin
        if all(own is None for own in self.found):
            return twin.replace(verdict=replace(twin.verdict, reasons=(*twin.verdict.reasons, NONE_SEEN)))
        records = list(self._records(twin))
        notes = [note for record, own in zip(records, self.found, strict=True) for note in _notes(record, own)]
        judged = twin.verdict
        if np.median([record["sigmas"] for record in records]) > FAR:
            status = DOUBTFUL if judged.status == GOOD else judged.status
            judged = Verdict(status, (ALL_MOVED, *judged.reasons))
        return twin.replace(cameras=records, verdict=replace(judged, reasons=(*judged.reasons, *notes)))

    def _records(self, twin: Twin) -> Iterator[dict[str, Any]]:
        before = [view.camera.without_distortion() for view in self.rig.views]
        after = as_found([view.camera.without_distortion() for view in self.capture.views], twin.cameras)
        fitted = {record["name"]: record for record in twin.cameras}
        deviations = deviations_of(rig_covariances(before, self.errors))
        for camera, now, own, known in zip(before, after, self.found, deviations, strict=True):
            record = fitted.get(camera.name, {})
            freedoms = corrections_between(camera, now)
            freedoms[LENS] = record.get("k1", 0.0) + (0.0 if own is None else own.freedoms[LENS])
            sigmas = float(np.abs(freedoms / known).max())
            yield as_record(camera.name, freedoms, sigmas, record.get("held_by", "plate"))


def through_plate(capture: Capture, errors: RigErrors, progress: ProgressCallback | None = None) -> Placed:
    """A capture with its cameras where the plate's markers have them; one without a plate stays as it is.

    Parameters
    ----------
    capture
        As it was read.
    errors
        Standard deviations of cameras of which nothing else is known.
    progress
        Called after each view.

    Raises
    ------
    InputError
        If the plate is no board, or its markers are not where it says, or a picture cannot be decoded.
    Cancelled
        If ``progress`` says so.
    """
    plate = capture.plate
    if plate is None:
        return Placed(capture, capture, tuple(None for _ in capture.views), errors)
    from frametwin.calibration.boards import parse_board  # which few captures need

    board = parse_board(plate.board, f"{capture.root}: plate")
    views, found = [], []
    with ThreadPoolExecutor(_WORKERS) as pool:
        for i, own in enumerate(pool.map(lambda view: _of_view(view, board, plate, errors), capture.views)):
            view = capture.views[i]
            found.append(own)
            views.append(view if own is None else replace(view, camera=_moved(view.camera, own)))
            report(progress, Progress("finding the plate's markers", i + 1, len(capture.views)))
    _check(capture, found)
    return Placed(capture, replace(capture, views=tuple(views)), tuple(found), errors)


def _of_view(view: View, board: Board, plate: Plate, errors: RigErrors) -> Resected | None:
    from frametwin.calibration.boards import corner_points
    from frametwin.calibration.detection import Look, find_corners

    image = undistort(decode(view.image, view.camera), view.camera)
    grey = np.asarray(image if image.ndim == 2 else image.mean(axis=2).round(), dtype=np.uint8)
    corners, pixels = find_corners(grey, board, Look())
    if len(corners) < LEAST_CORNERS:
        return None
    points = corner_points(board)[corners] @ plate.pose[:3, :3].T + plate.pose[:3, 3]
    camera = view.camera.without_distortion()
    return resected(camera, points, pixels, rig_covariances([camera], errors)[0])


def _moved(camera: Camera, found: Resected) -> Camera:
    """The camera after its correction, with its own lens."""
    moved = corrected([camera], found.freedoms[None])[0]
    return replace(moved, distortion=camera.distortion, model=camera.model, covariance=found.covariance)


def _check(capture: Capture, found: Sequence[Resected | None]) -> None:
    errors = [own.error for own in found if own is not None]
    if errors and float(np.median(errors)) > ASTRAY * CORNER:
        problem = f"its markers are {np.median(errors):.1f} px from where it says in the typical view"
        remedy = "measure where the plate lies and how large its squares are, or leave it out with --cameras exact"
        raise InputError.at(capture.root, "plate", problem, remedy)


def _notes(record: Mapping[str, Any], own: Resected | None) -> list[str]:
    name = record["name"]
    if own is None:
        return [f"view {name} shows too little of the plate's markers: its camera is where the rig has it"]
    if record["sigmas"] <= FAR:
        return []
    turned, shifted = (np.linalg.norm(record[key]) for key in ("turn_deg", "shift_mm"))
    return [
        f"view {name}: by the plate's markers its camera is {shifted:.1f} mm and {turned:.2f} degrees from where the"
        f" rig has it ({record['sigmas']:.0f} standard deviations): calibrate it again"
    ]
