"""Jobs for tests of the worker: some count, some print where they should not, some do not survive."""

from __future__ import annotations

import faulthandler
import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.errors import Doubt, FrameTwinError, Held
from frametwin.files import staged_directory
from frametwin.progress import Progress, ProgressCallback, report


def count(
    steps: int = 3, pause: float = 0.0, stage: str = "counting", progress: ProgressCallback | None = None
) -> dict[str, Any]:
    for step in range(steps):
        curves = np.full((2, 4, 3), step, dtype=np.float64)
        report(progress, Progress(stage, step, steps, float("nan") if step == 0 else 1.0 / step, curves))
        time.sleep(pause)
    return {"steps": steps}


def shout() -> dict[str, Any]:
    print("printed")
    sys.__stdout__.write("to the old stdout\n")
    sys.__stdout__.flush()
    os.write(1, b"to the descriptor\n")
    subprocess.run([sys.executable, "-c", "print('by a child')"], check=True)
    read = subprocess.run([sys.executable, "-c", "import sys; sys.exit(len(sys.stdin.read()))"], check=False)
    return {"read": len(sys.stdin.read()), "child_read": read.returncode}


def crash(how: str) -> dict[str, Any]:
    print(f"about to {how}", file=sys.stderr)
    if how == "abort":
        faulthandler._sigsegv()
    if how == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "leave":
        os._exit(3)
    raise {"exit": SystemExit, "interrupt": KeyboardInterrupt, "known": FrameTwinError, "unknown": ZeroDivisionError}[
        how
    ]("as told")


def stubborn() -> dict[str, Any]:
    """Compiled code that neither reports nor lets another thread run."""
    return {"sum": sum(itertools.repeat(1, 10**12))}


def write(out: Path, steps: int = 10**6, progress: ProgressCallback | None = None) -> dict[str, Any]:
    with staged_directory(out) as stage:
        (stage / "half").write_text("half")
        count(steps, 0.01, "writing", progress)
    return {}


def echo(values: Any) -> dict[str, Any]:
    return {"values": values, "kinds": [type(value).__name__ for value in values]}


def nan() -> dict[str, Any]:
    return {"value": float("nan")}


def lacking() -> dict[str, Any]:
    import no_such_package

    return {"package": no_such_package.__name__}


def hold() -> dict[str, Any]:
    held = Held.at("captures/3", "collapsed", "it lies on the plate", "look at it")
    held.doubts = (Doubt("collapsed", "it lies on the plate", "look at it"), Doubt("poor-fit", "it fits ill", "wipe"))
    raise held
