"""What the worker process does for datasets (see `frametwin.worker`).

``dataset-sample`` makes a whole sample, Blender's part included, where its module is installed. The others serve a
Blender that has no libraries of its own: ``dataset-plan`` says which samples are wanted, then for each of them
``dataset-source``, ``dataset-prepare``, Blender's rendering, and ``dataset-finish`` or ``dataset-give-up``;
``dataset-close`` ends the run.
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from frametwin.capture.scene import WORKBENCH_WORKS
from frametwin.dataset.children import GenerateTask, sample_here
from frametwin.dataset.folder import read_dataset
from frametwin.dataset.run import SCENE_FILE, Busy, DatasetRun
from frametwin.errors import InputError
from frametwin.formats import frame_json
from frametwin.progress import ProgressCallback

_run: DatasetRun | None = None
_claims: dict[int, ExitStack] = {}


def sample(
    recipe: str,
    out: str,
    index: int,
    digest: str,
    seed: int | None = None,
    count: int | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Make one sample.

    Returns
    -------
    ``content``: its hash; ``busy``: the reason why another process has it, or null; ``workbench``: whether that engine
    works, as an environment variable says it to the next process, or null.
    """
    try:
        content = sample_here(GenerateTask(recipe, out, seed, count, digest, index, per_process=1), progress)
    except Busy as busy:
        return {"content": None, "busy": str(busy), "workbench": None}
    return {"content": content, "busy": None, "workbench": os.environ.get(WORKBENCH_WORKS)}


def plan(
    recipe: str,
    out: str,
    seed: int | None = None,
    count: int | None = None,
    shard: list[int] | None = None,
    again: bool = False,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Begin a run, or go on with one; with ``again`` only look what is left of the one that is under way.

    Returns
    -------
    ``wanted``: indices of the samples to make; ``kept``: how many are there; ``damaged``: why some are made again.
    """
    global _run
    _run = DatasetRun(recipe, out, seed, count)
    indices = _run.indices((1, 1) if shard is None else tuple(shard))  # type: ignore[arg-type]  # checked there
    _run.open()
    survey = _run.survey(indices, progress)
    if not again:
        _run.note(tried=survey.wanted)
    damaged = {str(index): reason for index, reason in survey.damaged.items()}
    return {"wanted": survey.wanted, "kept": len(survey.kept), "damaged": damaged}


def open_run(
    recipe: str, out: str, seed: int | None = None, count: int | None = None, shard: list[int] | None = None
) -> dict[str, Any]:
    """Join a run that has been planned by another process."""
    global _run
    _run = DatasetRun(recipe, out, seed, count)
    return {}


def failures() -> dict[str, Any]:
    """What is noted as failed: reasons by index."""
    return {"failed": {str(item.index): item.reason for item in read_dataset(_opened().out).failed}}


def source(index: int) -> dict[str, Any]:
    """The .blend file, object and frame of the timeline from which a sample comes; ``file`` is null for most."""
    run = _opened()
    specification = run.sampler.specification(index)
    values = specification.deformation
    path = run.sampler.blend_file(specification)
    return {
        "file": None if path is None else str(path),
        "object": values.object,
        "timeline_frame": values.timeline_frame,
    }


def prepare(
    index: int,
    plan: dict[str, Any] | None = None,
    deformed: dict[str, Any] | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Take a sample and write all of it but the pictures.

    Parameters
    ----------
    index
        Its number.
    plan, deformed
        For samples from a .blend file: the two frames, as in a frame file.

    Returns
    -------
    ``folder`` in which it grows, ``scene``: the file that has to be rendered, or null; ``busy``: why another process
    has the sample, or null.
    """
    run = _opened()
    claim = ExitStack()
    try:
        claim.enter_context(run.claim(index))
    except Busy as busy:
        return {"folder": None, "scene": None, "busy": str(busy)}
    _claims[index] = claim
    try:
        shapes = None
        if plan is not None and deformed is not None:
            shapes = (frame_json.parse(plan, "plan"), frame_json.parse(deformed, "deformed"))
        stage = run.prepare(index, shapes, progress)
    except BaseException:
        give_up(index)
        raise
    scene = stage / SCENE_FILE
    return {"folder": str(stage), "scene": str(scene) if scene.exists() else None, "busy": None}


def finish(index: int, made_with: dict[str, Any] | None = None) -> dict[str, Any]:
    """Make a rendered sample part of the dataset: ``{"content": hash}``."""
    try:
        content = _opened().finish(index, made_with)
    except BaseException:
        give_up(index)
        raise
    _release(index)
    return {"content": content}


def give_up(index: int) -> dict[str, Any]:
    """Remove what there is of a sample that failed."""
    _opened().give_up(index)
    _release(index)
    return {}


def tidy(indices: list[int]) -> dict[str, Any]:
    """Remove what a Blender that died or was ended has left of samples."""
    for index in indices:
        _opened().tidy(index)
    return {}


def close(failed: dict[str, str] | None = None) -> dict[str, Any]:
    """Write what there is into ``dataset.json``, with what failed and why."""
    run = _opened()
    for index in list(_claims):
        give_up(index)
    run.note(sorted((int(index), reason) for index, reason in (failed or {}).items()))
    return {"out": str(Path(run.out))}


def _release(index: int) -> None:
    claim = _claims.pop(index, None)
    if claim is not None:
        claim.close()


def _opened() -> DatasetRun:
    if _run is None:
        raise InputError.at("request", "dataset", "no run has been begun", "send dataset-plan first")
    return _run
