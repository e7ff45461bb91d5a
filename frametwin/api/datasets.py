"""Datasets of captures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from frametwin.files import PathLike
from frametwin.progress import ProgressCallback

if TYPE_CHECKING:
    from frametwin.dataset.generate import Report


def generate_dataset(
    recipe: PathLike, folder: PathLike, *, progress: ProgressCallback | None = None, **settings: Any
) -> Report:
    """Make the samples of a recipe that are missing or damaged; each is a capture folder with exact truth.

    Parameters
    ----------
    recipe : path
        A TOML file; see the page on datasets.
    folder : path
        The dataset's folder; a run that was cut off there is gone on with.
    progress : callable, optional
        Called with a `Progress` after every sample; returning ``False`` stops the run.
    **settings
        ``count`` and ``seed`` in place of the recipe's, ``shard=(i, n)``, ``workers``, ``scheduler``, ``per_process``:
        as the options of ``frametwin dataset generate``.

    Returns
    -------
    Report
        Indices of the samples that were made and kept, and the reasons of those that failed.

    Raises
    ------
    InputError
        If recipe, folder or settings cannot be used.
    Cancelled
        If ``progress`` returns ``False``. Samples that are done stay.
    """
    from frametwin.dataset.generate import GenerateSettings, generate

    return generate(Path(recipe), Path(folder), GenerateSettings(**settings), progress)
