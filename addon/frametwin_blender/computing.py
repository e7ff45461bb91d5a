"""In which Python the fitter runs: Blender's own with the packages that the extension carries, or another one."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import bpy

from frametwin import __version__
from frametwin.blender.background.runner import Job, Steps
from frametwin.errors import InputError
from frametwin.worker.client import WorkerClient, find_python
from frametwin.worker.installation import installed_python
from frametwin.worker.interpreter import NEEDED, VARIABLE, WITHOUT_TORCH, Interpreter, running_interpreter

from . import session
from .fit_settings import LEAVE_OUT
from .steps import is_free, needs
from .translations import translated

WHERE = "Preferences > Add-ons > FrameTwin"
HAS_SET_UP = importlib.util.find_spec(f"{__package__}.set_up") is not None
"""Whether this is an edition that can set up an environment with PyTorch."""

REMEDY = f"press Set Up in {WHERE}, or choose another Python there" if HAS_SET_UP else f"choose a Python in {WHERE}"
LOOK_AGAIN = 3.0  # seconds
LABELS = {"ignore": LEAVE_OUT}
"""Where the panels call a field otherwise than the command line."""


def preferences_of() -> bpy.types.AddonPreferences | None:
    """The add-on's preferences; ``None`` while it is registered by hand."""
    addon = bpy.context.preferences.addons.get(__package__)
    return None if addon is None else addon.preferences


def environment_folder() -> Path:
    """Where Set Up makes its environment, by version of FrameTwin."""
    parent = bpy.utils.extension_path_user(__package__, path="", create=True)
    return Path(parent) / f"environment-{__version__}"


def set_up_python() -> str | None:
    """The Python of the environment that Set Up has made; ``None`` if there is none."""
    return installed_python(environment_folder()) if _has_place() else None


def chosen_python(torch: bool = False) -> Interpreter:
    """The Python in which the fitter runs.

    Parameters
    ----------
    torch
        Whether PyTorch is needed.

    Returns
    -------
    The one that the user chose, as long as it can be started. Else, without PyTorch, that of the variable
    ``FRAMETWIN_PYTHON``, Blender's own if it has the packages, the one that was set up; with PyTorch, the one that was
    set up, that of the variable, Blender's own.

    Raises
    ------
    InputError
        If there is none, or it is being set up; the message says what to do.
    """
    if is_being_set_up(torch):
        raise InputError(f"FrameTwin's Python is being set up: wait until that is done, or cancel it in {WHERE}.")
    given = given_path()
    if not given:
        return _found_python(torch)
    try:
        return Interpreter(find_python(given, remedy=REMEDY))
    except InputError as error:
        try:
            return _found_python(torch)  # what is typed wrongly takes nothing away; the panels tell of it
        except InputError:
            raise error from None


def _found_python(torch: bool) -> Interpreter:
    own = running_interpreter(NEEDED if torch else WITHOUT_TORCH)
    named, ready = os.environ.get(VARIABLE, "").strip(), set_up_python()
    if torch and ready:
        return Interpreter(ready)
    if named:
        return Interpreter(find_python(remedy=REMEDY))
    if own is not None:
        return own
    if ready:
        return Interpreter(ready)
    if torch and running_interpreter(WITHOUT_TORCH) is not None:
        raise InputError(f"This preset needs PyTorch, which Blender's Python has not: {REMEDY}.")
    raise InputError(f"FrameTwin has no Python to compute with yet: {REMEDY}.")


def given_path() -> str:
    """What the user typed as the Python; empty for nothing."""
    preferences = preferences_of()
    return "" if preferences is None or not preferences.python.strip() else bpy.path.abspath(preferences.python.strip())


def given_problem() -> str:
    """Why the Python that the user typed is not used; empty if it is, or none is typed."""
    try:
        if given_path():
            find_python(given_path(), remedy="it is not used")
    except InputError as error:
        return str(error)
    return ""


def is_being_set_up(torch: bool = False) -> bool:
    """Whether the Python in which the fitter would run is being set up; another one that is there is not."""
    if session.installer is None or not session.installer.running:
        return False
    given = given_path()
    if given and _has_place() and Path(given).is_relative_to(environment_folder()):
        return True
    if given and not given_problem():
        return False
    return torch or not (os.environ.get(VARIABLE, "").strip() or running_interpreter(WITHOUT_TORCH))


def _has_place() -> bool:
    """Whether Blender gives this add-on a folder: it does to extensions alone."""
    return bool(__package__.startswith("bl_ext."))


def can_compute(cls: type, torch: bool = False) -> bool:
    """Whether the worker can begin a job, as an answer of a ``poll``; that there is a Python is seen then."""
    ready = needs(cls, not is_being_set_up(torch), "The fitter's Python is being set up: wait until that is done")
    return ready and is_free(cls)


def python_worker(torch: bool = False) -> WorkerClient:
    """A worker in that Python, not started yet."""
    chosen = chosen_python(torch)
    return WorkerClient(chosen.python, environment=chosen.environment, remedy=REMEDY)


def worker_job(
    title: str,
    request: str,
    parameters: dict[str, Any],
    finish: Callable[[Any], Steps],
    *,
    out: Path | None = None,
    torch: bool = False,
    **more: Any,
) -> Job:
    """A job of the worker in that Python.

    Parameters
    ----------
    title, request, parameters, finish
        See `frametwin.blender.background.runner.Job`.
    out
        The folder that it makes, of which nothing is left if it is cancelled; one of its parameters.
    torch
        Whether it needs PyTorch.
    more
        Other fields of the job.

    Raises
    ------
    InputError
        If there is no Python.
    """
    chosen = chosen_python(torch)  # tells workers of different Pythons apart
    given = parameters if out is None else {**parameters, "out": out}
    return Job(
        title=title,
        request=request,
        parameters=given,
        finish=finish,
        worker=lambda: python_worker(torch),
        kind=f"python {chosen.python} {os.pathsep.join(chosen.folders)}",
        out=out,
        labels={name: translated(label) for name, label in LABELS.items()},
        **more,
    )


_seen: dict[tuple[str, bool], tuple[float, bool]] = {}


def has_python(torch: bool = False) -> bool:
    """Whether there is a Python to compute with; looked up at most once in a few seconds, since panels ask often."""
    key = given_path(), torch
    at, found = _seen.get(key, (-LOOK_AGAIN, False))
    if perf_counter() - at > LOOK_AGAIN:
        try:
            found = bool(chosen_python(torch))
        except InputError:
            found = False
        _seen[key] = (perf_counter(), found)
    return found


def forget() -> None:
    """Look again at once, since something has changed."""
    _seen.clear()
