"""Tool axes looked at again on a plan that was adapted: kept where they are still free, else the nearest free ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.clearance import joined_struts, struts_hit
from frametwin.printing.sequencing.directions import tool_directions
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.tool_orientation import allowed_orientations
from frametwin.wording import listed, shortened


@dataclass(frozen=True, eq=False)
class CheckedAxes:
    """The tool's axes for the struts of a batch.

    Attributes
    ----------
    axis : (N, 3) array
        Unit vectors from the tip upwards.
    changed : (N,) bool array
        The axis is another than planned.
    contacts
        Sentences about struts that cannot be laid without touching others, if any.
    """

    axis: np.ndarray
    changed: np.ndarray
    contacts: tuple[str, ...]


def checked_axes(
    plan: Wireframe, sequence: PrintSequence, batch: int, nozzle: Nozzle, max_tilt: float, allow_contact: bool = False
) -> CheckedAxes:
    """Look at the planned axes of one batch beside all that is laid before each strut.

    Parameters
    ----------
    plan
        Where the struts are to be, those printed where they are.
    sequence, batch
        Whose axes.
    nozzle
        The tool.
    max_tilt : float, rad
        How far it may lean from the vertical.
    allow_contact
        Take the axis with the fewest contacts where none is free, instead of refusing.

    Raises
    ------
    InputError
        If a strut cannot be laid without contact, and that is not allowed.
    """
    nozzle = nozzle.long_enough(plan)
    place = np.flatnonzero(sequence.batch == batch)
    struts, axis = sequence.struts[place], sequence.axis[place].copy()
    when = np.full(plan.strut_count, len(sequence))
    when[sequence.struts] = np.arange(len(sequence))
    before = when[None, :] < place[:, None]
    joined = joined_struts(plan, struts=struts)
    side = (plan.edges[struts, 0] != sequence.start[place]).astype(np.int64)
    hit = struts_hit(plan, nozzle, struts, axis[:, None], before, joined)[:, 0].any(axis=1)
    bad = np.flatnonzero(hit | ~_still_allowed(plan, nozzle, struts, axis, side))
    contacts = []
    if len(bad):
        others = tool_directions(max_tilt)
        part = plan.subset(np.isin(np.arange(plan.strut_count), struts[bad]))[0]
        rank = np.argsort(np.argsort(struts[bad]))
        allowed = allowed_orientations(part, nozzle, others)[rank]  # the subset is in the order of the frame
        each = np.broadcast_to(others, (len(bad), *others.shape))
        hits = struts_hit(plan, nozzle, struts[bad], each, before[bad], joined[bad])
        for n, free, ways in zip(bad.tolist(), allowed, hits, strict=True):
            axis[n], touched = _nearest(axis[n], others, free[:, side[n]], ways)
            if touched is None:
                contacts.append(
                    f"strut {struts[n]}: the nozzle has no way past the plate and the strut's own beginning"
                )
            elif len(touched):
                contacts.append(f"strut {struts[n]}: the nozzle touches {listed(touched)}")
    if contacts and not allow_contact:
        shown = shortened(contacts, 3, gap="; ")
        remedy = "take a smaller nozzle, allow more tilt, or let it touch: allow contact when planning the job, or"
        remedy += " accept contact when answering the batch before"
        raise InputError.at(plan.name, f"batch {batch}", shown, remedy)
    changed = (axis != sequence.axis[place]).any(axis=1)
    return CheckedAxes(axis, changed, tuple(contacts))


def _still_allowed(
    plan: Wireframe, nozzle: Nozzle, struts: np.ndarray, axis: np.ndarray, side: np.ndarray
) -> np.ndarray:
    """(N,) bool: the planned axis still spares the plate and the strut itself."""
    axes, which = np.unique(axis, axis=0, return_inverse=True)
    return allowed_orientations(plan, nozzle, axes, struts)[np.arange(len(struts)), which.ravel(), side]


def _nearest(
    planned: np.ndarray, others: np.ndarray, allowed: np.ndarray, hits: np.ndarray
) -> tuple[np.ndarray, np.ndarray | None]:
    """The allowed axis with the fewest hits, of those the nearest to the planned one, and what it hits."""
    if not allowed.any():
        return planned, None
    counts = np.where(allowed, hits.sum(axis=1), np.iinfo(np.int64).max)
    nearness = np.where(counts == counts.min(), others @ planned, -2.0)
    best = int(np.argmax(nearness))
    return others[best], np.flatnonzero(hits[best])
