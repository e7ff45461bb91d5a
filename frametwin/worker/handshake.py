"""Whether what a Python started is a worker of this very FrameTwin; if not, what to do."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from frametwin import __version__
from frametwin.errors import InputError
from frametwin.worker.interpreter import REMEDY
from frametwin.worker.protocol import PROTOCOL


def check_versions(python: str, ready: Mapping[str, Any], remedy: str | None = None) -> None:
    """Refuse a worker of another version.

    Parameters
    ----------
    python
        Where it runs.
    ready
        Its first event.
    remedy
        What to do, where that is not to install FrameTwin by hand.

    Raises
    ------
    InputError
        With the versions and the remedy.
    """
    theirs = ready.get("frametwin")
    if theirs != __version__:
        problem = f"is {theirs} where {__version__} is needed"
        raise InputError.at(python, "frametwin", problem, remedy or _update(python))
    if ready.get("protocol") != PROTOCOL:
        problem = f"speaks protocol {ready.get('protocol')} where {PROTOCOL} is needed"
        raise InputError.at(python, "worker", problem, remedy or _update(python))


def start_problem(python: str, obituary: str, words: str, remedy: str | None = None) -> InputError:
    """The error for a Python that ended before it was a worker, from the way it ended and its last words.

    ``remedy`` as for `check_versions`.
    """
    if re.search(r"No module named '?frametwin'?(?![.\w])", words):
        return InputError.at(python, "frametwin", "is not installed there", remedy or REMEDY)
    if re.search(r"No module named '?frametwin\.worker'?(?![.\w])", words):
        return InputError.at(python, "frametwin", "is an older one, without a worker", remedy or _update(python))
    return InputError.at(python, "worker", f"did not start, it {obituary}", remedy or REMEDY)


def _update(python: str) -> str:
    return f'run "{python}" -m pip install frametwin=={__version__}, or give another Python'
