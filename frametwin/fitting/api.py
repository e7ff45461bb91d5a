"""From a capture to a run: the twin of the whole frame and the deformation field."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from frametwin import __version__
from frametwin.cameras import Camera
from frametwin.capture.capture import Capture
from frametwin.errors import InputError
from frametwin.fields.base import DeformationField
from frametwin.fields.store import load_field, save_field
from frametwin.files import PathLike, staged_directory
from frametwin.fitting.camera_corrections import as_records
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.judgement import judged_on_photographs, verdict
from frametwin.fitting.known_start import KnownStart
from frametwin.fitting.part_fit import KernelCloud, PartFit
from frametwin.fitting.photo_fit import (
    ROUNDS,
    fit_by_turns,
    outline_doubt,
    outline_error,
    shows_photographs,
    typical_correction,
    typical_softness,
)
from frametwin.fitting.plate_cameras import through_plate
from frametwin.fitting.presets import PRESETS, fitter_of, settings_of
from frametwin.formats import write_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.photo_masks import ViewMask
from frametwin.imaging.view_masks import Method, read_view_masks
from frametwin.progress import ProgressCallback
from frametwin.twin import twin as twin_files
from frametwin.twin.blending import blend
from frametwin.twin.twin import Twin

__all__ = ["PRESETS", "FitResult", "fit_capture", "fit_views", "read_field", "settings_of", "write_run"]

FIELD_FILE = "field.safetensors"


@dataclass(frozen=True, eq=False)
class FitResult:
    """A twin of the whole frame, in the frame's order, the field that moved it, and kernels that lie on no curve."""

    twin: Twin
    field: DeformationField
    cloud: KernelCloud | None = None

    def with_twin(self, **changes: Any) -> FitResult:
        """The same with other values in some fields of the twin; see `Twin.replace`."""
        return replace(self, twin=self.twin.replace(**changes))


def fit_capture(
    capture: Capture,
    preset: str = "fast",
    *,
    seed: int = 0,
    changes: Mapping[str, Any] | None = None,
    warm_start: PathLike | None = None,
    mask: Method = "auto",
    ignore: PathLike | None = None,
    callback: ProgressCallback | None = None,
) -> FitResult:
    """Find the digital twin of a capture.

    Parameters
    ----------
    capture
        See `frametwin.capture.capture.read_capture`.
    preset
        One of `PRESETS`.
    seed
        Of whatever the preset draws at random; ``fast`` draws nothing.
    changes
        Settings that shall differ from the preset's.
    warm_start
        A run folder or field file of an earlier fit of the same frame, from which to start.
    mask, ignore
        What becomes of photographs; see `frametwin.imaging.view_masks.read_view_masks`.
    callback
        Told of every step; can stop the fit.

    Raises
    ------
    InputError
        If the pictures, a setting or the earlier run are not usable.
    Cancelled
        If the callback stops the fit.
    """
    began = perf_counter()
    settings = settings_of(preset, seed, changes)
    placed = None
    if isinstance(settings, FastSettings) and settings.cameras != "exact":  # the others take cameras as they are given
        placed = through_plate(capture, settings.rig_errors, callback)
        capture = placed.capture
    masks = read_view_masks(capture, mask, ignore=ignore, progress=callback)
    read = perf_counter() - began
    asked = dict(changes or {})
    if isinstance(settings, FastSettings):
        asked = {"outline_error": outline_error(masks), **asked}

    def fit(
        cameras: list[Camera], pictures: list[np.ndarray], start: DeformationField | None, exact: bool
    ) -> FitResult:
        wanted = {**asked, "cameras": "exact"} if exact else asked
        result = fit_views(
            capture.frame, cameras, pictures, preset, seed=seed, changes=wanted, start=start, callback=callback
        )
        return result.with_twin(provenance={**result.twin.provenance, "changes": dict(changes or {})})

    start = None if warm_start is None else read_field(warm_start)
    rounds = ROUNDS if preset == "fast" else 0  # the others cannot start from a twin
    looked = fit_by_turns(capture, masks, fit, start, rounds)
    result = looked.result
    twin = _with_views_unread(result.twin, capture, looked.masks)
    if shows_photographs(looked.masks) and twin.sigma_across is not None:
        part = capture.frame.printed
        loose = float(np.median((twin.sigma_across / capture.frame.radius)[part])) if part.any() else 0.0
        soft = typical_softness(looked.masks)
        judged = judged_on_photographs(twin.verdict, loose, looked.moved, typical_correction(twin), soft)
        twin = _with_doubt_of_masks(twin.replace(verdict=judged), capture, outline_doubt(looked.masks))
    if placed is not None:
        twin = placed.told(twin)
    timing = {"read": read, **twin.timing, "total": perf_counter() - began}
    provenance = {**twin.provenance, "inputs": capture.hashes}
    return replace(result, twin=twin.replace(timing=timing, provenance=provenance))


def _with_doubt_of_masks(twin: Twin, capture: Capture, outline: float) -> Twin:
    """The twin of photographs, whose standard deviations also hold how well their masks have the struts' outlines."""
    middle = capture.frame.bounds.mean(axis=0)
    scales = [view.camera.fl_x / np.linalg.norm(middle - view.camera.centre) for view in capture.views]
    doubt = outline / float(np.median(scales))
    wider = {name: getattr(twin, name) for name in ("sigma_across", "sigma_along")}
    return twin.replace(**{name: np.hypot(sigma, doubt) for name, sigma in wider.items() if sigma is not None})


