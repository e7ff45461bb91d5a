"""Plan the order in which a frame is printed, so that every strut can be laid.

Every strut begins on the plate or on something printed, and the tool reaches it past all that is printed before. The
search runs backwards, from the finished frame (`removal`); what it takes away next is high up and hangs on joints that
are compliant anyhow, so that a cantilever is supported soon after it was laid. Of a few such orders the one is taken in
which the print is expected to sag least (`sagging`). A strut whose two ends are both on the
structure closes a cycle of the graph; how many do is the same in every order: struts less joints off the plate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.batches import split_batches
from frametwin.printing.sequencing.clearance import unpacked_hits
from frametwin.printing.sequencing.given_order import GivenOrder, keep_order
from frametwin.printing.sequencing.reachability import OrderSettings, search_space
from frametwin.printing.sequencing.removal import Removal, SearchSpace, removable_from, remove_all
from frametwin.printing.sequencing.sagging import heights_to_try, least_sagging
from frametwin.printing.sequencing.stability import total_compliance
from frametwin.progress import Progress, ProgressCallback, report
from frametwin.wording import having, listed

__all__ = ["OrderSettings", "closing_struts", "plan_sequence", "require_way_to_plate"]


def plan_sequence(
    frame: Wireframe,
    settings: OrderSettings | None = None,
    given: GivenOrder | None = None,
    progress: ProgressCallback | None = None,
) -> PrintSequence:
    """Find the order of all struts, the end at which each begins, the tool's axis for each, and the batches.

    Parameters
    ----------
    frame
        The design; what is marked as printed plays no part.
    settings
        The tool and the batches.
    given
        An order to keep (see `given_order`): order, ends, axes and batches are found as far as it
        leaves them open.
    progress
        Called now and then; may cancel.

    Raises
    ------
    InputError
        If struts have no way to the plate, or no order is found; the sentence names them.
    """
    settings = OrderSettings() if settings is None else settings
    require_way_to_plate(frame)
    if given is not None:
        given.check(frame)
    space = search_space(frame, settings, progress)
    if given is not None and given.is_complete:
        return keep_order(frame, given, space, settings)
    stage = None if given is None else given.stage(frame)
    found = []
    for removal in _orders(frame, space, stage, settings, progress):
        if stage is None:
            batch = split_batches(total_compliance(frame, removal.struts), settings.batch_size_for(frame))
        else:
            batch = np.unique(stage[removal.struts], return_inverse=True)[1]
        start = frame.edges[removal.struts, removal.start]
        found.append(PrintSequence(removal.struts, start, settings.axes[removal.axis], batch, source=frame.name))
    return least_sagging(frame, found, progress)


def closing_struts(frame: Wireframe, sequence: PrintSequence) -> np.ndarray:
    """Find struts that end where the structure stands already, and so close a cycle of the graph.

    Returns
    -------
    (N,) bool array
        In the order of the sequence.

    Raises
    ------
    InputError
        If the sequence is not one of this frame.
    """
    end = sequence.end_in(frame)
    there = frame.grounded.copy()
    result = np.zeros(len(sequence), dtype=bool)
    for n in range(len(sequence)):
        result[n] = there[end[n]]
        there[[end[n], sequence.start[n]]] = True
    return result


def require_way_to_plate(frame: Wireframe) -> None:
    """Refuse a frame with struts that hang on nothing.

    Raises
    ------
    InputError
        The sentence names the struts.
    """
    _, labels = frame.components()
    standing = np.unique(labels[frame.grounded & (labels >= 0)])
    floating = np.flatnonzero(~np.isin(labels[frame.edges[:, 0]], standing))
    if len(floating):
        remedy = "mark what stands on the plate as grounded, or join the parts"
        raise InputError.at(frame.name, "grounded", f"{having(floating)} no way to the plate", remedy)


def _orders(
    frame: Wireframe,
    space: SearchSpace,
    stage: np.ndarray | None,
    settings: OrderSettings,
    progress: ProgressCallback | None,
) -> list[Removal]:
    """Complete orders to choose from; where none of the usual ways leads to one, the first that is found."""
    heights, ways = heights_to_try(frame, space), []
    for number, height in enumerate(heights):
        report(progress, Progress("ordering the struts", number, len(heights)))
        ways.append(remove_all(replace(space, height=height), stage))
    complete = [way for way in ways if not way.remaining.any()]
    return complete or [_search(frame, space, stage, settings, ways[0], progress)]


def _search(
    frame: Wireframe,
    space: SearchSpace,
    stage: np.ndarray | None,
    settings: OrderSettings,
    best: Removal,
    progress: ProgressCallback | None,
) -> Removal:
    """Search on from the first attempt, the later ones with shuffled heights; then put up with contacts, if allowed."""
    for attempt in range(1, settings.attempts):
        report(progress, Progress("ordering the struts", attempt, settings.attempts))
        rng = np.random.default_rng(np.random.SeedSequence([settings.seed, attempt]))
        perturbation = rng.normal(scale=float(attempt), size=frame.strut_count)
        removal = remove_all(space, stage, perturbation=perturbation)
        if not removal.remaining.any():
            return removal
        if removal.remaining.sum() < best.remaining.sum():
            best = removal
    if not settings.allow_contact:
        raise _stuck(frame, space, best, stage)
    removal = remove_all(space, stage, tolerate=True)
    if removal.remaining.any():
        raise _stuck(frame, space, removal, stage)
    return removal


def _stuck(frame: Wireframe, space: SearchSpace, removal: Removal, stage: np.ndarray | None) -> InputError:
    """Say which struts cannot be laid last of those that must stand before the others, and what is in the way."""
    ends = removable_from(space, removal.remaining, stage)  # (E, 2)
    candidates = np.flatnonzero(ends.any(axis=1))
    usable = (space.allowed & ends[:, None, :]).any(axis=2)  # (E, D)
    barred = candidates[~usable[candidates].any(axis=1)]
    blocked = candidates[usable[candidates].any(axis=1)]
    problem = f"no order is found for {int(removal.remaining.sum())} of {frame.strut_count} struts"
    if len(barred):
        problem += f": {having(barred)} no direction from which the tool spares the plate and the strut's own beginning"
    if len(blocked):
        first = int(blocked[0])
        hits = np.where(usable[first], removal.hits[first], np.iinfo(np.int64).max)
        ways = unpacked_hits(space.bits[first, int(np.argmin(hits))], frame.strut_count) & removal.remaining
        problem += (
            f": the tool would collide in every direction at {listed(blocked)} (strut {first}: "
            f"{int(usable[first].sum())} directions, the best one with {listed(np.flatnonzero(ways))})"
        )
    if not len(candidates):
        problem += ": each would leave others in the air"
    return InputError.at(frame.name, "order", problem, "take a smaller nozzle, allow more tilt, or allow contact")
