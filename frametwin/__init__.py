"""FrameTwin: where every strut of a printed wireframe really is, from a few pictures and the plan.

Every name below is imported when it is first used, so that ``import frametwin`` costs next to nothing and programs that
only read a frame do not wait for the fitter.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
"""The only place where the version is written; everything else takes it from here."""

# Between two compiled loops their threads would wait by spinning, and take the processor from all that runs in between;
# read when the threads' library is loaded, so it has to be said before.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

if TYPE_CHECKING:
    from frametwin.api.datasets import generate_dataset
    from frametwin.api.fits import Run, evaluate, fit, read_run, write_run
    from frametwin.api.prints import answer_print, plan_print, read_print, simulate_print
    from frametwin.api.simulations import simulate
    from frametwin.cameras import Camera
    from frametwin.cameras.rigs import dome_rig, ring_rig
    from frametwin.capture import Capture, View, read_cameras, read_capture, write_capture
    from frametwin.dataset import CaptureDataset, collate_captures, split_indices
    from frametwin.errors import Cancelled, FrameTwinError, InputError
    from frametwin.evaluation.evaluate import Errors
    from frametwin.fields.base import DeformationField
    from frametwin.fitting.api import FitResult
    from frametwin.formats import read_frame, write_frame
    from frametwin.geometry.parametric import named_frame
    from frametwin.geometry.wireframe import Wireframe
    from frametwin.printing.job.job import PrintJob
    from frametwin.printing.job.plan_job import PlanOptions
    from frametwin.printing.simulation.simulate import SimulatedPrint
    from frametwin.progress import Progress
    from frametwin.simulation.simulate import Simulation, SimulationSettings, write_simulation
    from frametwin.tracking.events import Event
    from frametwin.tracking.settings import TrackSettings
    from frametwin.tracking.tracker import Tracked, Tracker
    from frametwin.twin import Twin
    from frametwin.twin.findings import missing_struts, uncertain_struts

_HOMES = {
    "Camera": "frametwin.cameras",
    "Cancelled": "frametwin.errors",
    "Capture": "frametwin.capture",
    "CaptureDataset": "frametwin.dataset.tensors",
    "DeformationField": "frametwin.fields.base",
    "Errors": "frametwin.evaluation.evaluate",
    "Event": "frametwin.tracking.events",
    "FitResult": "frametwin.fitting.api",
    "FrameTwinError": "frametwin.errors",
    "InputError": "frametwin.errors",
    "PlanOptions": "frametwin.printing.job.plan_job",
    "PrintJob": "frametwin.printing.job.job",
    "Progress": "frametwin.progress",
    "Run": "frametwin.api.fits",
    "SimulatedPrint": "frametwin.printing.simulation.simulate",
    "Simulation": "frametwin.simulation.simulate",
    "SimulationSettings": "frametwin.simulation.simulate",
    "TrackSettings": "frametwin.tracking.settings",
    "Tracked": "frametwin.tracking.tracker",
    "Tracker": "frametwin.tracking.tracker",
    "Twin": "frametwin.twin",
    "View": "frametwin.capture",
    "Wireframe": "frametwin.geometry.wireframe",
    "answer_print": "frametwin.api.prints",
    "collate_captures": "frametwin.dataset.tensors",
    "dome_rig": "frametwin.cameras.rigs",
    "evaluate": "frametwin.api.fits",
    "fit": "frametwin.api.fits",
    "generate_dataset": "frametwin.api.datasets",
    "missing_struts": "frametwin.twin.findings",
    "named_frame": "frametwin.geometry.parametric",
    "plan_print": "frametwin.api.prints",
    "read_cameras": "frametwin.capture",
    "read_capture": "frametwin.capture",
    "read_frame": "frametwin.formats",
    "read_print": "frametwin.api.prints",
    "read_run": "frametwin.api.fits",
    "ring_rig": "frametwin.cameras.rigs",
    "simulate": "frametwin.api.simulations",
    "simulate_print": "frametwin.api.prints",
    "split_indices": "frametwin.dataset.splits",
    "uncertain_struts": "frametwin.twin.findings",
    "write_capture": "frametwin.capture",
    "write_frame": "frametwin.formats",
    "write_run": "frametwin.api.fits",
    "write_simulation": "frametwin.simulation.simulate",
}
"""The module that each name comes from, followed by the name there where it is another one."""

__all__ = [
    "Camera",
    "Cancelled",
    "Capture",
    "CaptureDataset",
    "DeformationField",
    "Errors",
    "Event",
    "FitResult",
    "FrameTwinError",
    "InputError",
    "PlanOptions",
    "PrintJob",
    "Progress",
    "Run",
    "SimulatedPrint",
    "Simulation",
    "SimulationSettings",
    "TrackSettings",
    "Tracked",
    "Tracker",
    "Twin",
    "View",
    "Wireframe",
    "__version__",
    "answer_print",
    "collate_captures",
    "dome_rig",
    "evaluate",
    "fit",
    "generate_dataset",
    "missing_struts",
    "named_frame",
    "plan_print",
    "read_cameras",
    "read_capture",
    "read_frame",
    "read_print",
    "read_run",
    "ring_rig",
    "simulate",
    "simulate_print",
    "split_indices",
    "uncertain_struts",
    "write_capture",
    "write_frame",
    "write_run",
    "write_simulation",
]


def __getattr__(name: str) -> Any:
    """Import a name when it is asked for the first time (PEP 562)."""
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, inner = home.partition(":")
    value = getattr(importlib.import_module(module), inner or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All names, also those that have not been imported yet."""
    return sorted({*globals(), *_HOMES})
