"""The true curves of a sample as samples along every strut: from its ``curves.npz``, or else from ``truth.json``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from frametwin.capture.capture import Capture
from frametwin.errors import InputError
from frametwin.formats import defects_json
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.simulation.curve_truth import FILE_NAME, REMEDY, SAMPLES, CurveTruth, read_curves

POINT_TOLERANCE = 1e-3
"""In mm: a coordinate of a metre in single precision is right to a tenth of this."""

PIXEL_TOLERANCE = 0.01


@dataclass(frozen=True, eq=False)
class TrueCurves:
    """Samples along the struts of the truth.

    Attributes
    ----------
    points
        (E, S, 3) mm.
    tangents
        (E, S, 3) unit; zero where the curve stands still.
    radius
        (E, S) mm.
    present
        (E, S) bool: the strut is printed and really there.
    intervals
        (E, 2) of the curve parameter at which each strut is there.
    visible
        (N, E, S) bool, where it is known: nothing else stands in front of it, and it is inside of the picture.
    depth
        (N, E, S) mm along the viewing direction, where ``visible`` is known.
    """

    points: np.ndarray
    tangents: np.ndarray
    radius: np.ndarray
    present: np.ndarray
    intervals: np.ndarray
    visible: np.ndarray | None = None
    depth: np.ndarray | None = None


def intervals_of(root: Path, printed: np.ndarray) -> np.ndarray:
    """(E, 2) interval at which each strut, (E,) bool printed, is there, by the ``defects.json`` of a sample.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    if (root / defects_json.FILE_NAME).is_file():
        return defects_json.read(root, printed)
    return np.stack([np.zeros(len(printed)), printed.astype(np.float64)], axis=1)


def read_true_curves(capture: Capture, truth: Wireframe) -> tuple[TrueCurves, list[str]]:
    """Read the true curves of a sample, and compare them with its truth and its cameras.

    Parameters
    ----------
    capture
        The sample.
    truth
        Of the sample, with what is printed.

    Returns
    -------
    The curves, and what is wrong with ``curves.npz``, in words. Where something is wrong, or there is no such file,
    the curves are those of the truth.

    Raises
    ------
    InputError
        If ``defects.json`` or ``curves.npz`` is damaged, or the latter is of other struts or views.
    """
    intervals = intervals_of(capture.root, truth.printed)
    u = np.linspace(0.0, 1.0, SAMPLES)
    inside = (u >= intervals[:, :1]) & (u <= intervals[:, 1:]) & (intervals[:, 1:] > intervals[:, :1])
    computed = TrueCurves(
        points=bezier.evaluate(truth.control_points, u),
        tangents=_unit(bezier.derivative(truth.control_points, u), truth.extent),
        radius=np.repeat(truth.radius[:, None], SAMPLES, axis=1),
        present=inside & truth.printed[:, None],
        intervals=intervals,
    )
    path = capture.root / FILE_NAME
    if not path.is_file():
        return computed, []
    noted = read_curves(path)
    check_belongs(noted, capture, truth, path)
    problems = [*_shape_problems(noted, computed), *_view_problems(noted, capture)]
    if problems:
        return computed, problems
    known = replace(
        computed,
        radius=noted.radius.astype(np.float64),
        present=noted.present,
        visible=noted.visible,
        depth=noted.depth.astype(np.float64),
    )
    return known, []


def _unit(velocity: np.ndarray, extent: float) -> np.ndarray:
    """Directions (..., 3) of velocities; zero where a curve in a frame of this extent stands still."""
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    return np.where(speed > 1e-6 * extent, velocity / np.where(speed > 0.0, speed, 1.0), 0.0)


def check_belongs(noted: CurveTruth, capture: Capture, truth: Wireframe, path: Path) -> None:
    """Refuse curves of other struts or views, which cannot be compared."""
    if noted.points.shape[:2] != (truth.strut_count, SAMPLES):
        found, wanted = noted.points.shape[:2], (truth.strut_count, SAMPLES)
        raise InputError.at(path, "points", f"are {found} struts and samples where {wanted} are needed", REMEDY)
    if list(noted.cameras) != [view.camera.name for view in capture.views]:
        raise InputError.at(path, "cameras", "are not those of transforms.json", REMEDY)


def _shape_problems(noted: CurveTruth, computed: TrueCurves) -> list[str]:
    """What disagrees with the truth."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    problems = []
    if not np.allclose(noted.parameters, u, rtol=0.0, atol=1e-12):
        problems.append(f"{FILE_NAME}: parameters are not even from 0 to 1")
    away = np.linalg.norm(noted.points - computed.points, axis=2)
    if not (away <= POINT_TOLERANCE).all():
        e = int(np.nanargmax(np.where(np.isnan(away), np.inf, away).max(axis=1)))
        problems.append(f"{FILE_NAME}: points of strut {e} lie {away[e].max():.3g} mm beside the curve of truth.json")
    moving = computed.tangents.any(axis=2)
    wrong = moving & ~(np.linalg.norm(noted.tangents - computed.tangents, axis=2) <= 1e-3)
    if wrong.any():
        problems.append(f"{FILE_NAME}: tangents of strut {_first(wrong)} are not those of truth.json")
    edges = np.abs(u[None, :, None] - computed.intervals[:, None, :]).min(axis=2) < 1e-6  # either answer will do
    wrong = (noted.present != computed.present) & ~edges
    if wrong.any():
        problems.append(f"{FILE_NAME}: present of strut {_first(wrong)} disagrees with frame.json and defects.json")
    return problems


def _view_problems(noted: CurveTruth, capture: Capture) -> list[str]:
    """What disagrees with the cameras, view by view."""
    problems = []
    for n, view in enumerate(capture.views):
        camera = view.camera
        # Of the stored points, so that a wrong projection is not confused with a wrong curve.
        pixels, depth = camera.project(noted.points.astype(np.float64))
        ahead = depth > 0.0
        away = np.linalg.norm(noted.pixels[n] - pixels, axis=2)
        # One ulp of single precision is 2e-4 of a pixel at 4,000 pixels.
        wrong = ahead & ~(away <= PIXEL_TOLERANCE)
        if wrong.any():
            e = _first(wrong)
            problems.append(
                f"{FILE_NAME}: pixels of strut {e} in {camera.name} are not where its camera sees the curve"
            )
        if not (np.abs(noted.depth[n] - depth) <= POINT_TOLERANCE + 1e-6 * np.abs(depth)).all():
            problems.append(f"{FILE_NAME}: depth in {camera.name} is not that along the viewing direction")
        length = np.linalg.norm(noted.pixel_tangents[n], axis=2)
        if not (ahead <= ((np.abs(length - 1.0) < 1e-3) | (length == 0.0))).all():
            problems.append(f"{FILE_NAME}: pixel_tangents in {camera.name} are not of unit length")
        x, y = np.moveaxis(noted.pixels[n], -1, 0)
        inside = ahead & (x >= 0.0) & (x <= camera.width) & (y >= 0.0) & (y <= camera.height)
        wrong = noted.visible[n] & ~(noted.present & inside)
        if wrong.any():
            e = _first(wrong)
            problems.append(f"{FILE_NAME}: strut {e} is said to be visible in {camera.name} where it is not")
    return problems


def _first(wrong: np.ndarray) -> int:
    """The first strut with a fault, from (E, S) bool."""
    return int(np.flatnonzero(wrong.any(axis=1))[0])
