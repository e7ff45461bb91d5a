"""What the page of a dataset shows of one sample: a row of figures, small pictures, and the curves to be drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from frametwin.cameras import Camera
from frametwin.capture.capture import Capture, View, read_capture
from frametwin.capture.strut_mesh import sub_curves
from frametwin.dataset.fits import figures_of, judge
from frametwin.dataset.folder import Sample, SampleEntry, read_sample
from frametwin.dataset.true_curves import intervals_of
from frametwin.errors import FrameTwinError
from frametwin.evaluation.evaluate import Errors
from frametwin.imaging.contact_sheet import line_width
from frametwin.imaging.encoding import jpeg
from frametwin.imaging.masks import read_masks
from frametwin.imaging.overlay import Layer, draw_view, layers_of
from frametwin.twin.findings import Detection
from frametwin.twin.twin import FILE_NAME as TWIN_FILE
from frametwin.twin.twin import Twin, read_twin

PICTURE = "{}.jpg"
HEIGHT = 280
"""Of the small pictures, in pixels; their width follows the frame's shape."""

FINER = 2
"""They are drawn this many times larger and then reduced, which gives thinner lines."""

ASPECTS = (0.6, 1.8)
"""Least and greatest width of a small picture, as a share of its height."""

QUALITY = 88
DIGITS = 3
"""Decimals of mm in what the browser draws."""


@dataclass(frozen=True, eq=False)
class SampleView:
    """A sample as it is shown.

    Attributes
    ----------
    row : what the list says of it, as for a JSON file.
    detail : what the detail view draws and says, as for a JSON file.
    pictures : a JPEG file for each view.
    """

    row: dict[str, Any]
    detail: dict[str, Any]
    pictures: list[bytes]


@dataclass(frozen=True, eq=False)
class _Fit:
    """The twin of a sample and its errors, or why there is none that can be shown."""

    twin: Twin | None = None
    errors: Errors | None = None
    detection: Detection | None = None
    problem: str | None = None


def view_sample(entry: SampleEntry, run: Path) -> SampleView:
    """Draw a sample.

    Parameters
    ----------
    entry
        The sample.
    run
        The folder of its run, which need not exist. A run of other pictures than the sample's is not shown.

    Raises
    ------
    InputError
        If the sample is damaged.
    """
    sample = read_sample(entry.folder)
    capture = read_capture(entry.folder)
    present = intervals_of(capture.root, capture.frame.printed)
    fit = _read_fit(sample, capture, run)
    layers = _layers(capture, present, fit.twin)
    size = (HEIGHT, round(HEIGHT * _aspect(capture, layers)))
    fine = (FINER * size[0], FINER * size[1])
    masks = read_masks(capture)
    pictures = []
    for view, mask in zip(capture.views, masks, strict=True):
        camera = view.camera.without_distortion()
        picture = draw_view(camera, mask, layers, size=fine, width=line_width(camera, layers, fine))
        small = cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA)
        pictures.append(jpeg(small[..., ::-1], QUALITY))
    row = _row(sample, capture, present, fit) | {"size": [size[1], size[0]]}
    return SampleView(row, _detail(sample, capture, present, fit), pictures)


def _read_fit(sample: Sample, capture: Capture, run: Path) -> _Fit:
    if not (run / TWIN_FILE).is_file():
        return _Fit()
    try:
        twin = read_twin(run)
        twin.as_wireframe(capture.frame)
        inputs = twin.provenance.get("inputs", {})
        if any(name in sample.files and sample.files[name].sha256 != digest for name, digest in inputs.items()):
            return _Fit(problem="The run was made from other pictures; fit the dataset again.")
        errors, detection = judge(capture, twin)
    except FrameTwinError as error:
        return _Fit(problem=str(error))
    return _Fit(twin, errors, detection)


def _layers(capture: Capture, present: np.ndarray, twin: Twin | None) -> tuple[Layer, ...]:
    """The printed struts; of the truth, what is there."""
    printed = capture.frame.printed
    there = present[:, 1] > present[:, 0]
    truth = None if capture.truth is None else sub_curves(capture.truth.control_points[there], present[there])
    return layers_of(capture.frame.control_points[printed], truth, None if twin is None else twin.curves[printed])


