"""How long the add-on holds Blender: importing a twin, pumping while a fit runs, ending a fit that is cancelled.

    python scripts/benchmark_blender.py FRAME [--size 800x600]        (with Blender's module bpy)

FRAME is a frame file or the name of one of the project's own. Prints a line for each figure.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from frametwin.blender.background.runner import Job, Runner, Steps
from frametwin.blender.display.preview import remove_preview, show_preview
from frametwin.blender.display.twins import (
    TwinContent,
    TwinObjects,
    import_twin,
    recolour_twin,
    remove_twin,
    show_twin_steps,
)
from frametwin.blender.frames.plan_objects import make_active
from frametwin.scratch import scratch_folder
from frametwin.worker.client import WorkerClient, find_python


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("frame")
    parser.add_argument("--size", default="800x600", help="width x height of the pictures")
    options = parser.parse_args()
    size = [int(side) for side in reversed(options.size.split("x"))]  # height, width
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with scratch_folder() as scratch:
        capture, run = Path(scratch, "capture"), Path(scratch, "run")
        with WorkerClient(find_python()) as worker:
            worker.call("simulate", {"frame": options.frame, "settings": {"size": size}, "out": capture})
        found = follow(capture, run)
        print(f"fit followed: {found.seconds:.1f} s, {len(found.pumps)} pumps, longest {1e3 * max(found.pumps):.1f} ms")
        print(f"    of computing in it: {1e3 * max(found.computing):.1f} ms at most")
        print(f"    Blender's own evaluation in between: {1e3 * max(found.updates):.1f} ms at most")
        for truth in (None, capture):
            began = time.perf_counter()
            shown = import_twin(run, truth=truth)
            bpy.context.view_layer.update()
            taken = time.perf_counter() - began
            print(f"import of the twin with colours{' and errors' if truth else ''}: {taken:.2f} s")
            print(f"another colour: {1e3 * recolour(shown):.0f} ms")
            remove_twin(shown.collection)
        print(f"cancelled fit gone after: {cancel(capture, Path(scratch, 'other')):.2f} s")


def recolour(shown: TwinObjects) -> float:
    """Seconds until the twin is evaluated in another colour, the longest of several."""
    taken = []
    for quantity in ("confidence", "radius", "opacity", "displacement") * 3:
        began = time.perf_counter()
        recolour_twin(shown.collection, quantity)
        bpy.context.view_layer.update()
        taken.append(time.perf_counter() - began)
    return max(taken)


def job(capture: Path, run: Path) -> Job:
    """The fit as the add-on asks for it."""
    scene = bpy.context.scene

    def finish(content: TwinContent) -> Steps:
        shown = yield from show_twin_steps(content, scene=scene)
        make_active(shown.twin, select=False)
        return "done"

    return Job(
        title="Fit",
        request="fit",
        parameters={"capture": capture, "out": run, "hand_over": True},
        worker=lambda: WorkerClient(find_python()),
        kind="python",
        on_curves=lambda curves: show_preview(curves, scene),
        clear=lambda: remove_preview(scene),
        load=TwinContent.handed_over,
        finish=finish,
    )


@dataclass
class Followed:
    """Seconds of every call of the pump during a fit, and of all of it.

    Attributes
    ----------
    pumps, computing
        By the clock, and of the main thread's computing alone: on a computer with other work the two differ.
    updates
        Of what Blender does by itself between two calls.
    seconds
        Of the whole fit.
    """

    pumps: list[float] = field(default_factory=list)
    computing: list[float] = field(default_factory=list)
    updates: list[float] = field(default_factory=list)
    seconds: float = 0.0


def follow(capture: Path, run: Path) -> Followed:
    """Follow a fit as the add-on does."""
    runner, found, began = Runner(), Followed(), time.perf_counter()
    runner.start(job(capture, run))
    going = True
    while going:
        at, computed = time.perf_counter(), time.thread_time()
        going = runner.pump()
        found.computing.append(time.thread_time() - computed)
        found.pumps.append(time.perf_counter() - at)
        at = time.perf_counter()
        bpy.context.view_layer.update()  # as Blender does by itself between two calls of a timer
        found.updates.append(time.perf_counter() - at)
        time.sleep(0.005 if runner.finishing else 0.05)
    if runner.status.error:
        raise SystemExit(runner.status.message)
    runner.close()
    found.seconds = time.perf_counter() - began
    return found


def cancel(capture: Path, run: Path) -> float:
    """Seconds from cancelling a fit to the end of its computing, and of its process if that has to be killed."""
    runner = Runner()
    runner.start(job(capture, run))
    while runner.status.stage != "joints and struts":
        runner.pump()
        time.sleep(0.01)
    (pid,) = runner.pids
    began = time.perf_counter()
    runner.cancel()
    while runner.pump() or (not runner.pids and alive(pid)):
        time.sleep(0.005)
    taken = time.perf_counter() - began
    runner.close()
    return taken


def alive(pid: int) -> bool:
    """Whether a process has not ended."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # Blender's module may hang while Python shuts down
