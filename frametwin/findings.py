"""What a twin says about single struts: which are missing, which the views cannot tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frametwin.twin import Twin

COMPLETE = 0.85
"""A strut of which less than this share is there is taken to be missing or broken off. The end of a strut that
is missing looks present where the strut next to it is seen; whole struts are rarely below 0.95."""

CERTAIN = 0.5
"""A strut with less confidence than this is uncertain."""


def missing_struts(twin: Twin, printed: np.ndarray) -> np.ndarray:
    """Rising indices of the printed struts, (E,) bool, that are missing in whole or in part."""
    return np.flatnonzero(printed & (twin.completeness < COMPLETE))


def uncertain_struts(twin: Twin, printed: np.ndarray) -> np.ndarray:
    """Rising indices of the printed struts, (E,) bool, that the views do not determine; not the missing ones."""
    return np.flatnonzero(printed & (twin.completeness >= COMPLETE) & (twin.confidence < CERTAIN))


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
