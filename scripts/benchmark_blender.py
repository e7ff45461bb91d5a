"""How long the add-on holds Blender: importing a twin, pumping while a fit runs, ending a fit that is cancelled.

    python scripts/benchmark_blender.py FRAME [--size 800x600]        (with Blender's module bpy)

FRAME is a frame file or the name of one of the project's own. Prints a line for each figure.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
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
        pumps, seconds = follow(capture, run)
        print(f"fit followed: {seconds:.1f} s, {len(pumps)} pumps, longest {1e3 * max(pumps):.1f} ms")
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


def follow(capture: Path, run: Path) -> tuple[list[float], float]:
    """Seconds of every call of the pump during a fit, and of all of it."""
    runner, pumps, began = Runner(), [], time.perf_counter()
    runner.start(job(capture, run))
    going = True
    while going:
        at = time.perf_counter()
        going = runner.pump()
        pumps.append(time.perf_counter() - at)
        bpy.context.view_layer.update()  # as Blender does by itself between two calls of a timer
        time.sleep(0.05)
    if runner.status.error:
        raise SystemExit(runner.status.message)
    runner.close()
    return pumps, time.perf_counter() - began


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
