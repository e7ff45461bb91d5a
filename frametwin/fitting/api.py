"""From a capture to a run: the twin of the whole frame and the deformation field."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from frametwin import __version__
from frametwin.cameras import Camera
from frametwin.capture.capture import Capture
from frametwin.errors import InputError
from frametwin.fields.base import DeformationField
from frametwin.fields.lattice import LatticeField, even_cells
from frametwin.fields.lattice_fit import fit_lattice
from frametwin.fields.store import load_field, save_field
from frametwin.files import PathLike, staged_directory
from frametwin.fitting import settings as splat_settings
from frametwin.fitting.fast import fit_fast
from frametwin.fitting.fast_settings import FastSettings
from frametwin.fitting.photo_fit import ROUNDS, fit_by_turns
from frametwin.formats import write_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.imaging.view_masks import Method, read_view_masks
from frametwin.progress import ProgressCallback
from frametwin.twin import twin as twin_files
from frametwin.twin.blending import blend
from frametwin.twin.twin import Twin

PRESETS: tuple[str, ...] = ("fast", *splat_settings.PRESETS)
FIELD_FILE = "field.safetensors"
FIELD_SAMPLES = 8
FIELD_MARGIN = 0.1
"""How far the field's box reaches beyond the frame's, as a share of the longest side."""


@dataclass(frozen=True, eq=False)
class FitResult:
    """A twin of the whole frame, in the frame's order, and the field that moved it."""

    twin: Twin
    field: DeformationField


@dataclass(frozen=True, eq=False)
class _Part:
    """What a preset found for the printed struts."""

    control_points: np.ndarray
    vertices: np.ndarray
    thickness: np.ndarray
    opacity: np.ndarray
    confidence: np.ndarray
    field: DeformationField
    loss: Sequence[float]
    timing: Mapping[str, float]


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
    masks = read_view_masks(capture, mask, ignore=ignore, progress=callback)
    read = perf_counter() - began

    def fit(cameras: list[Camera], pictures: list[np.ndarray], start: DeformationField | None) -> FitResult:
        return fit_views(
            capture.frame, cameras, pictures, preset, seed=seed, changes=changes, start=start, callback=callback
        )

    start = None if warm_start is None else read_field(warm_start)
    rounds = ROUNDS if preset == "fast" else 0  # the others cannot start from a twin
    result, _ = fit_by_turns(capture, masks, fit, start, rounds)
    twin = result.twin
    return FitResult(
        Twin(
            control_points=twin.control_points,
            vertices=twin.vertices,
            thickness=twin.thickness,
            opacity=twin.opacity,
            completeness=twin.completeness,
            confidence=twin.confidence,
            loss=twin.loss,
            timing={"read": read, **twin.timing, "total": perf_counter() - began},
            provenance={**twin.provenance, "inputs": input_hashes(capture)},
        ),
        result.field,
    )


def fit_views(
    frame: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    preset: str = "fast",
    *,
    seed: int = 0,
    changes: Mapping[str, Any] | None = None,
    start: DeformationField | None = None,
    callback: ProgressCallback | None = None,
) -> FitResult:
    """As `fit_capture`, from a frame, cameras without distortion and masks (H, W) in memory."""
    printed, struts, joints = frame.printed_part()
    settings = settings_of(preset, seed, changes)
    began = perf_counter()
    if isinstance(settings, FastSettings):
        part = _fit_fast(printed, cameras, masks, settings, start, callback)
    else:
        part = _fit_splats(printed, cameras, masks, settings, start, callback)
    vertices, control_points = _spread(frame, joints, part.vertices, struts, part.control_points)
    vertices, control_points = blend(frame, vertices, control_points, part.field.evaluate)
    kernels = part.thickness.shape[1]
    thickness = np.repeat(frame.radius[:, None], kernels, axis=1)
    thickness[struts] = part.thickness
    opacity = np.zeros((frame.strut_count, kernels))
    opacity[struts] = part.opacity
    confidence = np.zeros(frame.strut_count)
    confidence[struts] = part.confidence
    return FitResult(
        Twin(
            control_points=control_points,
            vertices=vertices,
            thickness=thickness,
            opacity=opacity,
            completeness=opacity.mean(axis=1),
            confidence=confidence,
            loss=part.loss,
            timing={**part.timing, "fit": perf_counter() - began},
            provenance={
                "frametwin": __version__,
                "preset": preset,
                "seed": seed,
                "changes": dict(changes or {}),
            },
        ),
        part.field,
    )


def settings_of(
    preset: str, seed: int = 0, changes: Mapping[str, Any] | None = None
) -> FastSettings | splat_settings.FitSettings:
    """Settings by the preset's name, with changes.

    Raises
    ------
    InputError
        If the preset or a setting is unknown or a value out of range.
    """
    wanted = dict(changes or {})
    if preset == "fast":
        return FastSettings(seed=seed).replace(**wanted)
    if preset not in PRESETS:
        raise InputError.at("settings", "preset", f"{preset!r} is unknown", f"give one of {', '.join(PRESETS)}")
    return splat_settings.preset(preset, **{"seed": seed, **wanted})


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


