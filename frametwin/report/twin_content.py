"""What a report tells of one twin: its scene, its verdict, its views and its worst struts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from frametwin.capture.capture import Capture
from frametwin.evaluation.evaluate import Errors, evaluate
from frametwin.fitting.camera_corrections import as_found
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback
from frametwin.report.pictures import crop_content, read_views, view_content
from frametwin.report.scene import Scene, floats
from frametwin.twin.runs import Truth
from frametwin.twin.twin import Twin

WORST = 12
"""Struts that are listed as the worst."""

CROPPED = 6
"""Of them, how many are shown in the photographs."""


def errors_of(twin: Twin, truth: Truth | None) -> Errors | None:
    """Errors of a twin where the truth is known."""
    return None if truth is None else evaluate(twin.curves, twin.vertices, truth.frame, truth.present)


def twin_content(
    scene: Scene,
    twin: Twin,
    errors: Errors | None = None,
    truth: Wireframe | None = None,
    *,
    with_plan: bool = True,
) -> dict[str, Any]:
    """A twin without its pictures, as for the page."""
    told: dict[str, Any] = {
        **scene.content(with_plan=with_plan),
        "verdict": _verdict(twin),
        "cameras": [dict(camera) for camera in twin.cameras],
        "loss": [float(f"{value:.4g}") for value in twin.loss],
        "seconds": _seconds(twin),
        "worst": scene.ranking[:WORST].tolist(),
        "views": [dict(view) for view in twin.views],
    }
    if errors is not None:
        told["errors"] = errors.summary()
    if truth is not None:
        told["truth"] = floats(truth.control_points[scene.plan.printed])
    return told


def add_pictures(
    told: dict[str, Any],
    scene: Scene,
    capture: Capture,
    width: int,
    *,
    crops: bool,
    progress: ProgressCallback | None = None,
) -> None:
    """Add the photographs of a capture to what is told of its twin.

    Parameters
    ----------
    told
        See `twin_content`; changed.
    scene
        Of the twin.
    capture
        With the pictures.
    width
        Of a view at the most, pixels.
    crops
        Whether the worst struts are shown too.
    progress
        See `ProgressCallback`.
    """
    views = read_views(capture, progress)
    found = as_found([view.camera for view in views], told["cameras"])  # so that outlines lie where the fit saw them
    views = [replace(view, camera=camera) for view, camera in zip(views, found, strict=True)]
    printed = np.flatnonzero(scene.plan.printed)
    known = {view["name"]: view for view in told["views"] if isinstance(view.get("name"), str)}
    pictures = view_content(views, scene.curves[printed], width)
    told["views"] = [
        {**known.get(view.camera.name, {}), "name": view.camera.name, **picture}
        for view, picture in zip(views, pictures, strict=True)
    ]
    if crops:
        used = [i for i, view in enumerate(told["views"]) if view.get("used", True)]
        told["crops"] = _crops([views[i] for i in used], used, scene, told["worst"][:CROPPED])


def _crops(views: list[Any], numbers: Sequence[int], scene: Scene, worst: Sequence[int]) -> dict[str, list[Any]]:
    """Cut-outs of the worst struts; they name views by their number among all."""
    printed = np.flatnonzero(scene.plan.printed)
    place = {int(strut): i for i, strut in enumerate(printed)}
    found = crop_content(views, scene.curves[printed], [place[strut] for strut in worst])
    return {
        str(int(printed[int(i)])): [{**crop, "view": numbers[crop["view"]]} for crop in crops]
        for i, crops in found.items()
    }


def _verdict(twin: Twin) -> dict[str, Any] | None:
    """Nothing where the file had none and the twin's is what is taken by default: version 1 has neither."""
    if not twin.views and not twin.verdict.reasons and twin.sigma_across is None:
        return None
    return {"status": twin.verdict.status, "reasons": list(twin.verdict.reasons)}


def _seconds(twin: Twin) -> float | None:
    total = twin.timing.get("total")
    return float(total) if isinstance(total, int | float) else None
