"""Datasets: recipes, samples that are captures with exact truth, and runs that can be killed and go on.

The names below are for learning. They are imported when they are first used, since the first two need torch.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from frametwin.dataset.splits import split_indices
    from frametwin.dataset.tensors import CaptureDataset, collate_captures

_HOMES = {
    "CaptureDataset": "frametwin.dataset.tensors",
    "collate_captures": "frametwin.dataset.tensors",
    "split_indices": "frametwin.dataset.splits",
}

__all__ = ["CaptureDataset", "collate_captures", "split_indices"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
