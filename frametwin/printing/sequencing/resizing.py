"""The next batch made smaller or larger while the print goes on; the order of the struts stays."""

from __future__ import annotations

import numpy as np

from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.batches import LARGEST, SMALLEST

MOST_DRIFT = 0.5
"""Of the bead: what a joint may drift while a batch is laid. It is anticipated, but only as well as it is known."""

STANDSTILL = 0.05
"""Of the bead: where joints drift less even in a batch twice as long, the cameras need not look so soon."""


def suitable_size(size: int, drift: float) -> int:
    """How many struts the next batch should have.

    Parameters
    ----------
    size
        How many it has.
    drift
        Largest drift of a joint with each strut that is laid, as a share of the bead.
    """
    if drift * size > MOST_DRIFT:
        return min(size, max(SMALLEST, int(MOST_DRIFT / drift)))
    if drift * 2.0 * size < STANDSTILL:
        return max(size, min(2 * size, 2 * LARGEST))
    return size


def resized(sequence: PrintSequence, batch: int, size: int) -> PrintSequence:
    """Give a batch so many struts, if there are as many: what is too much for it makes the next one, before the others.

    Parameters
    ----------
    sequence
        The order; batches before stay as they are.
    batch
        The one to change.
    size
        How many struts, at least one.
    """
    first = int(np.searchsorted(sequence.batch, batch))
    old = sequence.batch[first:]
    numbers = np.where(np.arange(len(old)) < size, batch - 1, old)  # below all others
    numbers = batch + np.unique(numbers, return_inverse=True)[1]
    if np.array_equal(numbers, old):
        return sequence
    return PrintSequence(
        sequence.struts, sequence.start, sequence.axis, np.concatenate([sequence.batch[:first], numbers])
    )
