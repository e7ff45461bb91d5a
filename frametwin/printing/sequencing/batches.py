"""Where a print pauses for the cameras."""

from __future__ import annotations

import numpy as np

from frametwin.geometry.wireframe import Wireframe

BATCHES, SMALLEST, LARGEST = 20, 4, 12
"""Batches of a print where no size is given, and the least and most struts in one of them. A simulated Femur lost
struts in batches of twenty, about those of the paper (its Bunny-Head of 154 struts is shown in eight states)."""

PLAY = 0.15
"""Share of a batch's size by which its end may move to where fewer cantilevers hang."""


def default_batch_size(frame: Wireframe) -> int:
    """Struts between two looks of the cameras where nobody says how many: a twentieth of all, from 4 to 12.

    What sags in between is found too late for the struts of the same batch, so that long batches lose struts.
    """
    return min(LARGEST, max(SMALLEST, round(frame.strut_count / BATCHES)))


def split_batches(loose: np.ndarray, size: int) -> np.ndarray:
    """(N,) batch of each strut of an order: about ``size`` in each, ended where its joints are least loose.

    Parameters
    ----------
    loose
        (N,) see `frametwin.printing.sequencing.stability.looseness`.
    size
        Struts in a batch.
    """
    count = len(loose)
    wanted = max(1, round(count / size))
    play = int(PLAY * size)
    result = np.zeros(count, dtype=np.int64)
    last = 0
    for k in range(1, wanted):
        middle = round(k * count / wanted)
        ends = np.arange(max(last + 1, middle - play), min(count - 1, middle + play) + 1)
        distance = np.abs(ends - middle) / max(1, play)
        last = int(ends[np.argmin(loose[ends - 1] + 0.01 * distance)])
        result[last:] = k
    return result
