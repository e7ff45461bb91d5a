"""Which of several orders lets the print sag least, by the beam model of a print in which nothing is corrected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.process.calibration import DOWN, linear_drift
from frametwin.printing.process.material import PrintSettings
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.removal import SearchSpace
from frametwin.progress import Progress, ProgressCallback, report

WORTH = 0.98
"""Share of an order's sag that another one must stay below to be taken instead: less is within the model's error."""


def heights_to_try(frame: Wireframe, space: SearchSpace) -> list[np.ndarray]:
    """Heights by which struts are taken away, each giving an order of its own; the first is the usual one.

    The path along the frame from the plate makes arches grow from their feet; mixed with the height above the plate it
    keeps the front level; taken thrice it lets compliant joints have less of a say.

    Returns
    -------
    list of (E,) arrays, in median strut lengths
        For `SearchSpace.height`.
    """
    plate = frame.vertices[frame.grounded, 2].min()
    above = (frame.vertices[frame.edges, 2].max(axis=1) - plate) / float(np.median(frame.lengths))
    return [space.height, 0.5 * (space.height + above), 3.0 * space.height]


def expected_sag(frame: Wireframe, sequence: PrintSequence) -> float:
    """Find how far the joint that sags most would sag until a print of the design is finished.

    Every strut is taken to attach where the design has its joints, in a typical PLA: the size means something
    beside that of another order alone.

    Returns
    -------
    float, mm
    """
    drift = linear_drift(frame, sequence, PrintSettings(increments=1), DOWN).sum(axis=(0, 3))
    return float(np.linalg.norm(drift, axis=1).max())


def least_sagging(
    frame: Wireframe, sequences: Sequence[PrintSequence], progress: ProgressCallback | None = None
) -> PrintSequence:
    """Choose the order in which the print sags least; the first where others gain next to nothing.

    Parameters
    ----------
    frame, sequences
        The design, and orders of all of its struts.
    progress
        Called before each; may cancel.

    Raises
    ------
    ValueError
        If there is none to choose from.
    """
    if not sequences:
        raise ValueError("no orders to choose from")
    if len(sequences) == 1:
        return sequences[0]
    sags = []
    for number, sequence in enumerate(sequences):
        report(progress, Progress("comparing orders", number, len(sequences)))
        sags.append(expected_sag(frame, sequence))
    best = int(np.argmin(np.nan_to_num(sags, nan=np.inf)))
    return sequences[best] if sags[best] < WORTH * sags[0] else sequences[0]
