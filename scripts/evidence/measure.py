"""What is measured of a case, in a process of its own: numbers, as for a JSON file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from frametwin.cameras import Camera
from frametwin.cameras.rigs import box_around, ring_rig
from frametwin.evaluation.curve_distance import CurveSet
from frametwin.evaluation.evaluate import evaluate
from frametwin.fields.base import DeformationField
from frametwin.fitting.api import FitResult, fit_views
from frametwin.fitting.part_fit import KernelCloud
from frametwin.geometry import bezier
from frametwin.geometry.parametric import named_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.job.plan_job import PlanOptions
from frametwin.printing.simulation.simulate import SimulationOptions, simulate_print
from frametwin.printing.simulation.simulated_pictures import SimulatedRig
from frametwin.progress import ProgressCallback
from frametwin.raster.silhouette import silhouettes
from frametwin.scratch import scratch_folder
from frametwin.simulation.simulate import Simulation, SimulationSettings, simulate
from frametwin.twin.twin import Twin
from scripts.evidence.cases import WAYS, Case
from scripts.evidence.records import BINS
from scripts.evidence.scenes import cube_with_one_bent_strut, masks_of, peak_megabytes, uppermost, whole_frame

FAINT = 0.05
"""Kernels of a lower opacity do not count as seen."""

GONE = 0.5
"""Kernels of a lower opacity are left out, as in the paper's figure."""


