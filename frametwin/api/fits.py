"""Fits: find a twin, keep it in a folder, and say how far it is from the truth."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from frametwin.capture.capture import Capture, read_capture
from frametwin.files import PathLike
from frametwin.formats import read_frame
from frametwin.geometry.wireframe import Wireframe
from frametwin.progress import ProgressCallback
from frametwin.twin.runs import Truth, load_run, read_truth
from frametwin.twin.twin import Twin

if TYPE_CHECKING:
    from frametwin.evaluation.evaluate import Errors
    from frametwin.fields.base import DeformationField
    from frametwin.fitting.api import FitResult
    from frametwin.simulation.simulate import Simulation


@dataclass(frozen=True, eq=False)
class Run:
    """What a fit left in a folder.

    Attributes
    ----------
    folder : Path
        The run folder.
    twin : Twin
        The digital twin.
    frame : Wireframe
        The plan that it is a twin of.
    """

    folder: Path
    twin: Twin
    frame: Wireframe

    @cached_property
    def field(self) -> DeformationField:
        """The deformation field, read when it is first asked for.

        Raises
        ------
        InputError
            If its file is missing or damaged.
        """
        from frametwin.fitting.api import read_field

        return read_field(self.folder)


def read_run(folder: PathLike) -> Run:
    """Read a run folder.

    Parameters
    ----------
    folder : path
        As written by `write_run` or by ``frametwin fit``; or the ``twin.json`` in it.

    Returns
    -------
    Run
        The twin, its plan, and on demand the deformation field.

    Raises
    ------
    InputError
        If a file is missing or damaged, or twin and plan do not belong together.
    """
    path = Path(folder)
    twin, frame = load_run(path)
    return Run(path if path.is_dir() else path.parent, twin, frame)


def fit(
    capture: PathLike | Capture | Simulation,
    preset: str = "fast",
    *,
    seed: int = 0,
    changes: Mapping[str, Any] | None = None,
    warm_start: PathLike | None = None,
    progress: ProgressCallback | None = None,
) -> FitResult:
    """Find the digital twin: where every strut of a frame is.

    Parameters
    ----------
    capture : path, Capture or Simulation
        The plan, the cameras and the pictures.
    preset : str
        ``"fast"``, or to compare with: ``"paper"``, ``"paper-letter"``, ``"paper-lattice"``, ``"curve-driven"``,
        ``"deformation-driven"``.
    seed : int
        Of whatever the preset draws at random; ``"fast"`` draws nothing.
    changes : mapping, optional
        Settings that differ from the preset's, by name.
    warm_start : path, optional
        Run folder of an earlier fit of the same frame, from which to start.
    progress : callable, optional
        Called with a `Progress` after every step; returning ``False`` stops the fit.

    Returns
    -------
    FitResult
        The twin of the whole frame, in the frame's order, and the deformation field.

    Raises
    ------
    InputError
        If the capture, a setting or the earlier run cannot be used.
    Cancelled
        If ``progress`` returns ``False``.
    """
    from frametwin.fitting.api import fit_capture, fit_views, read_field

    if isinstance(capture, Capture | str | os.PathLike):
        found = capture if isinstance(capture, Capture) else read_capture(capture)
        return fit_capture(found, preset, seed=seed, changes=changes, warm_start=warm_start, callback=progress)
    masks = [image.astype(np.float32) / np.float32(255) for image in capture.images]
    start = None if warm_start is None else read_field(warm_start)
    return fit_views(
        capture.frame, capture.cameras, masks, preset, seed=seed, changes=changes, start=start, callback=progress
    )


def write_run(
    folder: PathLike, result: FitResult, capture: PathLike | Capture | Simulation, *, overwrite: bool = False
) -> None:
    """Write what a fit found as a run folder, whole or not at all.

    Parameters
    ----------
    folder : path
        The folder to be.
    result : FitResult
        What `fit` returned.
    capture : path, Capture or Simulation
        What was fitted; its plan goes into the folder.
    overwrite : bool
        Whether a folder that is there may be replaced.

    Raises
    ------
    InputError
        If the folder holds something and may not be replaced, or cannot be written.
    """
    from frametwin.fitting import api

    api.write_run(folder, result, _capture_of(capture), overwrite=overwrite)


def evaluate(
    found: PathLike | Run | FitResult | Twin | Wireframe,
    truth: PathLike | Capture | Simulation | Wireframe,
) -> Errors:
    """Measure how far a twin is from the truth.

    Only what is printed counts, and of struts that are missing in the truth only what exists.

    Parameters
    ----------
    found : path, Run, FitResult, Twin or Wireframe
        What to judge: a run (or its folder), the result of a fit, a twin; or a plan, for the error before the fit.
    truth : path, Capture, Simulation or Wireframe
        The real geometry: a capture with a ``truth.json`` (or its folder), a simulation, a frame file or a frame.

    Returns
    -------
    Errors
        Distances in mm between the curves, at the joints, and at equal parameter; of the whole, of each strut and of
        each joint.

    Raises
    ------
    InputError
        If the truth is not known, or is that of another frame.
    """
    from frametwin.evaluation import evaluate as evaluation

    if isinstance(found, str | os.PathLike):
        found = read_run(found)
    plan = found.frame if isinstance(found, Run) else None
    shape = found if isinstance(found, Twin | Wireframe) else found.twin
    real = _truth_of(truth, plan)
    curves = shape.curves if isinstance(shape, Twin) else shape.control_points
    return evaluation.evaluate(curves, shape.vertices, real.frame, real.present)


def _capture_of(capture: PathLike | Capture | Simulation) -> Capture:
    """A capture as it is or read from its folder; of a simulation, its plan and its truth."""
    if isinstance(capture, Capture):
        return capture
    if isinstance(capture, str | os.PathLike):
        return read_capture(capture)
    return Capture(root=Path(), frame=capture.frame, views=(), truth=capture.truth)


def _truth_of(truth: PathLike | Capture | Simulation | Wireframe, plan: Wireframe | None) -> Truth:
    """The real geometry and what of it exists; what is printed is as in the plan, where that is known."""
    if isinstance(truth, Wireframe):
        return Truth(truth if plan is None else truth.replace(printed=plan.printed), None)
    if isinstance(truth, Capture):
        return read_truth(truth.root, truth.frame if plan is None else plan)
    if isinstance(truth, str | os.PathLike):
        return read_truth(Path(truth), read_frame(truth) if plan is None else plan)
    return Truth(truth.truth.replace(printed=truth.frame.printed), truth.present)
