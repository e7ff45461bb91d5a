"""A second Blender as a worker: it renders while the first one stays at the user's hand, and may crash alone."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

import frametwin
from frametwin.worker.client import WorkerClient

REMEDY = "see whether it can be started with the option --background, and install it again if not"


def blender_worker() -> WorkerClient:
    """A worker, not started yet, that runs in a Blender of the same kind as this one, with factory settings."""
    root = Path(frametwin.__file__).resolve().parents[1]
    if bpy.app.module or not bpy.app.binary_path:
        return WorkerClient(sys.executable, package_root=root, remedy=REMEDY)
    # The child's Python knows nothing of extensions, from one of which this package may come.
    start = f"import sys; sys.path.insert(0, {str(root)!r}); import runpy; "
    start += "runpy.run_module('frametwin.worker', run_name='__main__', alter_sys=True)"
    blender = bpy.app.binary_path
    options = ["--background", "--factory-startup", "--offline-mode", "--python-exit-code", "1"]
    return WorkerClient(blender, command=[blender, *options, "--python-expr", start], remedy=REMEDY)
