"""The worker's own jobs: simulate, fit, evaluate, adapt."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from frametwin.checked_json import convert_fields
from frametwin.errors import InputError
from frametwin.formats import find_frame, frame_json, write_frame
from frametwin.geometry.displacement import largest_displacement
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback
from frametwin.twin.blending import blend
from frametwin.twin.handing_over import handed_over
from frametwin.twin.runs import fit_summary, load_run, read_truth, require_free

if TYPE_CHECKING:
    from frametwin.imaging.view_masks import Method


def simulate(
    frame: str | dict[str, Any],
    settings: dict[str, Any] | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Deform a frame as a print sags; with ``out``, also take its silhouettes and write a capture folder.

    Parameters
    ----------
    frame
        A file, the name of one of the project's frames, or the content of a frame file.
    settings
        Fields of `frametwin.simulation.simulate.SimulationSettings` that shall differ from the usual ones.
    out, overwrite
        The capture folder, and whether it may be replaced if it is one.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out``; ``frame`` (its name), ``struts``, ``printed`` (how many are); ``views`` (0 without pictures);
    ``largest_displacement`` in mm; ``missing`` (indices of printed struts of which not all is there); and, in the
    frame's order, ``control_points`` (E, 4, 3) and ``vertices`` (V, 3) of the truth in mm, ``printed_struts`` (E,) and
    ``present`` (E, 2), the interval of the curve parameter at which each strut is there.
    """
    from frametwin.simulation.simulate import SimulationSettings, deform_print, write_simulation
    from frametwin.simulation.simulate import simulate as take

    checked = SimulationSettings(**convert_fields(SimulationSettings, settings or {}, "settings"))
    plan = frame_of(frame)
    if out is None:
        made = deform_print(plan, checked, progress)
    else:
        require_free(out, overwrite, "transforms.json")
        made = take(plan, checked, progress)
        write_simulation(out, made, overwrite)
    plan, truth, present = made.frame, made.truth, made.present
    printed = plan.printed
    return {
        "out": out,
        "frame": plan.name,
        "struts": plan.strut_count,
        "printed": int(printed.sum()),
        "views": 0 if out is None else checked.views,
        "largest_displacement": made.peak,
        "missing": np.flatnonzero(printed & (present != [0.0, 1.0]).any(axis=1)).tolist(),
        "control_points": truth.control_points,
        "vertices": truth.vertices,
        "printed_struts": printed,
        "present": present,
    }


def fit(
    capture: Path,
    out: Path,
    preset: str = "fast",
    seed: int = 0,
    changes: dict[str, Any] | None = None,
    warm_start: Path | None = None,
    mask: str = "auto",
    ignore: Path | None = None,
    overwrite: bool = False,
    hand_over: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Find the twin of a capture and write a run folder.

    Parameters
    ----------
    capture, out
        The folders.
    preset, seed, changes, warm_start, mask, ignore
        As in `frametwin.fitting.api.fit_capture`.
    overwrite
        Whether a run in ``out`` may be replaced.
    hand_over
        Whether the answer also holds the twin; see `frametwin.twin.handing_over`.
    progress
        See `ProgressCallback`.

    Returns
    -------
    ``out``, ``preset``, ``views``, ``frame``, ``struts``, ``printed``, ``missing`` and ``uncertain`` struts, ``loss``,
    ``seconds`` and ``timing``: what ``frametwin fit --json`` prints. The twin itself is read from the folder, or is
    under ``run``.
    """
    from frametwin.capture.capture import read_capture
    from frametwin.fitting.api import fit_capture, settings_of, write_run

    require_free(out, overwrite, "twin.json")
    kind = type(settings_of(preset, seed))
    checked = convert_fields(kind, changes or {}, "changes", without=("preset", "seed"))
    settings_of(preset, seed, checked)
    views = read_capture(capture)
    result = fit_capture(
        views,
        preset,
        seed=seed,
        changes=checked,
        warm_start=warm_start,
        mask=cast("Method", mask),
        ignore=ignore,
        callback=progress,
    )
    write_run(out, result, views, overwrite=overwrite)
    told = {"out": out, "preset": preset, "views": len(views.views), **fit_summary(result.twin, views.frame)}
    if hand_over:
        truth = None if views.truth is None else read_truth(capture, views.frame)
        told["run"] = handed_over(result.twin, views.frame, truth)
    return told


def evaluate(run: Path, truth: Path) -> dict[str, Any]:
    """Compare a run with the truth: a capture that has one, or a frame file.

    Returns
    -------
    What ``frametwin evaluate --json`` prints: errors in mm as mean, p95 and max for ``curves``, ``joints`` and
    ``equal_parameter``; lists of each strut's and joint's; and, where it is known which struts are missing, how well
    they were found.
    """
    from frametwin.evaluation.evaluate import evaluate as compare
    from frametwin.twin.findings import Detection, missing_struts

    twin, frame = load_run(run)
    real = read_truth(truth, frame)
    result = {"run": run, "truth": truth}
    result.update(compare(twin.curves, twin.vertices, real.frame, real.present).as_dict())
    if real.present is not None:
        found = Detection.of(missing_struts(twin, frame.printed), real.present, frame.printed)
        result["missing"] = found.as_dict()  # type: ignore[assignment]
    return result


def adapt(
    run: Path, frame: str | dict[str, Any] | None = None, out: Path | None = None, overwrite: bool = False
) -> dict[str, Any]:
    """Move the struts that are still to be printed so that they meet the twin.

    Parameters
    ----------
    run
        A run folder.
    frame
        The plan, if another than the run's shall be blended: of the same struts, with others to be printed.
    out, overwrite
        A frame file for the whole frame as it will be, and whether it may be replaced.

    Returns
    -------
    ``out``; ``struts`` (U,), the indices of those that are not printed; their control points ``before`` and ``after``
    (U, 4, 3) in mm; ``moved``, how many of them change; ``largest_displacement`` in mm; ``vertices`` (V, 3) of the
    whole frame after blending.
    """
    from frametwin.fitting.api import read_field

    twin, plan = load_run(run)
    if frame is not None:
        plan = frame_of(frame)
        twin.as_wireframe(plan)  # refuses a plan of another frame
    if out is not None and out.exists() and not overwrite:
        raise InputError.at(out, "file", "exists already", "choose another name, or allow overwriting")
    vertices, curves = blend(plan, twin.vertices, twin.control_points, read_field(run).evaluate)
    if out is not None:
        write_frame(out, plan.replace(vertices=vertices, control_points=curves))
    struts = np.flatnonzero(~plan.printed)
    before, after = plan.control_points[struts], curves[struts]
    return {
        "out": out,
        "struts": struts,
        "before": before,
        "after": after,
        "moved": int((after != before).any(axis=(1, 2)).sum()),
        "largest_displacement": largest_displacement(after - before),
        "vertices": vertices,
    }


def frame_of(value: str | dict[str, Any]) -> Wireframe:
    """The frame that a request names or holds.

    Raises
    ------
    InputError
        If there is none, or it is not usable.
    """
    if isinstance(value, dict):
        return frame_json.parse({"name": "frame", **value}, "frame of the request")
    return find_frame(value)
