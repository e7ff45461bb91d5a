"""One sample, made by a child process that lives for several samples: Blender's memory grows, and Blender may crash."""

from __future__ import annotations

import atexit
import os
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frametwin.blender.rendering.client import render_here
from frametwin.capture.scene import WORKBENCH_WORKS
from frametwin.dataset.run import SCENE_FILE, Busy, DatasetRun, opened
from frametwin.errors import FrameTwinError, InputError
from frametwin.progress import ProgressCallback
from frametwin.worker.client import WorkerClient


@dataclass(frozen=True)
class GenerateTask:
    """One sample, for a process that knows nothing else of the run."""

    recipe: str
    out: str
    seed: int | None
    count: int | None
    digest: str
    index: int
    per_process: int


@dataclass
class _Child:
    client: WorkerClient
    samples: int = 0
    busy: bool = False


_children: dict[int, _Child] = {}
"""By thread: a Dask worker of somebody else's cluster may have several."""


def make_sample(task: GenerateTask, progress: ProgressCallback | None = None) -> str:
    """Make one sample in a process of its own kind, which lives for several samples.

    Returns
    -------
    The hash of its content.

    Raises
    ------
    Busy
        If another run is making it.
    FrameTwinError
        With the reason, if it fails; a Blender that crashes is one.
    """
    child = _own_child(task.per_process)
    child.samples += 1
    child.busy = True
    parameters = {name: value for name, value in vars(task).items() if name != "per_process"}
    try:
        result = child.client.call("dataset-sample", parameters, progress)
    except InputError:
        raise
    except BaseException:
        _close(child)  # whatever it was, a fresh process owes nothing to it
        opened(task.recipe, task.out, task.seed, task.count, task.digest).tidy(task.index)
        raise
    finally:
        child.busy = False
    if result["busy"]:
        raise Busy(result["busy"])
    if result["workbench"] is not None:
        os.environ[WORKBENCH_WORKS] = result["workbench"]  # the next process need not try it again
    return str(result["content"])


def _own_child(per_process: int) -> _Child:
    """The process of this thread; a fresh one where it has done its share."""
    thread = threading.get_ident()
    child = _children.get(thread)
    if child is not None and (child.samples >= per_process or not child.client.alive):
        _close(child)
        child = None
    if child is None:
        child = _children[thread] = _Child(WorkerClient(sys.executable))
        child.client.start()
    return child


def _close(child: _Child) -> None:
    child.client.close()
    for thread in [thread for thread, other in _children.items() if other is child]:
        _children.pop(thread, None)


def close_idle() -> None:
    """End the processes of this one that have nothing to do."""
    for child in [child for child in _children.values() if not child.busy]:
        _close(child)


atexit.register(close_idle)


def sample_here(task: GenerateTask, progress: ProgressCallback | None = None) -> str:
    """Make one sample in this very process; what the child does.

    Raises
    ------
    Busy, FrameTwinError
        As `make_sample`.
    """
    run = opened(task.recipe, task.out, task.seed, task.count, task.digest)
    with run.claim(task.index):
        try:
            blend = run.sampler.blend_file(run.sampler.specification(task.index))
            shapes = None if blend is None else _read_blend(run, task.index, blend)
            stage = run.prepare(task.index, shapes, progress)
            made_with: dict[str, Any] = {}
            if (stage / SCENE_FILE).exists():
                made_with = render_here(stage / SCENE_FILE, stage, progress)
            return run.finish(task.index, made_with)
        except BaseException:
            run.give_up(task.index)
            raise


def _read_blend(run: DatasetRun, index: int, path: Path) -> Any:
    from frametwin.blender.frames.plans import read_blend

    values = run.sampler.specification(index).deformation
    if values.object is None:
        raise FrameTwinError(f"sample {index} names no object of {path}")
    return read_blend(path, values.object, values.timeline_frame)
