"""Temporary supports: columns from the plate to joints of a frame, printed along and cut off when all has cooled.

What hangs out sags by the third and fourth power of its length; a column under it carries along its axis, where struts
are stiff. A column is a chain of struts straight up from the plate, laid by the same nozzle: nobody has to put a prop
there. It sways while it stands alone, so its last piece is laid only when the first strut of the frame has come to the
joint, which would be where the column happens to end otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.geometry.bezier import evaluate
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.process.added_struts import plate_of, with_struts
from frametwin.printing.records.sequence import PrintSequence

LOWEST = 8.0
"""Height in radii of a strut from which a joint can have a column: lower ones hardly sag."""

ROOM = 4.0
"""Least distance between the axes of a column and of other struts of its radius, in radii."""

STEEP = 0.5
"""Run over rise of a strut below which nothing is put under its upper joint: that carries it, and is in the way."""

BELOW = 6.0
"""Radii below its top from which a column keeps clear of the joint's own struts too, by as much as `STEEP` ones do."""

SAMPLES = 25
"""Points of each strut between which it is taken to be straight."""


def supportable(frame: Wireframe, columns: Sequence[int] = ()) -> np.ndarray:
    """Mark the joints (V,) from which nothing is in the way of a column down to the plate.

    Parameters
    ----------
    frame
        The design.
    columns
        Joints that have one already.

    Raises
    ------
    InputError
        If nothing of the frame stands on the plate.
    """
    result = np.zeros(frame.vertex_count, dtype=bool)
    plate, radius = plate_of(frame), float(np.median(frame.radius))
    points = evaluate(frame.control_points, np.linspace(0.0, 1.0, SAMPLES))
    taken = frame.vertices[list(columns), :2]
    high = frame.vertices[:, 2] - plate > LOWEST * radius
    for joint in np.flatnonzero(high & (frame.degree > 0) & ~frame.grounded).tolist():
        place = frame.vertices[joint]
        own = (frame.edges == joint).any(axis=1)
        top = place[2] + np.where(own, -BELOW, ROOM) * radius
        apart = _beside(points, top, place[:2])
        least = np.where(own, STEEP * BELOW, ROOM) * radius + np.maximum(frame.radius - radius, 0.0)
        clear = bool((apart > least).all()) and bool((np.linalg.norm(taken - place[:2], axis=1) > ROOM * radius).all())
        result[joint] = clear and not _carried(frame, joint, own)
    return result


def _beside(points: np.ndarray, top: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(E,) array, mm: how far, seen from above, struts are from a place (2,), of what is of them below ``top`` (E,).

    ``points`` (E, S, 3) are on the struts, and straight lines between them; infinite where nothing is below.
    """
    start, way = points[:, :-1, :2], np.diff(points[..., :2], axis=1)
    square = np.maximum(np.sum(way**2, axis=2), 1e-12)
    share = np.clip(np.sum((place - start) * way, axis=2) / square, 0.0, 1.0)
    apart = np.linalg.norm(start + share[..., None] * way - place, axis=2)
    low = np.maximum(points[:, :-1, 2], points[:, 1:, 2]) < top[:, None]
    return np.asarray(np.where(low, apart, np.inf).min(axis=1))


def _carried(frame: Wireframe, joint: int, own: np.ndarray) -> bool:
    """Whether one of a joint's struts (E,) bool goes down from it steeply."""
    others = frame.edges[own].sum(axis=1) - joint
    ways = frame.vertices[others] - frame.vertices[joint]
    return bool((np.linalg.norm(ways[:, :2], axis=1) < STEEP * -ways[:, 2]).any())


def with_supports(frame: Wireframe, joints: Sequence[int]) -> Wireframe:
    """Add columns to a frame, whose struts and joints come after those of the frame.

    Parameters
    ----------
    frame
        The design.
    joints
        Under which; with none, the frame is given back. Each piece of a column is about as long as a typical strut,
        and in the first batch that a strut of the joint is in.

    Raises
    ------
    InputError
        If nothing of the frame stands on the plate.
    """
    if not len(joints):
        return frame
    plate, typical = plate_of(frame), float(np.median(frame.lengths))
    points: list[np.ndarray] = []
    edges: list[tuple[int, int]] = []
    grounded: list[bool] = []
    batch: list[int] = []
    for joint in joints:
        top = frame.vertices[joint]
        pieces = max(1, round((top[2] - plate) / typical))
        nodes = [*(frame.vertex_count + len(points) + np.arange(pieces)).tolist(), int(joint)]
        heights = plate + (top[2] - plate) * np.arange(pieces) / pieces
        points += [np.array([top[0], top[1], height]) for height in heights]
        grounded += [k == 0 for k in range(pieces)]
        edges += list(zip(nodes, nodes[1:], strict=False))
        batch += [int(frame.batch[(frame.edges == joint).any(axis=1)].min())] * pieces
    return with_struts(
        frame,
        np.array(points),
        np.array(edges, dtype=np.int64),
        grounded=np.array(grounded),
        batch=np.array(batch, dtype=np.int64),
    )


def supported_sequence(sequence: PrintSequence, supported: Wireframe, struts: int) -> PrintSequence:
    """The order of a frame with its columns: all but the last piece of each before the first strut of its joint.

    Parameters
    ----------
    sequence
        Of the frame alone.
    supported
        See `with_supports`.
    struts
        Of the frame alone; all others are pieces of columns.
    """
    waiting = columns_of(supported, struts, supported.strut_count - struts)
    order: list[int] = []
    after: list[int] = []  # the strut of the frame along with which each is laid, by its place
    for place, strut in enumerate(sequence.struts.tolist()):
        columns = [waiting.pop(joint) for joint in supported.edges[strut].tolist() if joint in waiting]
        pieces = [*sum((column[:-1] for column in columns), []), strut, *(column[-1] for column in columns)]
        order += pieces
        after += [place] * len(pieces)
    own = np.array(order) < struts
    start = np.where(own, sequence.start[after], supported.edges[order, 0])
    axis = np.where(own[:, None], sequence.axis[after], (0.0, 0.0, 1.0))
    return PrintSequence(np.array(order), start, axis, sequence.batch[after], source="sequence")


def columns_of(supported: Wireframe, struts: int, pieces: int) -> dict[int, list[int]]:
    """The pieces of each column, from the plate upwards, by the joint on top of it.

    Parameters
    ----------
    supported
        See `with_supports`.
    struts, pieces
        How many the frame alone has, and how many after those are of columns.
    """
    columns: dict[int, list[int]] = {}
    waiting: list[int] = []
    own = set(np.unique(supported.edges[:struts]).tolist())
    for piece in range(struts, struts + pieces):
        waiting.append(piece)
        top = int(supported.edges[piece, 1])
        if top in own:
            columns[top], waiting = waiting, []
    return columns
