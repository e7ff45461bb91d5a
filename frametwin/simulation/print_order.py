"""In which order the struts of a frame are laid, and what stands when a share of them is done."""

from __future__ import annotations

import heapq

import numpy as np

from frametwin.errors import InputError
from frametwin.geometry.wireframe import Wireframe


def print_order(frame: Wireframe) -> np.ndarray:
    """Order the struts so that each stands on the ground or on struts before it.

    Batches come one after the other, and within a batch the strut with the lowest upper end. A strut of a
    later batch is taken early only where nothing of its batch or of those before it is within reach.

    Parameters
    ----------
    frame
        The plan; what is marked as printed plays no part.

    Returns
    -------
    (E',) strut indices. Struts without a connection to a grounded vertex are left out.
    """
    ends = frame.vertices[frame.edges, 2]  # (E, 2) heights
    keys = list(zip(frame.batch.tolist(), ends.max(axis=1).tolist(), ends.min(axis=1).tolist(), strict=True))
    at_vertex: list[list[int]] = [[] for _ in range(frame.vertex_count)]
    for strut, (start, end) in enumerate(frame.edges.tolist()):
        at_vertex[start].append(strut)
        at_vertex[end].append(strut)
    reached = np.zeros(frame.vertex_count, dtype=bool)
    waiting: list[tuple[tuple[int, float, float], int]] = []
    queued: set[int] = set()

    def reach(vertex: int) -> None:
        if not reached[vertex]:
            reached[vertex] = True
            for strut in at_vertex[vertex]:
                if strut not in queued:
                    queued.add(strut)
                    heapq.heappush(waiting, (keys[strut], strut))

    for vertex in np.flatnonzero(frame.grounded).tolist():
        reach(vertex)
    order = []
    while waiting:
        _, strut = heapq.heappop(waiting)
        order.append(strut)
        for vertex in frame.edges[strut].tolist():
            reach(vertex)
    return np.array(order, dtype=np.int64)


def print_share(frame: Wireframe, share: float) -> Wireframe:
    """Mark the first ``share`` of the struts, in `print_order`, as printed, and the others as not.

    Parameters
    ----------
    frame
        The plan.
    share
        Above 0 and up to 1; at least one strut is printed, and 1 prints all of them.

    Raises
    ------
    InputError
        If the share is out of range, or fewer struts than that are connected to the ground.
    """
    if not 0.0 < share <= 1.0:
        raise InputError.at("settings", "printed", f"is {share:g}", "give a share above 0 and up to 1")
    if share == 1.0:
        return frame.replace(printed=np.ones(frame.strut_count, dtype=bool))
    wanted = max(1, round(share * frame.strut_count))
    order = print_order(frame)
    if len(order) < wanted:
        raise InputError.at(
            frame.name,
            "grounded",
            f"only {len(order)} of {frame.strut_count} struts are connected to the ground, {wanted} are needed",
            "mark the vertices that stand on the base as grounded, or print a smaller share",
        )
    printed = np.zeros(frame.strut_count, dtype=bool)
    printed[order[:wanted]] = True
    return frame.replace(printed=printed)
