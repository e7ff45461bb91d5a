"""Which points are one: welding within a tolerance, with numpy alone."""

from __future__ import annotations

import numpy as np

_DIRECTION = np.array([0.5403023058681398, 0.6469966392206304, 0.5380295999126094])  # along no axis or diagonal


def weld(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Number the places of points; points within ``tolerance`` of each other, also in a chain, are one place.

    Parameters
    ----------
    points
        (P, 3).
    tolerance
        In the unit of the points; 0 welds only what is equal.

    Returns
    -------
    (P,) int64 numbers of the places, from 0 in the order of their first points.
    """
    distinct, same = np.unique(np.asarray(points, dtype=np.float64) + 0.0, axis=0, return_inverse=True)
    label = np.arange(len(distinct))
    first, second = _near_pairs(distinct, tolerance)
    while len(first):  # the smaller number spreads until every chain agrees
        before = label.copy()
        np.minimum.at(label, first, label[second])
        np.minimum.at(label, second, label[first])
        label = label[label]
        if np.array_equal(label, before):
            break
    return ordered(label[same.ravel()])


def ordered(labels: np.ndarray) -> np.ndarray:
    """Renumber labels (P,) from 0 in the order in which they first occur."""
    _, first, group = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[group.ravel()]


def _near_pairs(points: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of points not further apart than the tolerance, by a sweep along a general direction."""
    along = points @ (_DIRECTION / np.linalg.norm(_DIRECTION))
    order = np.argsort(along, kind="stable")
    along, place = along[order], points[order]
    first, second = [], []
    for step in range(1, len(points)):
        near = np.flatnonzero(along[step:] - along[:-step] <= tolerance)
        if not len(near):
            break
        near = near[np.linalg.norm(place[near + step] - place[near], axis=1) <= tolerance]
        first.append(order[near])
        second.append(order[near + step])
    none = np.empty(0, dtype=np.int64)
    return np.concatenate([none, *first]), np.concatenate([none, *second])