def measured(case: Case, progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Run a case.

    Raises
    ------
    InputError
        If a frame or a setting is not usable.
    Cancelled
        If the callback stops it.
    """
    return _KINDS[case.kind](case, progress)


def _fit(case: Case, progress: ProgressCallback | None) -> dict[str, Any]:
    _load_compiled_kernels(case.preset)
    simulation = dict(case.simulation)
    if "size" in simulation:
        simulation["size"] = tuple(simulation["size"])  # which files have as a list
    frame, part = whole_frame(Path(case.frame)), simulation.pop("uppermost", None)
    frame = frame if part is None else uppermost(frame, part)
    capture = simulate(frame, SimulationSettings(**simulation))
    masks = masks_of(capture)
    began = perf_counter()
    result = fit_views(capture.frame, capture.cameras, masks, case.preset, changes=case.changes, callback=progress)
    seconds = perf_counter() - began
    twin = result.twin
    errors = evaluate(twin.curves, twin.vertices, capture.truth, capture.present)
    before = evaluate(capture.frame.control_points, capture.frame.vertices, capture.truth, capture.present)
    return {
        "struts": capture.frame.strut_count,
        "printed": int(capture.frame.printed.sum()),
        "seconds": round(seconds, 2),
        "megabytes": round(peak_megabytes()),
        "before": before.summary(),
        "after": errors.summary(),
        "histogram": _histogram(errors.strut_mean),
        "loss": [float(f"{loss:.5g}") for loss in twin.loss],
        **_kernels(result.cloud, capture),
        **_missing(twin, capture),
        **_unprinted(result, capture.frame),
    }


def _kernels(cloud: KernelCloud | None, capture: Simulation) -> dict[str, Any]:
    """How far kernels that lie on no curve are from the truth, those that are seen at all."""
    if cloud is None:
        return {}
    shown = cloud.opacity >= FAINT
    away = CurveSet.build(capture.truth.control_points, capture.present).distances(cloud.means[shown])
    return {"kernels": {"shown": float(shown.mean()), "mean": float(away.mean()), "max": float(away.max())}}


def _load_compiled_kernels(preset: str) -> None:
    """A small fit first, so that seconds are those of the fit."""
    small = simulate(named_frame("bridge"), SimulationSettings(views=2, size=(120, 160)))
    changes = {} if preset == "fast" else {"iterations": 1, "samples": 4}
    fit_views(small.frame, small.cameras, masks_of(small), preset, changes=changes)


def _histogram(strut_mean: np.ndarray) -> list[int]:
    """(len(BINS),) how many struts have a mean error in each class."""
    values = strut_mean[np.isfinite(strut_mean)]
    return np.histogram(values, [*BINS, np.inf])[0].tolist()


def _missing(twin: Twin, capture: Simulation) -> dict[str, Any]:
    """How much of the struts the kernels show that are not to be filtered out, where struts are missing."""
    there = capture.present[:, 1] - capture.present[:, 0]
    broken = capture.frame.printed & (there < 1.0)
    if not broken.any():
        return {}
    shown = (twin.opacity >= GONE).mean(axis=1)
    whole = capture.frame.printed & ~broken
    return {
        "missing": {
            "struts": int(broken.sum()),
            "there": float(there[broken].mean()),
            "shown": float(shown[broken].mean()),
            "shown_of_others": float(shown[whole].mean()),
        }
    }


def _unprinted(result: FitResult, frame: Wireframe) -> dict[str, Any]:
    """What the field does to struts that nobody has seen yet."""
    coming = ~frame.printed
    return {"unprinted": roughness(result.field, frame.control_points[coming])} if coming.any() else {}


def roughness(field: DeformationField, control_points: np.ndarray) -> dict[str, float]:
    """How unevenly a field moves struts.

    Parameters
    ----------
    field : DeformationField
        In mm.
    control_points : (E, 4, 3) array, mm
        The struts as planned.

    Returns
    -------
    dict
        ``stretch``: root mean square of the relative change of length of the sixteenths of the struts; ``laplacian``:
        root mean square of the field's vector Laplacian in 1 / m.
    """
    points = bezier.evaluate(control_points, np.linspace(0.0, 1.0, 17))  # (E, 17, 3)
    moved = points + field.evaluate(points.reshape(-1, 3)).reshape(points.shape)
    lengths = [np.linalg.norm(np.diff(one, axis=1), axis=2) for one in (points, moved)]
    bend = field.laplacian(points.reshape(-1, 3))
    return {
        "stretch": float(np.sqrt(np.mean((lengths[1] / lengths[0] - 1.0) ** 2))),
        "laplacian": float(1e3 * np.sqrt((bend**2).sum(axis=1).mean())),
    }


def _cube(case: Case, progress: ProgressCallback | None) -> dict[str, Any]:
    plan, truth = cube_with_one_bent_strut()
    seen = list(ring_rig(box_around(plan, truth), 8))
    new = list(ring_rig(box_around(plan, truth), 16, elevation_deg=(30.0, 60.0)))[1::2]  # between them, and from above
    masks = [picture / np.float32(255) for picture in silhouettes(truth, seen, progress=progress)]
    result = fit_views(plan, seen, masks, case.preset, changes=case.changes, callback=progress)
    twin = result.twin
    shown = twin.as_wireframe(plan) if result.cloud is None else result.cloud
    return {
        "struts": plan.strut_count,
        "after": evaluate(twin.curves, twin.vertices, truth).summary(),
        "unlike": {"input": unlike(shown, truth, seen), "new": unlike(shown, truth, new)},
    }


def unlike(one: Wireframe | KernelCloud, other: Wireframe, cameras: Sequence[Camera]) -> float:
    """Share of the pixels of either silhouette that are not in both: 1 - intersection / union, over all views.

    Free kernels are shown by themselves, as the paper shows them; their silhouette is where they cover half a pixel.
    """
    first = np.stack(silhouettes(one, cameras) if isinstance(one, Wireframe) else pictures_of(one, cameras)) > 127
    second = np.stack(silhouettes(other, cameras)) > 127
    return float(1.0 - (first & second).sum() / (first | second).sum())


def pictures_of(cloud: KernelCloud, cameras: Sequence[Camera]) -> list[np.ndarray]:
    """(H, W) pictures, 0..255, of kernels."""
    import torch

    from frametwin.raster.projection import Views, low_pass, project_covariances
    from frametwin.raster.splat import splat_flat

    means, covariances, opacity = (torch.from_numpy(v) for v in (cloud.means, cloud.covariances, cloud.opacity))
    views = Views.of(cameras)
    seen = splat_flat(*low_pass(project_covariances(means, covariances, views), opacity), views.sizes)
    parts = seen.split([height * width for height, width in views.sizes])
    return [255.0 * part.view(size).numpy() for part, size in zip(parts, views.sizes, strict=True)]


def _print(case: Case, progress: ProgressCallback | None) -> dict[str, Any]:
    frame = whole_frame(Path(case.frame))
    frame = frame.replace(batch=np.zeros(frame.strut_count, dtype=np.int64))  # the order is ours to plan
    plan = PlanOptions(**WAYS[case.preset], allow_contact=True, formats=("json",))
    options = SimulationOptions(plan=plan, rig=SimulatedRig(size=(600, 800)))
    with scratch_folder() as folder:
        return simulate_print(folder / "job", frame, options, progress=progress).as_dict()


_KINDS: dict[str, Callable[[Case, ProgressCallback | None], dict[str, Any]]] = {
    "fit": _fit,
    "cube": _cube,
    "print": _print,
}
