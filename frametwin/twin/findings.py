"""What a twin says about single struts: which are missing, which the views cannot tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frametwin.twin.twin import Twin

LEAST_GAP = 0.15
"""A strut with a gap of at least this share of its length is taken to be missing or broken off. Single pieces of
whole struts look dark in dense frames, where little of them is in plain view; long stretches rarely do."""

DARK = 0.5
"""A piece of less opacity than this belongs to a gap."""

CERTAIN = 0.5
"""A strut with less confidence than this is uncertain."""


def longest_gap(opacity: np.ndarray) -> np.ndarray:
    """(E,) longest stretch of dark pieces, as a share of the strut, from opacities (E, K)."""
    run = np.zeros(len(opacity), dtype=np.int64)
    longest = np.zeros_like(run)
    for dark in (opacity < DARK).T:
        run = np.where(dark, run + 1, 0)
        longest = np.maximum(longest, run)
    return longest / max(1, opacity.shape[1])


def missing_struts(twin: Twin, printed: np.ndarray) -> np.ndarray:
    """Rising indices of the printed struts, (E,) bool, that are missing in whole or in part."""
    return np.flatnonzero(printed & (longest_gap(twin.opacity) >= LEAST_GAP - 1e-9))


def uncertain_struts(twin: Twin, printed: np.ndarray) -> np.ndarray:
    """Rising indices of the printed struts, (E,) bool, that the views do not determine; not the missing ones."""
    uncertain = np.flatnonzero(printed & (twin.confidence < CERTAIN))
    return np.setdiff1d(uncertain, missing_struts(twin, printed))


def torn_ends(twin: Twin, printed: np.ndarray) -> list[tuple[int, int, float]]:
    """Ends of printed struts, (E,) bool, that are off their joints, the furthest first.

    Returns
    -------
    list of (int, int, float)
        The strut, 0 for its start or 1 for its end, and how far off in mm, NaN where the twin does not tell; empty
        where the preset did not look.
    """
    if twin.attached is None:
        return []
    gap = np.full(twin.attached.shape, np.nan) if twin.gap is None else twin.gap
    ends = [(int(e), int(k), float(gap[e, k])) for e, k in np.argwhere(~twin.attached & printed[:, None])]
    return sorted(ends, key=lambda end: (-np.nan_to_num(end[2]), end))


@dataclass(frozen=True, eq=False)
class Detection:
    """How well missing struts were found. All are rising strut indices.

    Attributes
    ----------
    found : missing, and suspected.
    overlooked : missing, but taken to be there.
    false : there, but suspected.
    """

    found: np.ndarray
    overlooked: np.ndarray
    false: np.ndarray

    @classmethod
    def of(cls, suspected: np.ndarray, present: np.ndarray, printed: np.ndarray) -> Detection:
        """Compare suspected struts, by index, with the intervals (E, 2) at which struts exist."""
        missing = np.flatnonzero(printed & ((present[:, 0] > 0.0) | (present[:, 1] < 1.0)))
        return cls(
            found=np.intersect1d(missing, suspected),
            overlooked=np.setdiff1d(missing, suspected),
            false=np.setdiff1d(suspected, missing),
        )

    def as_dict(self) -> dict[str, Any]:
        """As for a JSON file."""
        return {name: values.tolist() for name, values in vars(self).items()}