def _fit_fast(
    printed: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    settings: FastSettings,
    start: DeformationField | None,
    callback: ProgressCallback | None,
) -> _Part:
    warm = None if start is None else _moved_by(printed, start)
    found = fit_fast(printed, cameras, masks, settings, callback, warm)
    began = perf_counter()
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: other threads would only be in the way
        field = field_through(printed, found.control_points, settings.field_cells, found.confidence)
    return _Part(
        control_points=found.control_points,
        vertices=found.vertices,
        thickness=found.thickness,
        opacity=found.opacity,
        confidence=found.confidence,
        field=field,
        loss=found.loss_history,
        timing={**found.timing, "field": perf_counter() - began},
    )


def _fit_splats(
    printed: Wireframe,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    settings: splat_settings.FitSettings,
    start: DeformationField | None,
    callback: ProgressCallback | None,
) -> _Part:
    from frametwin.fitting.confidence import confidence
    from frametwin.fitting.elastic import ElasticFrame
    from frametwin.fitting.splat_fit import fit_splats
    from frametwin.raster.pyramid import Pyramid
    from frametwin.raster.rods import Rods, gauss_newton

    if start is not None:
        raise InputError.at(
            "settings",
            "warm start",
            f"the preset {settings.preset} starts at the plan",
            "use the preset fast",
        )
    found = fit_splats(printed, cameras, masks, settings, callback)
    vertices = np.array(printed.vertices)
    for side, corner in ((0, 0), (1, 3)):
        vertices[printed.edges[:, side]] = found.control_points[:, corner]
    planned = np.broadcast_to(printed.radius[:, None], found.thickness.shape)
    thickness = np.where(np.isnan(found.thickness), planned, found.thickness)
    opacity = _filled(found.opacity)
    drawn = Rods(found.control_points, vertices, printed.edges, np.array(planned), np.ones(planned.shape))
    terms = gauss_newton(drawn, Pyramid(cameras, masks).level(0.5, 0.7))
    return _Part(
        control_points=found.control_points,
        vertices=vertices,
        thickness=thickness,
        opacity=opacity,
        confidence=confidence(ElasticFrame(printed), terms),
        field=found.field,
        loss=found.loss_history,
        timing={},
    )


def _filled(opacity: np.ndarray) -> np.ndarray:
    """A table of equal width of struts with different numbers of kernels: each row stretched to the width."""
    count = np.sum(~np.isnan(opacity), axis=1)
    width = opacity.shape[1]
    column = (np.arange(width)[None, :] * count[:, None]) // width
    return np.take_along_axis(opacity, column, axis=1)


def field_through(
    frame: Wireframe, control_points: np.ndarray, cells: Sequence[int], weight: np.ndarray | None = None
) -> LatticeField:
    """The smooth field that moves a frame's curves to given ones, and everything between along with them.

    Parameters
    ----------
    frame
        The plan, of the struts that were fitted.
    control_points
        (E, 4, 3) where they are, mm.
    cells
        Cells of each level of the lattice, along the longest side of the box.
    weight
        (E,) say of each strut; struts that the views do not determine should have little.
    """
    u = np.linspace(0.0, 1.0, FIELD_SAMPLES + 1)
    points = bezier.evaluate(frame.control_points, u)
    shift = bezier.evaluate(control_points, u) - points
    low, high = frame.bounds
    margin = FIELD_MARGIN * frame.extent
    box = np.array([low - margin, high + margin])
    say = None if weight is None else np.repeat(np.maximum(weight, 1e-3), len(u))
    resolutions = [even_cells(box, count) for count in cells]
    return fit_lattice(points.reshape(-1, 3), shift.reshape(-1, 3), say, box, resolutions, bending=1e-7)


def _moved_by(frame: Wireframe, field: DeformationField) -> np.ndarray:
    """(E, 4, 3) control points of the frame, moved by a field (paper, Eq. 6 to 8)."""
    u = np.linspace(0.0, 1.0, FIELD_SAMPLES + 1)
    points = bezier.evaluate(frame.control_points, u)
    moved = points + field.evaluate(points.reshape(-1, 3)).reshape(points.shape)
    return np.einsum("cj,sjx->scx", bezier.refit_matrix(FIELD_SAMPLES), moved)


def _spread(
    frame: Wireframe, joints: np.ndarray, vertices: np.ndarray, struts: np.ndarray, curves: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Arrays of the whole frame with those of its printed part put in."""
    all_vertices, all_curves = np.array(frame.vertices), np.array(frame.control_points)
    all_vertices[joints] = vertices
    all_curves[struts] = curves
    return all_vertices, all_curves


def input_hashes(capture: Capture) -> dict[str, str]:
    """SHA-256 of every file that was read, by its name in the capture."""
    files = [capture.root / "frame.json", capture.root / "transforms.json"]
    files += [path for view in capture.views for path in (view.image, view.background) if path is not None]
    return {path.relative_to(capture.root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
