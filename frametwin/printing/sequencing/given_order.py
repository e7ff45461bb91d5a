"""Orders that come with a frame: kept as they are, and checked.

===================  ==================================================================================================
source               what it holds
===================  ==================================================================================================
the frame's batches  ``batch`` of a frame file, ``layer_id`` of an assembly: groups one after the other, free inside
pychoreo             JSON with ``plan``: [[n1, n2], ...], directed struts by their joints
RL3DPToolpathPlanner text ``Path: [n0, n1, ...]``, a walk over joints; pairs that are no strut are mere moves
FrameTwin            `frametwin.printing.records.sequence_file`: the axes are found anew
===================  ==================================================================================================
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from frametwin.arrays import checked_array
from frametwin.errors import InputError
from frametwin.files import PathLike, parse_json, read_text
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.records.sequence_file import FORMAT, parse_sequence
from frametwin.printing.sequencing.batches import split_batches
from frametwin.printing.sequencing.clearance import unpacked_hits
from frametwin.printing.sequencing.reachability import OrderSettings
from frametwin.printing.sequencing.removal import SearchSpace
from frametwin.printing.sequencing.removal_kernels import FREEDOM
from frametwin.printing.sequencing.stability import total_compliance
from frametwin.wording import having, listed

SHOWN = 3
"""Faults that a refusal tells."""


@dataclass(frozen=True, eq=False)
class GivenOrder:
    """What is laid down of an order.

    Attributes
    ----------
    struts : (E,) int64 array, optional
        All struts in their order; ``None`` where only the batches are given.
    start : (E,) int64 array, optional
        Vertex at which each of ``struts`` begins; ``None`` where that is open.
    batch : (E,) int64 array, optional
        Batch of each strut, by its number in the frame; ``None`` where that is open.
    source
        What to call the order in messages.
    """

    struts: np.ndarray | None = None
    start: np.ndarray | None = None
    batch: np.ndarray | None = None
    source: str = "order"

    @property
    def is_complete(self) -> bool:
        """True if the order of the single struts is given."""
        return self.struts is not None

    def check(self, frame: Wireframe) -> None:
        """Refuse an order of another frame.

        Raises
        ------
        InputError
            If struts are missing, named twice or unknown.
        """
        count = frame.strut_count
        remedy = "give the order of this frame"
        if self.batch is not None and len(self.batch) != count:
            raise InputError.at(self.source, "batch", f"has {len(self.batch)} values for {count} struts", remedy)
        if self.struts is None:
            return
        times = np.bincount(self.struts, minlength=count)
        if len(times) > count or (times > 1).any():
            which = int(np.argmax(times > 1)) if (times > 1).any() else len(times) - 1
            problem = f"strut {which} is laid twice" if (times > 1).any() else f"strut {which} does not exist"
            raise InputError.at(self.source, "order", problem, remedy)
        missing = np.flatnonzero(times == 0)
        if len(missing):
            raise InputError.at(self.source, "order", f"{listed(missing)} of {count} never come", remedy)
        if self.start is not None and not (frame.edges[self.struts] == self.start[:, None]).any(axis=1).all():
            raise InputError.at(self.source, "order", "a strut begins at a vertex that is not its own", remedy)

    def stage(self, frame: Wireframe) -> np.ndarray:
        """(E,) int64 array: batch of each strut, zeros where that is open."""
        return np.zeros(frame.strut_count, dtype=np.int64) if self.batch is None else self.batch

    def after(self, frame: Wireframe, first: np.ndarray, size: int) -> GivenOrder:
        """This order with other struts before it.

        Parameters
        ----------
        frame
            What has all of them.
        first : (N,) int64 array
            Struts that are not in this order, each with one end on the plate.
        size
            How many of them make a batch.
        """
        batch = np.zeros(frame.strut_count, dtype=np.int64)
        batch[first] = np.arange(len(first)) // size
        rest = np.setdiff1d(np.arange(frame.strut_count), first)
        batch[rest] = batch[first].max() + 1 + (0 if self.batch is None else self.batch - self.batch.min())
        if self.struts is None:
            return replace(self, batch=batch)
        struts = np.concatenate([first, self.struts])
        ends = frame.edges[first]
        feet = np.where(frame.grounded[ends[:, 0]], ends[:, 0], ends[:, 1])
        start = None if self.start is None else np.concatenate([feet, self.start])
        return GivenOrder(struts, start, batch, self.source)


def order_of_frame(frame: Wireframe) -> GivenOrder | None:
    """The batches of the frame itself, if it has more than one."""
    if len(np.unique(frame.batch)) < 2:
        return None
    return GivenOrder(batch=frame.batch, source=frame.name)


def read_given_order(path: PathLike, frame: Wireframe) -> GivenOrder:
    """Read an order of ``frame`` from a file of one of the kinds above.

    Joints are counted from 0 in the order of the frame's file.

    Raises
    ------
    InputError
        If the file is of no known kind, damaged, or does not fit the frame.
    """
    text = read_text(path)
    if Path(path).suffix.lower() != ".json" and not text.lstrip().startswith("{"):
        order = _from_walk(_walk(text, path), frame, path)
    else:
        data = parse_json(text, path)
        if data.get("format") == FORMAT:
            order = order_of_sequence(parse_sequence(data, path), frame, str(path))
        elif "plan" in data:
            order = _from_plan(data["plan"], frame, path)
        else:
            raise InputError.at(path, "file", "holds no order of printing", f'give "plan": [[n1, n2], ...] or {FORMAT}')
    order.check(frame)
    return order


def order_of_sequence(sequence: PrintSequence, frame: Wireframe, source: str = "sequence") -> GivenOrder:
    """The struts, starts and batches of a sequence, without its axes.

    Raises
    ------
    InputError
        If it is not one of this frame.
    """
    sequence.end_in(frame)
    batch = np.zeros(frame.strut_count, dtype=np.int64)
    batch[sequence.struts] = sequence.batch
    return GivenOrder(sequence.struts, sequence.start, batch, source)


def keep_order(frame: Wireframe, given: GivenOrder, space: SearchSpace, settings: OrderSettings) -> PrintSequence:
    """Keep a complete order; find the tool's axes, ends where they are open, and batches where they are open.

    Raises
    ------
    InputError
        If a strut begins in the air or cannot be laid without contact, and ``settings`` do not allow that.
    """
    assert given.struts is not None
    printed, there = np.zeros(frame.strut_count, dtype=bool), frame.grounded.copy()
    begun, axes, faults = [], [], []
    for n, strut in enumerate(given.struts.tolist()):
        open_ends = [0, 1] if given.start is None else [int(frame.edges[strut, 1] == given.start[n])]
        standing = [end for end in open_ends if there[frame.edges[strut, end]]]
        if not standing:
            faults.append(f"{having([strut])} its start in the air")
        end, axis, hits = _best_orientation(space, strut, standing or open_ends, printed)
        if axis < 0:
            raise InputError.at(
                given.source, "order", f"{having([strut])} no direction for the tool", "allow more tilt"
            )
        if hits.any():
            faults.append(f"strut {strut} cannot be laid without touching {listed(np.flatnonzero(hits))}")
        begun.append(end)
        axes.append(axis)
        printed[strut] = True
        there[frame.edges[strut]] = True
    if faults and not settings.allow_contact:
        shown = "; ".join(faults[:SHOWN]) + (f"; and {len(faults) - SHOWN} more" if len(faults) > SHOWN else "")
        raise InputError.at(
            given.source, "order", f"cannot be printed as it is: {shown}", "allow contact, or plan anew"
        )
    if given.batch is None:
        batch = split_batches(total_compliance(frame, given.struts), settings.batch_size_for(frame))
    else:
        batch = np.cumsum(np.diff(given.batch[given.struts], prepend=given.batch[given.struts[0]]) != 0)
    start = frame.edges[given.struts, begun]
    return PrintSequence(given.struts, start, settings.axes[axes], batch, source=given.source)


def _best_orientation(
    space: SearchSpace, strut: int, ends: list[int], printed: np.ndarray
) -> tuple[int, int, np.ndarray]:
    """The end to begin at and the orientation with the fewest hits, of those the cheapest; and what is hit (E,)."""
    hit = unpacked_hits(space.bits[strut], len(printed)) & printed  # (D, E)
    best: tuple[float, float, int, int] | None = None
    for end in ends:
        allowed = space.allowed[strut, :, end]
        if not allowed.any():
            continue
        counts = np.where(allowed, hit.sum(axis=1), np.iinfo(np.int64).max)
        least = counts == counts.min()
        free = (space.near & least).sum(axis=1) / np.maximum(1, space.near.sum(axis=1))
        costs = np.where(least, space.cost[strut, :, end] - FREEDOM * free, np.inf)
        axis = int(np.argmin(costs))
        choice = (float(counts.min()), float(costs[axis]), end, axis)
        best = choice if best is None else min(best, choice)
    if best is None:
        return ends[0], -1, np.zeros(len(printed), dtype=bool)
    return best[2], best[3], hit[best[3]]


def _strut_between(frame: Wireframe) -> dict[tuple[int, int], int]:
    pairs = np.sort(frame.edges, axis=1).tolist()
    return {(a, b): strut for strut, (a, b) in enumerate(pairs)}


def _from_plan(plan: Any, frame: Wireframe, path: PathLike) -> GivenOrder:
    pairs = checked_array(plan, "i", (None, 2), str(path), "plan")
    known = _strut_between(frame)
    struts = []
    for n, (a, b) in enumerate(pairs.tolist()):
        strut = known.get((min(a, b), max(a, b)))
        if strut is None:
            raise InputError.at(
                path, f"plan[{n}]", f"{(a, b)} is no strut of {frame.name}", "give the plan of this frame"
            )
        struts.append(strut)
    return GivenOrder(np.array(struts, dtype=np.int64), pairs[:, 0], None, str(path))


def _walk(text: str, path: PathLike) -> list[int]:
    match = re.search(r"Path:\s*\[([^\]]*)\]", text)
    if match is None:
        raise InputError.at(path, "Path", "is missing", "write Path: [n0, n1, ...]")
    words = match.group(1).replace(",", " ").split()
    if not all(re.fullmatch(r"\d{1,9}", word) for word in words):
        raise InputError.at(path, "Path", "is no list of vertex indices", "write Path: [n0, n1, ...]")
    return [int(word) for word in words]


def _from_walk(walk: list[int], frame: Wireframe, path: PathLike) -> GivenOrder:
    """Struts are laid when the walk comes along them for the first time."""
    if walk and max(walk) >= frame.vertex_count:
        problem = f"names vertex {max(walk)} of {frame.vertex_count}"
        raise InputError.at(path, "Path", problem, "give the path of this frame")
    known = _strut_between(frame)
    laid: dict[int, int] = {}
    for a, b in zip(walk, walk[1:], strict=False):
        strut = known.get((min(a, b), max(a, b)))
        if strut is not None and strut not in laid:
            laid[strut] = a
    struts = np.fromiter(laid.keys(), dtype=np.int64, count=len(laid))
    return GivenOrder(struts, np.fromiter(laid.values(), dtype=np.int64, count=len(laid)), None, str(path))