def _with_views_unread(twin: Twin, capture: Capture, masks: Sequence[ViewMask]) -> Twin:
    """The twin that also tells of views whose pictures could not be used at all."""
    unread = [(view.camera.name, mask) for view, mask in zip(capture.views, masks, strict=True) if not mask.used]
    if not unread:
        return twin
    views = [{"name": name, "used": False, "unexplained": 1.0, "unseen": 1.0} for name, _ in unread]
    told = [f"view {name} {mask.reason} and was left out: {mask.remedy}" for name, mask in unread]
    judged = twin.verdict
    return twin.replace(
        views=[*twin.views, *views], verdict=dataclasses.replace(judged, reasons=(*judged.reasons, *told))
    )


def fit_views(
    frame: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    preset: str = "fast",
    *,
    seed: int = 0,
    changes: Mapping[str, Any] | None = None,
    start: DeformationField | KnownStart | None = None,
    callback: ProgressCallback | None = None,
) -> FitResult:
    """As `fit_capture`, from a frame, cameras without distortion and masks (H, W) in memory."""
    fitter = fitter_of(preset, seed, changes)
    _check_views(cameras, masks)
    began = perf_counter()
    printed, struts, joints = frame.printed_part()
    part = fitter.fit(printed, cameras, masks, start, callback)
    twin = whole_twin(frame, struts, joints, part)
    twin = twin.replace(**_views_and_verdict(part, printed, cameras, struts))
    provenance = {"frametwin": __version__, "preset": preset, "seed": seed, "changes": dict(changes or {})}
    timing = {**part.timing, "fit": perf_counter() - began}
    return FitResult(twin.replace(timing=timing, provenance=provenance), part.field, part.cloud)


def _check_views(cameras: Sequence[Camera], masks: Sequence[np.ndarray]) -> None:
    """Refuse pictures and cameras that do not belong together."""
    if not cameras or len(cameras) != len(masks):
        problem = f"there are {len(masks)} pictures for {len(cameras)} cameras"
        raise InputError.at("capture", "views", problem, "give one picture for each camera, and at least one")
    for camera, mask in zip(cameras, masks, strict=True):
        if camera.has_distortion:
            raise InputError.at(camera.name, "distortion", "is not zero", "undistort the picture and its camera first")
        if np.shape(mask) != (camera.height, camera.width):
            problem = f"the picture is {np.shape(mask)} where the camera has {(camera.height, camera.width)}"
            raise InputError.at(camera.name, "size", problem, "give the picture that belongs to the camera")


def whole_twin(frame: Wireframe, struts: np.ndarray, joints: np.ndarray, part: PartFit) -> Twin:
    """The twin of a frame, of which the given struts and joints were fitted, the others blended to meet them."""
    vertices, control_points = np.array(frame.vertices), np.array(frame.control_points)
    vertices[joints], control_points[struts] = part.vertices, part.control_points
    vertices, control_points = blend(frame, vertices, control_points, part.field.evaluate)
    control_points[struts] = part.control_points  # torn ends are not drawn back to their joints
    thickness = np.repeat(frame.radius[:, None], part.thickness.shape[1], axis=1)
    thickness[struts] = part.thickness
    opacity = np.zeros_like(thickness)
    opacity[struts] = part.opacity
    confidence = np.zeros(frame.strut_count)
    confidence[struts] = part.confidence
    unseen = frame.extent  # of struts that are not printed nobody knows anything
    return Twin(
        control_points=control_points,
        vertices=vertices,
        thickness=thickness,
        opacity=opacity,
        completeness=opacity.mean(axis=1),
        confidence=confidence,
        joint_radius=_spread(part.joint_radius, joints, frame.vertex_count, 0.0),
        sigma_across=_spread(part.sigma_across, struts, frame.strut_count, unseen),
        sigma_along=_spread(part.sigma_along, struts, frame.strut_count, unseen),
        attached=_spread(part.attached, struts, frame.strut_count, True),
        gap=_spread(part.gap, struts, frame.strut_count, 0.0),
        bent={int(struts[strut]): curve for strut, curve in part.bent.items()},
        loss=part.loss,
    )


def _spread(values: np.ndarray | None, where: np.ndarray, count: int, elsewhere: float | bool) -> np.ndarray | None:
    """Values of what was fitted among those of the whole frame, of which the rest was not seen."""
    if values is None:
        return None
    result = np.full((count, *values.shape[1:]), elsewhere)
    result[where] = values
    return result


def _views_and_verdict(
    part: PartFit, printed: Wireframe, cameras: Sequence[Camera], struts: np.ndarray
) -> dict[str, Any]:
    """What was made of the views, as for a twin's file."""
    if part.views is None:
        return {}
    found = part.views
    views = [
        {"name": camera.name, "used": bool(used), "unexplained": float(unexplained), "unseen": float(unseen)}
        for camera, used, unexplained, unseen in zip(cameras, found.used, found.unexplained, found.unseen, strict=True)
    ]
    corrections = as_records(found, cameras)
    return {"views": views, "cameras": corrections, "verdict": verdict(part, printed, cameras, struts)}


def read_field(path: PathLike) -> DeformationField:
    """The field of a run folder, or of a field file itself."""
    path = Path(path)
    return load_field(path / FIELD_FILE if path.is_dir() else path)


def write_run(folder: PathLike, result: FitResult, capture: Capture, overwrite: bool = False) -> None:
    """Write a run folder, whole or not at all: the twin, its field and the plan.

    Raises
    ------
    InputError
        If the folder holds something already and ``overwrite`` is not set.
    """
    with staged_directory(folder, overwrite=overwrite) as stage:
        twin_files.write_twin(stage, result.twin)
        save_field(stage / FIELD_FILE, result.field)
        write_frame(stage / "frame.json", capture.frame)
