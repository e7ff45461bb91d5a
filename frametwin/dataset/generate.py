"""Making the samples of a dataset: here, in child processes that are renewed, and on a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Annotated

from frametwin.blender.rendering.client import blender_is_here
from frametwin.dataset.children import GenerateTask, close_idle, make_sample
from frametwin.dataset.farm import SampleSteps, run_tasks
from frametwin.dataset.run import Busy, DatasetRun
from frametwin.errors import Cancelled, InputError
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.ranges import Seed, at_least, check_settings, in_words, rising, within

PER_PROCESS = 25
"""Samples that one process makes before a fresh one takes over: Blender's memory grows with every scene."""


@dataclass(frozen=True)
class GenerateSettings:
    """How a dataset is made; what is in it does not depend on this.

    Attributes
    ----------
    seed, count : in place of the recipe's own.
    shard : ``(i, n)``: only every n-th sample, beginning with the i-th, i from 1.
    workers : processes on this machine.
    scheduler : address of a Dask scheduler that exists, whose workers do the work then.
    per_process : samples that one process makes before a fresh one takes over.
    """

    seed: Seed | None = None
    count: Annotated[int, at_least(1)] | None = None
    shard: Annotated[
        tuple[Annotated[int, at_least(1)], Annotated[int, at_least(1)]],
        rising,
        in_words("i/n with i from 1 to n, as 2/3"),
    ] = (1, 1)
    workers: Annotated[int, within(1, 1024)] = 1
    scheduler: str | None = None
    per_process: Annotated[int, at_least(1)] = PER_PROCESS

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass
class Report:
    """What a run did. All but ``damaged`` and ``failed`` are rising indices; those give reasons by index.

    Attributes
    ----------
    made : samples that are new.
    kept : those that were there, whole.
    damaged : those that were there but not as they should be, and were made again.
    failed : those that could not be made.
    busy : those that another run was making at the same time.
    seconds : how long it took.
    """

    made: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    damaged: dict[int, str] = field(default_factory=dict)
    failed: dict[int, str] = field(default_factory=dict)
    busy: list[int] = field(default_factory=list)
    seconds: float = 0.0


def generate(
    recipe: Path,
    out: Path,
    settings: GenerateSettings | None = None,
    progress: ProgressCallback | None = None,
) -> Report:
    """Make the samples of a recipe that are missing or damaged.

    Parameters
    ----------
    recipe
        Its file.
    out
        The dataset's folder; a run that was cut off there is gone on with.
    settings
        See `GenerateSettings`.
    progress
        Told of every sample, and with one process of every step.

    Returns
    -------
    What was made, kept, and what failed. A sample that fails does not stop the others.

    Raises
    ------
    InputError
        If recipe, folder or settings cannot be used.
    Cancelled
        If ``progress`` returns ``False``. Samples that are done stay.
    """
    settings = GenerateSettings() if settings is None else settings
    began = perf_counter()
    run = DatasetRun(recipe, out, settings.seed, settings.count)
    if run.recipe.needs_blender and settings.scheduler is None:
        require_blender(Path(recipe))
    indices = run.indices(settings.shard)
    run.open()
    survey = run.survey(indices, progress)
    run.note(tried=survey.wanted)
    result = Report(kept=survey.kept, damaged=survey.damaged)
    tasks = [
        GenerateTask(str(run.source.path.absolute()), str(run.out), settings.seed, settings.count, run.source.digest, i,
             settings.per_process)
        for i in survey.wanted
    ]  # fmt: skip
    alone = settings.scheduler is None and settings.workers == 1
    shown = SampleSteps(progress, len(tasks)) if alone else None
    function: Callable[[GenerateTask], str] = make_sample if shown is None else lambda task: make_sample(task, shown)
    done = 0
    try:
        report(progress, Progress("samples", 0, len(tasks)))
        for task, outcome in run_tasks(function, tasks, settings.workers, settings.scheduler, close_idle):
            done += 1
            if shown is not None:
                shown.done = done
            # First of all: an interrupt reaches the child too, and what that makes of it is no failure of the sample.
            report(progress, Progress("samples", done, len(tasks)))
            _sort_in(result, task.index, outcome)
    finally:
        close_idle()
        run.note(sorted(result.failed.items()))
    result.made.sort()
    result.seconds = perf_counter() - began
    return result


def require_blender(recipe: Path) -> None:
    """Refuse a recipe that needs Blender where its module is not installed.

    Raises
    ------
    InputError
        With the remedies.
    """
    if not blender_is_here():
        problem = "needs Blender, whose Python module bpy is not installed here"
        remedy = (
            "install it (python3 scripts/run.py setup), run scripts/generate_dataset.py in a Blender,"
            " or take style = 'silhouette'"
        )
        raise InputError.at(recipe, "render.style", problem, remedy)


def _sort_in(result: Report, index: int, outcome: str | Exception) -> None:
    if isinstance(outcome, Cancelled):
        raise outcome
    if isinstance(outcome, Busy):
        result.busy.append(index)
    elif isinstance(outcome, Exception):
        result.failed[index] = str(outcome)
    else:
        result.made.append(index)
