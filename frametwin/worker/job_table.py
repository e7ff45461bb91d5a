"""What a worker can do: the table of jobs, found by name and imported when they are asked for.

A job is a function of keyword parameters with type hints, which are checked before it is called. A parameter called
``progress`` is no part of the request: it gets the callback by which the job tells what it does and learns that it
shall stop. It returns a dict for JSON, in which arrays are welcome.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any, get_type_hints

from frametwin.checked_json import convert, name_problem
from frametwin.errors import InputError
from frametwin.progress import ProgressCallback

JOBS: dict[str, str] = {
    "simulate": "frametwin.service.tasks:simulate",
    "fit": "frametwin.service.tasks:fit",
    "evaluate": "frametwin.service.tasks:evaluate",
    "adapt": "frametwin.service.tasks:adapt",
    "capture": "frametwin.service.capture_tasks:make_capture",
    "masks": "frametwin.service.capture_tasks:show_masks",
    "compare": "frametwin.service.view_tasks:compare",
    "render": "frametwin.service.render_tasks:render",
    "render-capture": "frametwin.service.render_tasks:render_capture",
    "print-plan": "frametwin.service.print_tasks:plan",
    "print-next": "frametwin.service.print_tasks:answer",
    "print-status": "frametwin.service.print_tasks:status",
    "print-simulate": "frametwin.service.print_tasks:simulate",
    "dataset-sample": "frametwin.service.dataset_tasks:sample",
    "dataset-plan": "frametwin.service.dataset_tasks:plan",
    "dataset-open": "frametwin.service.dataset_tasks:open_run",
    "dataset-failures": "frametwin.service.dataset_tasks:failures",
    "dataset-source": "frametwin.service.dataset_tasks:source",
    "dataset-prepare": "frametwin.service.dataset_tasks:prepare",
    "dataset-finish": "frametwin.service.dataset_tasks:finish",
    "dataset-give-up": "frametwin.service.dataset_tasks:give_up",
    "dataset-tidy": "frametwin.service.dataset_tasks:tidy",
    "dataset-close": "frametwin.service.dataset_tasks:close",
}
"""Names of jobs, and the functions that do them as ``module:function``."""

PROGRESS = "progress"


def run_job(name: str, parameters: Mapping[str, Any], progress: ProgressCallback | None = None) -> dict[str, Any]:
    """Do a job.

    Parameters
    ----------
    name
        One of `JOBS`.
    parameters
        As in the request; arrays may be numpy's.
    progress
        See `ProgressCallback`.

    Raises
    ------
    InputError
        If a parameter is unknown, missing or of another kind; whatever the job raises.
    """
    module, _, attribute = JOBS[name].partition(":")
    function: Callable[..., dict[str, Any]] = getattr(importlib.import_module(module), attribute)
    arguments = checked_arguments(function, parameters, f"request {name}")
    if PROGRESS in inspect.signature(function).parameters:
        arguments[PROGRESS] = progress
    return function(**arguments)


def checked_arguments(function: Callable[..., Any], values: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Keyword arguments of a function from values out of JSON, by its type hints.

    Raises
    ------
    InputError
        If a name is unknown or missing, or a value of another kind.
    """
    hints = get_type_hints(function)
    wanted = {name: item for name, item in inspect.signature(function).parameters.items() if name != PROGRESS}
    for name in values:
        if name not in wanted:
            raise name_problem(source, name, "is not a parameter", wanted)
    for name, item in wanted.items():
        if name not in values and item.default is inspect.Parameter.empty:
            raise InputError.at(source, name, "is missing", "add it to the parameters")
    return {name: convert(value, hints[name], source, name) for name, value in values.items()}
