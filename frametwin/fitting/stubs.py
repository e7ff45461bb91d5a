"""Struts hardly longer than they are thick: one sees the joints that they connect, and next to nothing of them.

A frame may stand on such struts, and then the first batches of its print have more of them than of any others.
"""

from __future__ import annotations

import numpy as np

STUB = 4.0
"""Radii of the longest stub: two diameters."""

FEW = 0.05
"""Share of the struts up to which stubs do not change what is typical."""


def are_stubs(lengths: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(E,) array of bool: struts of lengths (E,) and radii (E,) in mm that are stubs."""
    return np.asarray(lengths < STUB * radius)


def tell_typical(lengths: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(E,) array of bool: struts of lengths (E,) and radii (E,) that tell what is typical of a frame.

    All of them, or where stubs are many, the others; where there is nothing else, stubs.
    """
    stubs = are_stubs(lengths, radius)
    return ~stubs if FEW < stubs.mean() < 1.0 else np.ones_like(stubs)
