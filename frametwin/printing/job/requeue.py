"""Lost struts put into the order again."""

from __future__ import annotations

import numpy as np

from frametwin.errors import InputError
from frametwin.printing.records.sequence import PrintSequence


def laid_again(sequence: PrintSequence, struts: np.ndarray, batch: int) -> PrintSequence:
    """Take some struts to the start of the batch after ``batch``, or to a batch of their own at the end.

    Parameters
    ----------
    sequence
        The order.
    struts : (N,) int64 array
        Of the batches up to ``batch``; their own order and axes stay.
    batch
        The last one laid.

    Raises
    ------
    InputError
        If nothing of the first batch would be left in its place, or nothing at all: the print has collapsed.
    """
    if len(struts) == 0:
        return sequence
    chosen = np.isin(sequence.struts, struts)
    if chosen[sequence.batch == 0].all():
        remedy = "clear the plate, and print from the start"
        raise InputError.at("sequence", "batch", "every strut of batch 0 is lost", remedy)
    before = np.flatnonzero(~chosen & (sequence.batch <= batch))
    again, after = np.flatnonzero(chosen), np.flatnonzero(sequence.batch > batch)
    order = np.concatenate([before, again, after])
    numbers = np.array(sequence.batch)
    numbers[again] = batch + 1
    return PrintSequence(sequence.struts[order], sequence.start[order], sequence.axis[order], numbers[order])
