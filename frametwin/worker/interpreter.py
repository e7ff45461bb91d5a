"""Which Python the worker runs in."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from frametwin.errors import InputError

VARIABLE = "FRAMETWIN_PYTHON"

WITHOUT_TORCH = ("numpy", "scipy", "numba", "cv2", "safetensors", "threadpoolctl")
"""Packages without which no fit can run; the preset ``fast`` and most of the worker's other jobs need no more."""

NEEDED = (*WITHOUT_TORCH, "torch")
"""Packages without which not all of the library's jobs can run."""

REMEDY = (
    "set up an environment with FrameTwin (python3 -m venv ENV, then ENV/bin/python -m pip install frametwin)"
    f" and give its Python, or set the variable {VARIABLE} to it"
)


@dataclass(frozen=True)
class Interpreter:
    """A Python for the worker.

    Attributes
    ----------
    python
        The program.
    folders
        Where its packages are, if it would not find them by itself.
    """

    python: str
    folders: tuple[str, ...] = ()

    @property
    def environment(self) -> dict[str, str | None]:
        """Environment variables for `frametwin.worker.client.WorkerClient`."""
        if not self.folders:
            return {}
        # What a user has installed into a folder of their own could be of other versions.
        return {"PYTHONPATH": os.pathsep.join(self.folders), "PYTHONNOUSERSITE": "1"}


def running_interpreter(packages: tuple[str, ...] = NEEDED) -> Interpreter | None:
    """The running Python, with the folders in which it has some packages; ``None`` if one of them is missing.

    Inside of Blender these are the folders of its own packages and of those that extensions carry.
    """
    python = running_python()
    places = [_place_of(name) for name in ("frametwin", *packages)]
    if python is None or None in places:
        return None
    order = {os.path.realpath(folder): i for i, folder in reversed(list(enumerate(sys.path)))}
    found = dict.fromkeys(place for place in places if place is not None)
    folders = sorted(found, key=lambda folder: order.get(os.path.realpath(folder), len(order)))
    return Interpreter(python, tuple(folders))


def running_python() -> str | None:
    """The program of the running Python: inside of Blender, the one that lies beside it; ``None`` if there is none."""
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    beside = [Path(sys.prefix, "bin", version), Path(sys.prefix, "bin", "python.exe"), Path(sys.prefix, "python.exe")]
    for path in (Path(sys.executable or "."), *beside):
        if path.stem.lower().startswith(("python", "pypy")) and path.is_file():
            return str(path)
    return None


def _place_of(package: str) -> str | None:
    """The folder in which the running Python has a package, without importing it."""
    spec = find_spec(package)
    if spec is None:
        return None
    for inside in spec.submodule_search_locations or [spec.origin or ""]:
        return os.path.dirname(os.path.abspath(inside))
    return None


def find_python(given: str | os.PathLike[str] | None = None, *, remedy: str = REMEDY) -> str:
    """Find the Python that has the libraries.

    Parameters
    ----------
    given
        What the user chose, if anything: a Python, its name on the search path, or the folder of an environment.
    remedy
        What to do if there is none, where the user has another way than the one by hand.

    Returns
    -------
    The given one, else that of the variable ``FRAMETWIN_PYTHON``, else the running one if it can do the work.

    Raises
    ------
    InputError
        If there is none, or the one that is given is no program; the message says what to do. Whether FrameTwin is
        installed there is seen when a worker is started.
    """
    if given is not None and str(given).strip():
        return _program(str(given).strip(), "Python", remedy)
    named = os.environ.get(VARIABLE, "").strip()
    if named:
        return _program(named, VARIABLE, remedy)
    running = sys.executable or ""
    if not Path(running).stem.lower().startswith(("python", "pypy")):
        raise InputError.at(running or "this program", "Python", "is no Python", remedy)
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise InputError.at(running, "Python", f"lacks what FrameTwin computes with ({', '.join(missing)})", remedy)
    return running


def find_interpreter(given: str | os.PathLike[str] | None = None, *, torch: bool = True) -> Interpreter:
    """As `find_python`, but where nothing is named the running Python serves with what lies on its path.

    Parameters
    ----------
    given
        As there.
    torch
        Whether PyTorch is needed.

    Raises
    ------
    InputError
        As there.
    """
    if not (given and str(given).strip()) and not os.environ.get(VARIABLE, "").strip():
        own = running_interpreter(NEEDED if torch else WITHOUT_TORCH)
        if own is not None:
            return own
    return Interpreter(find_python(given))


def _program(given: str, field: str, remedy: str) -> str:
    path = Path(given).expanduser()
    if path.is_dir():
        inside = [path / "bin" / "python", path / "Scripts" / "python.exe", path / "python.exe"]
        path = next((file for file in inside if file.is_file()), path)
        if path.is_dir():
            raise InputError.at(given, field, "is a folder without a Python in it", remedy)
    elif not path.is_file():
        found = shutil.which(given)
        if found is None:
            raise InputError.at(given, field, "does not exist", remedy)
        path = Path(found)
    if not os.access(path, os.X_OK):
        raise InputError.at(given, field, "is not a program that can be run", remedy)
    return os.path.abspath(path)  # not resolved: an environment's Python is known by its own place


BLENDERS_OWN = ("PYTHONHOME", "PYTHONPATH", "PYTHONEXECUTABLE", "PYTHONPLATLIBDIR", "__PYVENV_LAUNCHER__")
"""Variables that lead another Python to the modules of the running one."""


def worker_environment(
    python: str, package_root: str | os.PathLike[str] | None, changes: Mapping[str, str | None] | None
) -> dict[str, str]:
    """Environment variables for a worker: those of this process, but for `BLENDERS_OWN` if its Python is another one.

    Parameters
    ----------
    python
        Of the worker.
    package_root
        The folder that holds the package ``frametwin``, to take it from there (a source checkout) and not from where it
        is installed.
    changes
        Variables to set; ``None`` removes one.
    """
    environment = dict(os.environ)
    if os.path.normcase(python) != os.path.normcase(os.path.abspath(sys.executable or ".")):
        for name in BLENDERS_OWN:
            environment.pop(name, None)
    if package_root is not None:
        rest = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([os.path.abspath(package_root), *([rest] if rest else [])])
    # A file in the working folder must not pass for one of the library's modules.
    environment["PYTHONSAFEPATH"] = "1"
    for name, value in (changes or {}).items():
        if value is None:
            environment.pop(name, None)
        else:
            environment[name] = value
    return environment
