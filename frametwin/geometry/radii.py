"""Radii along struts."""

from __future__ import annotations

import numpy as np


def radii_at(thickness: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Radii (E, S) at parameters u (E, S) of struts with radii (E, K) at even parameters, linear in between."""
    place = u * (thickness.shape[1] - 1)
    left = np.clip(np.floor(place).astype(np.int64), 0, thickness.shape[1] - 2)
    share = place - left
    return (1.0 - share) * np.take_along_axis(thickness, left, 1) + share * np.take_along_axis(thickness, left + 1, 1)
