"""Where a print pauses for the cameras."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe

BATCHES, SMALLEST, LARGEST = 20, 4, 12
"""Batches of a print where no size is given, and the least and most struts in one of them. A simulated Femur lost
struts in batches of twenty, about those of the paper (its Bunny-Head of 154 struts is shown in eight states)."""

LEEWAY = 0.15
"""Share of a batch's size by which its end may move to where the print is less compliant."""


def default_batch_size(frame: Wireframe) -> int:
    """Struts between two looks of the cameras where nobody says how many: a twentieth of all, from 4 to 12.

    What sags in between is found too late for the struts of the same batch, so that long batches lose struts.
    """
    return min(LARGEST, max(SMALLEST, round(frame.strut_count / BATCHES)))


def split_batches(compliance: np.ndarray, size: int) -> np.ndarray:
    """Divide an order into batches of about the same size, each ended where the print is least compliant.

    Parameters
    ----------
    compliance : (N,) array
        After each strut; see `frametwin.printing.sequencing.stability.total_compliance`.
    size
        Struts in a batch.

    Returns
    -------
    (N,) int64 array
        Batch of each strut, rising from 0.
    """
    count = len(compliance)
    wanted = max(1, round(count / size))
    leeway = int(LEEWAY * size)
    result = np.zeros(count, dtype=np.int64)
    last = 0
    for k in range(1, wanted):
        middle = round(k * count / wanted)
        ends = np.arange(max(last + 1, middle - leeway), min(count - 1, middle + leeway) + 1)
        distance = np.abs(ends - middle) / max(1, leeway)
        last = int(ends[np.argmin(compliance[ends - 1] + 0.01 * distance)])
        result[last:] = k
    return result
