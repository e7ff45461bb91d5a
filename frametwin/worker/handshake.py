"""Whether what a Python started is a worker of this very FrameTwin; if not, what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from frametwin import __version__
from frametwin.errors import InputError
from frametwin.worker.interpreter import REMEDY
from frametwin.worker.protocol import PROTOCOL


def check_versions(python: str, ready: Mapping[str, Any]) -> None:
    """Refuse a worker of another version.

    Parameters
    ----------
    python
        Where it runs.
    ready
        Its first event.

    Raises
    ------
    InputError
        With the versions and the remedy.
    """
    theirs = ready.get("frametwin")
    if theirs != __version__:
        raise InputError.at(python, "frametwin", f"is {theirs} where {__version__} is needed", _update(python))
    if ready.get("protocol") != PROTOCOL:
        problem = f"speaks protocol {ready.get('protocol')} where {PROTOCOL} is needed"
        raise InputError.at(python, "worker", problem, _update(python))


def start_problem(python: str, obituary: str, words: str) -> InputError:
    """The error for a Python that ended before it was a worker, from the way it ended and its last words."""
    if re.search(r"No module named '?frametwin'?(?![.\w])", words):
        return InputError.at(python, "frametwin", "is not installed there", REMEDY)
    if re.search(r"No module named '?frametwin\.worker'?(?![.\w])", words):
        return InputError.at(python, "frametwin", "is an older one, without a worker", _update(python))
    return InputError.at(python, "worker", f"did not start, it {obituary}", REMEDY)


def _update(python: str) -> str:
    return f'run "{python}" -m pip install frametwin=={__version__}, or give another Python'