def _aspect(capture: Capture, layers: tuple[Layer, ...]) -> float:
    """Width over height of the frame, as it is usually seen."""
    points = np.concatenate([layer.control_points.reshape(-1, 3) for layer in layers])
    ratios = []
    for view in capture.views:
        pixels, depth = view.camera.project(points, distort=False)
        width, height = np.ptp(pixels[depth > 0.0], axis=0)
        ratios.append(width / max(height, 1.0))
    return float(np.clip(np.median(ratios), *ASPECTS))


def _row(sample: Sample, capture: Capture, present: np.ndarray, fit: _Fit) -> dict[str, Any]:
    frame = capture.frame
    figures = None
    if fit.twin is not None and fit.errors is not None and fit.detection is not None:
        figures = figures_of(fit.errors, fit.detection) | {"seconds": float(fit.twin.timing.get("total", 0.0))}
    return {
        "index": sample.index,
        "frame": frame.name,
        "struts": frame.strut_count,
        "printed": int(frame.printed.sum()),
        "views": len(capture.views),
        "missing": len(_defects(present, frame.printed)),
        "moved": _moved(capture),
        "figures": figures,
        "error": fit.problem,
        "words": " ".join([frame.name, *_words(sample.specification)]),
    }


def _moved(capture: Capture) -> float | None:
    """Largest displacement of a control point of a printed strut, mm."""
    if capture.truth is None:
        return None
    away = np.linalg.norm(capture.truth.control_points - capture.frame.control_points, axis=2)
    return float(away[capture.frame.printed].max())


def _defects(present: np.ndarray, printed: np.ndarray) -> list[int]:
    return np.flatnonzero(printed & ((present[:, 0] > 0.0) | (present[:, 1] < 1.0))).tolist()


def _words(specification: Mapping[str, Any]) -> list[str]:
    """Texts of a specification by which samples may be found; hashes are none."""
    found = []
    for name, value in specification.items():
        if isinstance(value, Mapping):
            found += _words(value)
        elif isinstance(value, str) and not name.endswith("sha256"):
            found.append(value)
    return found


def _detail(sample: Sample, capture: Capture, present: np.ndarray, fit: _Fit) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "index": sample.index,
        "views": [_camera(view, capture.root) for view in capture.views],
        "printed": capture.frame.printed.astype(int).tolist(),
        "present": {str(e): np.round(present[e], 4).tolist() for e in _defects(present, capture.frame.printed)},
        "curves": {"plan": _rounded(capture.frame.control_points)},
        "specification": dict(sample.specification),
        "made_with": dict(sample.made_with),
        "content": sample.content,
        "problem": fit.problem,
    }
    if capture.truth is not None:
        shown["curves"]["truth"] = _rounded(capture.truth.control_points)
    if fit.twin is not None and fit.errors is not None and fit.detection is not None:
        shown["curves"]["twin"] = _rounded(fit.twin.curves)
        shown["errors"] = fit.errors.summary()
        shown["detection"] = fit.detection.as_dict()
        shown["struts"] = {
            "mean": _numbers(fit.errors.strut_mean),
            "max": _numbers(fit.errors.strut_max),
            "completeness": _numbers(fit.twin.completeness),
            "confidence": _numbers(fit.twin.confidence),
        }
        shown["preset"] = fit.twin.provenance.get("preset")
    return shown


def _camera(view: View, root: Path) -> dict[str, Any]:
    """A view, for the browser: its picture below the sample, and the camera with its matrix world to camera."""
    camera: Camera = view.camera
    return {
        "name": camera.name,
        "image": view.image.path.relative_to(root).as_posix(),
        "background": None if view.background is None else view.background.path.relative_to(root).as_posix(),
        "size": [camera.width, camera.height],
        "k": [camera.fl_x, camera.fl_y, camera.cx, camera.cy],
        "m": camera.world_to_camera[:3].ravel().tolist(),
        "d": camera.distortion.tolist() if camera.has_distortion else None,
    }


def _rounded(control_points: np.ndarray) -> list[float]:
    """Control points (E, n + 1, 3) one after the other."""
    return np.round(control_points, DIGITS).ravel().tolist()


def _numbers(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(value) else round(value, 4) for value in values.tolist()]
