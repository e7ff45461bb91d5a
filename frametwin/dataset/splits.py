"""Which samples are for training and which for testing: all samples of one print go to the same side."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from frametwin.dataset.folder import Dataset, read_dataset, read_sample
from frametwin.errors import InputError
from frametwin.files import PathLike


def split_indices(folder: PathLike, shares: Mapping[str, float], seed: int = 0) -> dict[str, list[int]]:
    """Share the samples of a dataset out at random.

    Samples that show the same print, to other numbers of cameras, stay together: a network that is tested on a print
    that it was trained on looks better than it is.

    Parameters
    ----------
    folder : path
        The dataset's folder.
    shares : dict of str to float
        How much of the prints each part gets, by its name; they are above 0, and sum up to 1.
    seed : int
        Of the choice.

    Returns
    -------
    dict of str to list of int
        Rising indices of the samples of each part.

    Raises
    ------
    InputError
        If the dataset is damaged, the shares are none, or there are fewer prints than parts.
    """
    return split_samples(read_dataset(folder), shares, seed)


def split_samples(dataset: Dataset, shares: Mapping[str, float], seed: int = 0) -> dict[str, list[int]]:
    """As `split_indices`, of a dataset that has been read."""
    _check_shares(shares)
    prints: dict[int, list[int]] = {}
    for entry in dataset.samples:
        scene = read_sample(entry.folder).specification.get("scene", entry.index)
        prints.setdefault(scene, []).append(entry.index)
    if len(prints) < len(shares):
        problem = f"ask for {len(shares)} parts of {len(prints)} prints"
        raise InputError.at(dataset.folder, "shares", problem, "generate more samples, or ask for fewer parts")
    # Each print has a number of its own, so that most stay where they are when the dataset grows.
    order = sorted(prints, key=lambda scene: (np.random.default_rng([seed, scene]).random(), scene))
    ends = _ends(list(shares.values()), len(order))
    parts = [order[first:last] for first, last in zip([0, *ends[:-1]], ends, strict=True)]
    return {
        name: sorted(index for scene in part for index in prints[scene])
        for name, part in zip(shares, parts, strict=True)
    }


def _check_shares(shares: Mapping[str, float]) -> None:
    values = list(shares.values())
    fine = values and all(math.isfinite(value) and value > 0.0 for value in values)
    if not fine or abs(sum(values) - 1.0) > 1e-6:
        problem = f"{', '.join(f'{value:g}' for value in values) or 'none'} are no shares of a whole"
        raise InputError.at("settings", "shares", problem, "give numbers above 0 that sum up to 1, as 0.8 and 0.2")


def _ends(shares: list[float], count: int) -> list[int]:
    """Where each part ends among ``count`` prints; every part has at least one."""
    ends = [round(share * count) for share in np.cumsum(shares)]
    for i in range(len(ends)):
        least = ends[i - 1] + 1 if i else 1
        ends[i] = min(max(ends[i], least), count - (len(ends) - 1 - i))
    return ends
