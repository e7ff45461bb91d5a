"""A folder of its own for what a worker and its libraries put down for a moment, gone when the worker is.

Blender and others clean up after themselves only when they end in peace; a worker may be killed. So its client names a
folder as the place of temporary files, and both remove it: the worker when it ends, the client when it finds it ended.
"""

from __future__ import annotations

import os
import shutil
import tempfile

VARIABLE = "FRAMETWIN_SCRATCH"
PREFIX = "frametwin-worker-"


def make_scratch() -> str:
    """Make the folder; returns its path."""
    return tempfile.mkdtemp(prefix=PREFIX)


def scratch_environment(path: str) -> dict[str, str]:
    """Environment variables with which a process puts its temporary files into the folder, on every system."""
    return {VARIABLE: path, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), path)}


def remove_scratch(path: str | None) -> None:
    """Remove the folder, if there is one and it was made by `make_scratch`."""
    if path and os.path.basename(path).startswith(PREFIX):
        shutil.rmtree(path, ignore_errors=True)


def leave(code: int) -> None:
    """End this process, a worker, at once, and its folder with it; libraries may hang when they are left to end."""
    remove_scratch(os.environ.get(VARIABLE))
    os._exit(code)
